"""How a track fits what was measured: depth images with poses, limbs beside their sensors.

Of depth images the least sure poses are among those shown. After the thesis, figures 7.7 and
7.12, sensors have a row each, the angle between limb and sensor; bars where it is wrong,
hatched where one of both is not known.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.plots import page, style
from motionary.recording import find_runs

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from motionary.depth import Tracking
    from motionary.inertial import TrackingCheck

Floats = NDArray[np.float64]

_WIDTH = 7.5
_COLUMNS, _HEIGHT = 4, 2.4
_MARGIN_PX = 12
_ROW = 0.42
# Angles beyond are drawn at the edge.
_MOST_DEG = 45.0
_POINTS = 1500


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


@style.house_style()
def plot_check(
    check: "TrackingCheck", *, limits_deg: tuple[float, float] = (12.0, 25.0)
) -> "Figure":
    """Picture of the angles between limbs and sensors, and of what is wrong.

    Parameters
    ----------
    check : a motion held against its sensors
    limits_deg : drawn as lines: above the first a stretch goes on, above the second it is one
    """
    if not check.limbs:
        raise InvalidInput("there is no sensor to draw")
    recording = check.track.recording
    names = [f"{one.limb or 'no limb'} ({one.sensor})" for one in check.limbs]
    layout = page.Layout(
        left=max(style.text_width(name) for name in names) + 0.55,
        width=_WIDTH,
        heights=(_ROW,) * len(names),
        right=0.1,
    )
    figure, columns = page.new_page(layout, title=recording.name)
    rows = [axes for column in columns for axes in column]
    for axes, one, name in zip(rows, check.limbs, names, strict=True):
        residual = np.minimum(one.residual_deg, _MOST_DEG)
        times = np.arange(len(residual)) / recording.rate_hz
        step = max(len(residual) // _POINTS, 1)
        # The largest of each block: a peak of one frame stays to be seen.
        highest = np.maximum.reduceat(np.nan_to_num(residual), np.arange(0, len(residual), step))
        axes.fill_between(times[::step], highest, color=style.BLUE, lw=0)
        for limit in limits_deg:
            axes.axhline(limit, color=style.BLACK, lw=0.5, alpha=0.5)
        for first, stop in one.wrong:
            ends = first / recording.rate_hz, stop / recording.rate_hz
            axes.axvspan(*ends, color=style.PALE_ORANGE, linewidth=0.5, zorder=0.5)
        unknown = find_runs(np.isnan(residual))
        page.hatch(axes, [(a / recording.rate_hz, b / recording.rate_hz) for a, b in unknown])
        axes.set_ylim(0, _MOST_DEG)
        axes.set_yticks([0, 30], ["0°", "30°"])
        axes.set_ylabel(name, rotation=0, ha="right", va="center", labelpad=6)
    page.mark_seconds(rows, recording.duration_s)
    page.add_legend(
        figure,
        [
            page.swatch("angle between limb and sensor", style.BLUE),
            page.swatch("wrong", style.PALE_ORANGE),
            page.unknown_swatch("not known"),
        ],
    )
    return figure
