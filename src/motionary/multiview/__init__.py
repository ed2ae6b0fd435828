"""Keypoints of several calibrated cameras: sides put right, points in space, tracked bodies."""

from motionary.multiview.cameras import Sight, project, see, undistort
from motionary.multiview.exchange import LIMBS, Exchange, exchange_sources, find_exchanges
from motionary.multiview.priors import PoseMemory, remember_poses
from motionary.multiview.tracking import Tracking, track
from motionary.multiview.triangulation import Triangulated, triangulate
from motionary.multiview.untangling import Untangled, untangle
from motionary.multiview.views import FittedViews, find_offsets, fit_views

__all__ = [
    "LIMBS",
    "Exchange",
    "FittedViews",
    "PoseMemory",
    "Sight",
    "Tracking",
    "Triangulated",
    "Untangled",
    "exchange_sources",
    "find_exchanges",
    "find_offsets",
    "fit_views",
    "project",
    "remember_poses",
    "see",
    "track",
    "triangulate",
    "undistort",
    "untangle",
]
