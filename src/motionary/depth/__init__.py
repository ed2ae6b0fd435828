"""Poses of a person from the images of one depth camera.

After Baak (2012), chapter 8: images made ready, geodesic extrema of their points, poses of a
database that have their ends there, and the last pose fitted to the image; the image chooses.
"""

from typing import TYPE_CHECKING

from motionary.lazy import lazy_names

if TYPE_CHECKING:
    from motionary.depth.clouds import (
        Cloud,
        Extrema,
        Graph,
        PreparationSettings,
        build_graph,
        find_extrema,
        learn_background,
        prepare,
    )
    from motionary.depth.fitting import SurfaceSettings
    from motionary.depth.judging import TrackedPose, TrackerSettings
    from motionary.depth.offline import Tracking, camera_of, to_motion, track_recording
    from motionary.depth.poses import PoseDatabase, build_database, load_database
    from motionary.depth.tracking import DepthTracker

__all__ = [
    "Cloud",
    "DepthTracker",
    "Extrema",
    "Graph",
    "PoseDatabase",
    "PreparationSettings",
    "SurfaceSettings",
    "TrackedPose",
    "TrackerSettings",
    "Tracking",
    "build_database",
    "build_graph",
    "camera_of",
    "find_extrema",
    "learn_background",
    "load_database",
    "prepare",
    "to_motion",
    "track_recording",
]

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "clouds": "Cloud Extrema Graph PreparationSettings build_graph find_extrema "
        "learn_background prepare",
        "fitting": "SurfaceSettings",
        "judging": "TrackedPose TrackerSettings",
        "offline": "Tracking camera_of to_motion track_recording",
        "poses": "PoseDatabase build_database load_database",
        "tracking": "DepthTracker",
    },
)
