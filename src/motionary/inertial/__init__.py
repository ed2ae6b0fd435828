"""Inertial sensors beside tracked motion: synchronised, calibrated, and where they disagree."""

from motionary.inertial.calibration import (
    Calibration,
    CalibrationSettings,
    DirectionCalibration,
    calibrate,
    calibrate_direction,
    calibrate_published,
)
from motionary.inertial.checking import (
    CheckSettings,
    LimbCheck,
    TrackingCheck,
    check_tracking,
)
from motionary.inertial.detection import DetectionSettings, find_wrong, heading_drift
from motionary.inertial.fusion import orient
from motionary.inertial.limbs import TrackedLimbs, track_limbs
from motionary.inertial.synchronising import Lag, synchronise

__all__ = [
    "Calibration",
    "CalibrationSettings",
    "CheckSettings",
    "DetectionSettings",
    "DirectionCalibration",
    "Lag",
    "LimbCheck",
    "TrackedLimbs",
    "TrackingCheck",
    "calibrate",
    "calibrate_direction",
    "calibrate_published",
    "check_tracking",
    "find_wrong",
    "heading_drift",
    "orient",
    "synchronise",
    "track_limbs",
]
