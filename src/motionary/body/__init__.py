"""A skinned body: posed, fitted, driven by motions, seen by cameras."""

from motionary.body.driving import DrivenPose, pose_from_motion
from motionary.body.fitting import Fit, FitSettings, fit_points, fit_shape, fit_surface
from motionary.body.model import (
    Body,
    Points,
    Pose,
    blend_matrix,
    jacobian,
    load_body,
    local_rotations,
    pose_body,
    skin,
)
from motionary.body.rendering import (
    Camera,
    DepthImage,
    DepthSettings,
    add_kinect_noise,
    add_time_of_flight_noise,
    find_shares,
    record_depth,
    render_depth,
    shade,
)

__all__ = [
    "Body",
    "Camera",
    "DepthImage",
    "DepthSettings",
    "DrivenPose",
    "Fit",
    "FitSettings",
    "Points",
    "Pose",
    "add_kinect_noise",
    "add_time_of_flight_noise",
    "blend_matrix",
    "find_shares",
    "fit_points",
    "fit_shape",
    "fit_surface",
    "jacobian",
    "load_body",
    "local_rotations",
    "pose_body",
    "pose_from_motion",
    "record_depth",
    "render_depth",
    "shade",
    "skin",
]
