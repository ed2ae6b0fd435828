"""Depth images with the poses found in them, the least sure among them."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.plots import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from motionary.depth import Tracking

Floats = NDArray[np.float64]

_COLUMNS, _WIDTH, _HEIGHT = 4, 7.5, 2.4
_MARGIN_PX = 12


@style.house_style()
def plot_depth(images: Sequence[Floats], tracking: "Tracking") -> "Figure":
    """Picture of eight images with their poses: four through the recording, the least sure below.

    Parameters
    ----------
    images : depth (height, width) in metres, one for each pose
    tracking : what was found in them
    """
    from matplotlib.figure import Figure

    poses = tracking.poses
    seen = [k for k, pose in enumerate(poses) if pose.status != "none"]
    if len(images) != len(poses) or not seen:
        raise InvalidInput(
            f"a picture needs an image for each of {len(poses)} poses, one of them of a person; "
            f"got {len(images)} images"
        )
    steady = [seen[k] for k in np.linspace(0, len(seen) - 1, _COLUMNS).astype(int)]
    by_confidence = sorted(seen, key=lambda k: float(poses[k].confidence.mean()))
    shown = [*steady, *sorted(by_confidence[:_COLUMNS])]
    figure = Figure(figsize=(_WIDTH, 2 * _HEIGHT))
    for number, k in enumerate(shown):
        row, column = divmod(number, _COLUMNS)
        place = (column / _COLUMNS, 0.5 - row / 2, 1 / _COLUMNS, 0.43)
        axes = figure.add_axes(place)
        pose, confidence = poses[k], float(poses[k].confidence.mean())
        axes.imshow(images[k], cmap="gray_r")
        flat = tracking.camera.project(pose.joints)
        for joint, parent in enumerate(tracking.body.parents):
            if parent >= 0:
                axes.plot(*flat[[joint, parent]].T, color=style.BLUE, lw=1.2)
        whole = np.concatenate([flat, tracking.camera.project(pose.ends)])
        low, high = whole.min(axis=0) - _MARGIN_PX, whole.max(axis=0) + _MARGIN_PX
        axes.set_xlim(low[0], high[0])
        axes.set_ylim(high[1], low[1])
        axes.set_axis_off()
        text = f"image {k}, {pose.status}, {confidence:.2f}"
        figure.text(place[0] + 0.5 / _COLUMNS, place[1] + 0.45, text, ha="center", size=7)
    return figure
