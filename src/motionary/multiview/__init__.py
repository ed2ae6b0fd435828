"""Keypoints of several calibrated cameras: sides put right, points in space, tracked bodies."""

from motionary.multiview.cameras import (
    Sight,
    Triangulated,
    project,
    see,
    straighten,
    triangulate,
    undistort,
)
from motionary.multiview.exchange import LIMBS, Exchange, exchange_sources, find_exchanges
from motionary.multiview.live import ViewPose, ViewTracker
from motionary.multiview.poses import PoseMemory, remember_poses
from motionary.multiview.priors import (
    PRIORS_FILE,
    NamedPrior,
    derive_priors,
    find_rows,
    read_priors,
    write_priors,
)
from motionary.multiview.recordings import Tracking, Untangled, track, untangle
from motionary.multiview.regions import (
    Contour,
    RegionSettings,
    find_contours,
    fit_regions,
    follow_regions,
)
from motionary.multiview.views import FittedViews, find_offsets, fit_views

__all__ = [
    "LIMBS",
    "PRIORS_FILE",
    "Contour",
    "Exchange",
    "FittedViews",
    "NamedPrior",
    "PoseMemory",
    "RegionSettings",
    "Sight",
    "Tracking",
    "Triangulated",
    "Untangled",
    "ViewPose",
    "ViewTracker",
    "derive_priors",
    "exchange_sources",
    "find_contours",
    "find_exchanges",
    "find_offsets",
    "find_rows",
    "fit_regions",
    "fit_views",
    "follow_regions",
    "project",
    "read_priors",
    "remember_poses",
    "see",
    "straighten",
    "track",
    "triangulate",
    "undistort",
    "untangle",
    "write_priors",
]
