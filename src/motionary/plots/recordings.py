"""How does the first pose of each recording stand in its axes?

A wrong unit, axis or side shows at once: heights are in metres, the figure faces to the right,
its left side is blue. Beside it stands what was told or found. Points that are no known body
are drawn as points.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.motion import GENERIC_JOINTS, NO_FEATURES, Motion
from motionary.plots.figures import draw_poses, legend_of_sides, mean_hip_line, poses, project
from motionary.plots.lettering import wrap
from motionary.plots.page import Layout, add_legend, new_page
from motionary.plots.style import RULE, TEXT_PT, TRUNK, house_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.ticker import MaxNLocator

Floats = NDArray[np.float64]

#: More recordings make no picture that one can look at.
MOST_RECORDINGS = 24

_HEIGHT = 1.75
_WORDS = 2.9
_MOST_LINES = 7
_LINE = 0.16
_ACROSS = ("hip", "shoulder")
_AXES = {0: "+z", 90: "+x", 180: "-z", 270: "-x"}
_STRAIGHT = 10.0


@house_style()
def plot_recordings(motions: Sequence[Motion]) -> "Figure":
    """Picture of the first pose of recordings, with what was told of their axes.

    Parameters
    ----------
    motions : metres, y up; at most `MOST_RECORDINGS`

    Raises
    ------
    InvalidInput
        If there are none or too many.
    """
    if not 1 <= len(motions) <= MOST_RECORDINGS:
        raise InvalidInput(f"a picture takes 1 to {MOST_RECORDINGS} recordings, got {len(motions)}")
    layout = Layout(
        left=_WORDS,
        width=1.9,
        heights=(_HEIGHT,) * len(motions),
        gap=0.25,
        above=0.2,
        below=0.05,
        n_stacks=2,
    )
    figure, stacks = new_page(layout, title="the first pose, heights in metres")
    for row, motion in enumerate(motions):
        for column, view in enumerate(_views(motion)):
            _draw(stacks[column][row], motion, view)
            stacks[column][row].tick_params(labelleft=column == 0)
        _write(stacks[0][row], motion)
    for column, packed in enumerate(("from its right side", "from the front")):
        stacks[column][0].set_title(packed, loc="left", pad=4.0)
    add_legend(figure, legend_of_sides())
    return figure


def describe_facing(motion: Motion) -> str:
    """Where a body faces in its first pose: "faces +z", or how far from it; "" if unseen."""
    if motion.mapping is None:
        return ""
    body = _first_pose(motion)
    if not any(np.isfinite(body[0, GENERIC_JOINTS.index(f"l{j}")]).all() for j in _ACROSS):
        return ""
    # Forward is up x right.
    right_x, right_z = mean_hip_line(body)
    angle = float(np.degrees(np.arctan2(right_z, -right_x)))
    nearest = int(90 * np.round(angle / 90))
    off = angle - nearest
    if abs(off) < _STRAIGHT:
        return f"faces {_AXES[nearest % 360]}"
    other = _AXES[(nearest + (90 if off > 0 else -90)) % 360]
    return f"faces {abs(off):.0f}° from {_AXES[nearest % 360]} to {other}"


def _first_pose(motion: Motion) -> Floats:
    """The first frame in which anything is seen, generic joints, shape (1, 24, 3)."""
    body = motion.cut(0, min(motion.n_frames, 1000)).generic_positions()
    seen = ~np.isnan(body).all(axis=(1, 2))
    first = int(np.argmax(seen))
    return body[first : first + 1]


def _views(motion: Motion) -> list[Floats]:
    if motion.mapping is not None:
        body = _first_pose(motion)
        return [project(body), project(body, turn_deg=90)]
    points = motion.positions[:1]
    return [points[..., [2, 1]], points[..., [0, 1]]]


def _draw(axes: "Axes", motion: Motion, view: Floats) -> None:
    flat = view[0]
    low, high = np.fmin.reduce(flat), np.fmax.reduce(flat)
    unseen = bool(np.isnan(flat).all())
    low, high = (np.zeros(2), np.ones(2)) if unseen else (low, high)
    size = max(float((high - low).max()), 1e-9)
    # The floor belongs to the picture, unless the body is far from it.
    if 0 < low[1] < size:
        low[1] = 0.0
        size = max(size, float(high[1]))
    across = (low[0] + high[0]) / 2
    if motion.mapping is None:
        axes.plot(*flat.T, ".", color=TRUNK, markersize=3)
    else:
        draw_poses(axes, poses(_first_pose(motion), view, [0]), np.zeros((1, 2)), scale=1.0)
    ratio = 1.9 / _HEIGHT
    axes.set(
        xlim=(across - 0.575 * ratio * size, across + 0.575 * ratio * size),
        ylim=(low[1] - 0.05 * size, low[1] + 1.1 * size),
    )
    axes.set_aspect("equal")
    axes.axhline(0.0, color=RULE, linewidth=0.6, zorder=0.5)
    axes.set_xticks([])
    axes.yaxis.set_major_locator(_ticks())
    axes.tick_params(axis="y", color=RULE, length=2.5, width=0.6)
    for side in ("top", "right", "bottom"):
        axes.spines[side].set_visible(False)
    if unseen:
        axes.text(0.5, 0.5, "nothing was seen", transform=axes.transAxes, ha="center")


def _ticks() -> "MaxNLocator":
    from matplotlib.ticker import MaxNLocator

    return MaxNLocator(nbins=4, steps=[1, 2, 5, 10])


def _write(axes: "Axes", motion: Motion) -> None:
    """Name, axes, unit and side of a recording, to the left of its picture."""
    lines = [note for note in motion.notes if _is_of_axes(note)]
    facing = describe_facing(motion)
    skeleton = f"skeleton {motion.mapping.name}" if motion.mapping else "no known skeleton"
    lines = [f"{skeleton}, {motion.rate_hz:g} Hz", *([facing] if facing else []), *lines]
    wrapped = [part for line in [motion.source, *lines] for part in wrap(line, _WORDS - 0.55)]
    for number, line in enumerate(wrapped[:_MOST_LINES]):
        axes.annotate(
            line,
            (0.0, 1.0),
            xycoords="axes fraction",
            xytext=(-72 * (_WORDS - 0.05), -72 * (_LINE * number + 0.1)),
            textcoords="offset points",
            size=TEXT_PT,
            weight="bold" if number == 0 else "normal",
            annotation_clip=False,
        )


def _is_of_axes(note: str) -> bool:
    starts = ("unit ", "axes and unit", "left and right", "kept in place", NO_FEATURES)
    return note.startswith(starts) or " up, " in note
