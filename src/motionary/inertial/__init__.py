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
from motionary.inertial.detection import (
    DetectionSettings,
    DriftingCalibration,
    calibrate_drifting,
    find_wrong,
    heading_drift,
    without_drift,
)
from motionary.inertial.limbs import TrackedLimbs, simulate_sensors, track_limbs
from motionary.inertial.orientations import Lag, orient, synchronise

__all__ = [
    "Calibration",
    "CalibrationSettings",
    "CheckSettings",
    "DetectionSettings",
    "DirectionCalibration",
    "DriftingCalibration",
    "Lag",
    "LimbCheck",
    "TrackedLimbs",
    "TrackingCheck",
    "calibrate",
    "calibrate_direction",
    "calibrate_drifting",
    "calibrate_published",
    "check_tracking",
    "find_wrong",
    "heading_drift",
    "orient",
    "simulate_sensors",
    "synchronise",
    "track_limbs",
    "without_drift",
]
