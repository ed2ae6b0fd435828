"""Poses as stick figures: how they are drawn, one alone, and the first of recordings.

Seen from the person's right side, so that they face to the right: the view is turned about
the vertical until the mean hip line points at the viewer.

Conventions: positions of the 24 generic joints in metres, y up; NaN = not seen. What was
not seen is not drawn; only over joints that a file never has, bones are drawn to the next
joint that it has. Of recordings a wrong unit, axis or side shows at once, since heights are in
metres, the figure faces to the right and its left side is blue; beside it stands what was given
or detected. Points that are no known body are drawn as points.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motionary.errors import InvalidInput
from motionary.motion import GENERIC_JOINTS, Motion
from motionary.plots import style
from motionary.plots.style import Floats

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Bones of the generic joints: joint and the joint that it hangs on.
BONES: tuple[tuple[str, str], ...] = (
    ("lhip", "root"), ("lknee", "lhip"), ("lankle", "lknee"), ("ltoes", "lankle"),
    ("rhip", "root"), ("rknee", "rhip"), ("rankle", "rknee"), ("rtoes", "rankle"),
    ("belly", "root"), ("chest", "belly"), ("neck", "chest"), ("head", "neck"),
    ("headtop", "head"),
    ("lclavicle", "neck"), ("lshoulder", "lclavicle"), ("lelbow", "lshoulder"),
    ("lwrist", "lelbow"), ("lfingers", "lwrist"),
    ("rclavicle", "neck"), ("rshoulder", "rclavicle"), ("relbow", "rshoulder"),
    ("rwrist", "relbow"), ("rfingers", "rwrist"),
)  # fmt: skip

_INDEX = {name: i for i, name in enumerate(GENERIC_JOINTS)}
_PARENT = {_INDEX[joint]: _INDEX[parent] for joint, parent in BONES}
_SIDED = {name[1:] for name in GENERIC_JOINTS if f"r{name[1:]}" in _INDEX and name[0] == "l"}

_HEAD_RADIUS = 0.55
_HEAD_PER_THIGH = 0.13
_LIMB_PT = 1.8
#: Colours of the lines of a pose, in the order in which they are drawn.
SIDES = {"left": style.LEFT_SIDE, "trunk": style.TRUNK, "right": style.RIGHT_SIDE}

#: More recordings make no picture that one can look at.
MOST_RECORDINGS = 24

_HEIGHT = 1.75
_WIDTH_OF_POSE = 1.9
_TEXT = 2.9
_MOST_LINES = 7
_LINE = 0.16
_ACROSS = ("hip", "shoulder")
_AXES = {0: "+z", 90: "+x", 180: "-z", 270: "-x"}
_STRAIGHT = 10.0


class Pose(NamedTuple):
    """A pose as lines on a plane, each of shape (bones, 2 ends, 2), metres; far side first."""

    left: Floats
    trunk: Floats
    right: Floats
    head: Floats  # its centre, NaN if not seen
    head_radius: float


def check_positions(positions: ArrayLike, *, name: str) -> Floats:
    """Generic positions, shape (frames, 24, 3), with everything infinite made NaN."""
    array = np.array(positions, dtype=np.float64)
    if array.ndim != 3 or array.shape[1:] != (len(GENERIC_JOINTS), 3) or len(array) == 0:
        raise InvalidInput(
            f"{name}: stick figures need positions of shape (frames, {len(GENERIC_JOINTS)}, 3), "
            f"got {array.shape}; take them from Motion.generic_positions()"
        )
    array[~np.isfinite(array)] = np.nan
    return array


def project(positions: Floats, *, turn_deg: float = 0.0) -> Floats:
    """Positions of a segment seen from the side, shape (frames, 24, 2): forward and up, metres.

    All are seen from one direction; `turn_deg` is how far the figures are turned towards the
    viewer: 0 from the side, 90 from the front.
    """
    across_x, across_z = mean_hip_line(positions)
    turn = np.radians(turn_deg)
    # Forward is up x right; turned about up, towards the viewer.
    forward_x = np.cos(turn) * across_z - np.sin(turn) * across_x
    forward_z = -np.cos(turn) * across_x - np.sin(turn) * across_z
    forward = positions[..., 0] * forward_x + positions[..., 2] * forward_z
    return np.stack([forward, positions[..., 1]], axis=-1)


def mean_hip_line(positions: Floats) -> tuple[float, float]:
    """Horizontal direction (x, z) from the left to the right hip, or shoulder."""
    for left, right in (("lhip", "rhip"), ("lshoulder", "rshoulder")):
        lines = (positions[:, _INDEX[right]] - positions[:, _INDEX[left]])[:, [0, 2]]
        lines = lines[~np.isnan(lines).any(axis=1)]
        lengths = np.linalg.norm(lines, axis=1)
        if not (lengths > 0).any():
            continue
        mean = lines.mean(axis=0)
        # Over a full turn the mean says nothing; then the beginning decides.
        if np.linalg.norm(mean) < 0.3 * lengths.mean():
            mean = lines[int(np.argmax(lengths > 0))]
        x, z = (mean / np.linalg.norm(mean)).tolist()
        return x, z
    return -1.0, 0.0


def poses(positions: Floats, views: Floats, frames: Sequence[int]) -> list[Pose]:
    """Lines of some frames of one segment; views are its positions as of `project`."""
    sides: dict[str, list[tuple[int, int]]] = {"l": [], "": [], "r": []}
    for joint, parent in bones_over_missing(positions):
        sides[side_of(joint)].append((joint, parent))
    head_joints, radius = _head(positions)
    return [
        Pose(
            left=_lines(views[frame], sides["l"]),
            trunk=_lines(views[frame], sides[""]),
            right=_lines(views[frame], sides["r"]),
            head=views[frame, head_joints].mean(axis=0),
            head_radius=radius,
        )
        for frame in frames
    ]


def side_of(joint: int) -> str:
    """The side of a generic joint: "l", "r", or empty."""
    name = GENERIC_JOINTS[joint]
    return name[0] if name[1:] in _SIDED else ""


def bones_over_missing(positions: Floats) -> list[tuple[int, int]]:
    """Bones (joint, parent) of the joints that are ever seen."""
    seen: NDArray[np.bool_] = np.asarray(np.isfinite(positions).any(axis=(0, 2)))
    bones = []
    for joint in np.flatnonzero(seen).tolist():
        parent = _PARENT.get(joint)
        while parent is not None and not seen[parent]:
            parent = _PARENT.get(parent)
        if parent is not None:
            bones.append((joint, parent))
    return bones


def _lines(view: Floats, bones: Sequence[tuple[int, int]]) -> Floats:
    ends = view[np.array(bones, dtype=np.intp).reshape(-1, 2)]
    return np.asarray(ends[~np.isnan(ends).any(axis=(1, 2))])


def _head(positions: Floats) -> tuple[list[int], float]:
    """Joints in whose middle the head is drawn, and its radius in metres."""
    head, top = _INDEX["head"], _INDEX["headtop"]
    length = _median_length(positions, head, top)
    if length > 0:
        return [head, top], _HEAD_RADIUS * length
    # Many files end at the base of the head; its size then follows the thigh's.
    return [head], _HEAD_PER_THIGH * _median_length(positions, _INDEX["lhip"], _INDEX["lknee"])


def _median_length(positions: Floats, start: int, end: int) -> float:
    lengths = np.linalg.norm(positions[:, end] - positions[:, start], axis=1)
    lengths = lengths[~np.isnan(lengths)]
    return float(np.median(lengths)) if len(lengths) else 0.0


def draw_poses(
    axes: "Axes", stick_figures: Sequence[Pose], places: Floats, *, scale: float
) -> None:
    """Stick figures, so many units of the axes a metre; places are those of their (0, 0)."""
    from matplotlib.collections import LineCollection, PatchCollection
    from matplotlib.patches import Circle

    for part, colour in SIDES.items():
        lines = [scale * getattr(f, part) + p for f, p in zip(stick_figures, places, strict=True)]
        axes.add_collection(
            LineCollection(
                list(np.concatenate(lines)), colors=colour, linewidths=_LIMB_PT, capstyle="round"
            ),
            autolim=False,
        )
        if part == "trunk":
            heads = [
                Circle(tuple(scale * f.head + p), scale * f.head_radius)
                for f, p in zip(stick_figures, places, strict=True)
                if not np.isnan(f.head).any()
            ]
            axes.add_collection(PatchCollection(heads, color=style.TRUNK, zorder=2), autolim=False)


def legend_of_sides() -> "list[Artist]":
    """What the colours of the limbs mean."""
    from matplotlib.lines import Line2D

    return [
        Line2D([], [], color=style.LEFT_SIDE, linewidth=_LIMB_PT, label="left side"),
        Line2D([], [], color=style.RIGHT_SIDE, linewidth=_LIMB_PT, label="right side"),
    ]


@style.house_style()
def plot_pose(position: ArrayLike, *, title: str = "") -> "Figure":
    """Picture of one pose, from the right side and from the front.

    Parameters
    ----------
    position : array, shape (24, 3), generic joints, metres, y up, NaN = not seen

    Raises
    ------
    InvalidInput
        If the shape is another one.
    """
    positions = check_positions(np.asarray(position, dtype=np.float64)[np.newaxis], name="pose")
    layout = style.Layout(left=0.0, width=2.4, heights=(2.6,), n_stacks=2, above=0.2, below=0.0)
    figure, stacks = style.new_page(layout, title=title or "pose")
    for (axes,), heading, turn in zip(stacks, ("right side", "front"), (0.0, 90.0), strict=True):
        view = project(positions, turn_deg=turn)
        low, high = np.fmin.reduce(view[0]), np.fmax.reduce(view[0])
        size = max(np.nan_to_num(high - low).max(), 1e-9)
        view -= np.nan_to_num([(low[0] + high[0]) / 2, low[1]])
        draw_poses(axes, poses(positions, view, [0]), np.zeros((1, 2)), scale=1.0)
        axes.axhline(0.0, color=style.RULE, linewidth=0.6, zorder=0.5)
        axes.set(xlim=(-0.53 * size, 0.53 * size), ylim=(-0.05 * size, 1.1 * size))
        axes.set_aspect("equal")
        axes.set(xticks=[], yticks=[])
        axes.axis("off")
        unseen = np.isnan(view).all()
        axes.set_title(f"{heading}: nothing was seen" if unseen else heading, loc="left", pad=4.0)
    style.add_legend(figure, legend_of_sides())
    return figure


@style.house_style()
def plot_recordings(motions: Sequence[Motion]) -> "Figure":
    """Picture of the first pose of recordings, with what is known of their axes.

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
    layout = style.Layout(
        left=_TEXT, width=_WIDTH_OF_POSE, heights=(_HEIGHT,) * len(motions), gap=0.25, above=0.2,
        below=0.05, n_stacks=2,
    )  # fmt: skip
    figure, stacks = style.new_page(layout, title="the first pose, heights in metres")
    for left, right, motion in zip(*stacks, motions, strict=True):
        _draw_first(motion, left, right)
        right.tick_params(labelleft=False)
        _write(left, motion)
    for (first, *_), heading in zip(stacks, ("from its right side", "from the front"), strict=True):
        first.set_title(heading, loc="left", pad=4.0)
    style.add_legend(figure, legend_of_sides())
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


def _extent(flat: Floats) -> tuple[Floats, Floats]:
    """Lowest and highest place of a view, shape (2,) each; the floor is in it if it is near."""
    if np.isnan(flat).all():
        return np.zeros(2), np.ones(2)
    low, high = np.fmin.reduce(flat), np.fmax.reduce(flat)
    # The floor belongs to the picture, unless the body is far from it.
    if 0 < low[1] < max(float((high - low).max()), 1e-9):
        low[1] = 0.0
    return low, high


def _draw_first(motion: Motion, *sides: "Axes") -> None:
    """The first pose from its right side and from the front, on a scale in metres."""
    from matplotlib.ticker import MaxNLocator

    body = None if motion.mapping is None else _first_pose(motion)
    if body is None:
        views = [motion.positions[:1, :, plane] for plane in ([2, 1], [0, 1])]
    else:
        views = [project(body, turn_deg=turn) for turn in (0.0, 90.0)]
    extents = [_extent(view[0]) for view in views]
    # One scale for both, or a body that is narrow from the side looks tall.
    size = max(*(float(np.max(high - low)) for low, high in extents), 1e-9)
    ratio = _WIDTH_OF_POSE / _HEIGHT
    for axes, view, (low, high) in zip(sides, views, extents, strict=True):
        if body is None:
            axes.plot(*view[0].T, ".", color=style.TRUNK, markersize=3)
        else:
            draw_poses(axes, poses(body, view, [0]), np.zeros((1, 2)), scale=1.0)
        across = (low[0] + high[0]) / 2
        axes.set(
            xlim=(across - 0.575 * ratio * size, across + 0.575 * ratio * size),
            ylim=(low[1] - 0.05 * size, low[1] + 1.1 * size),
        )
        axes.set_aspect("equal")
        axes.axhline(0.0, color=style.RULE, linewidth=0.6, zorder=0.5)
        axes.set_xticks([])
        axes.yaxis.set_major_locator(MaxNLocator(nbins=4, steps=[1, 2, 5, 10]))
        axes.tick_params(axis="y", color=style.RULE, length=2.5, width=0.6)
        axes.spines[["top", "right", "bottom"]].set_visible(False)
        if np.isnan(view).all():
            axes.text(0.5, 0.5, "nothing was seen", transform=axes.transAxes, ha="center")


def _write(axes: "Axes", motion: Motion) -> None:
    """Name, axes, unit and side of a recording, to the left of its picture."""
    facing = describe_facing(motion)
    skeleton = f"skeleton {motion.mapping.name}" if motion.mapping else "no known skeleton"
    lines = [f"{skeleton}, {motion.rate_hz:g} Hz", *([facing] if facing else []), *motion.notes]
    wrapped = [part for line in [motion.source, *lines] for part in style.wrap(line, _TEXT - 0.55)]
    for number, line in enumerate(wrapped[:_MOST_LINES]):
        axes.annotate(
            line, (0.0, 1.0), xycoords="axes fraction", textcoords="offset points",
            xytext=(-72 * (_TEXT - 0.05), -72 * (_LINE * number + 0.1)), size=style.TEXT_PT,
            weight="bold" if number == 0 else "normal", annotation_clip=False,
        )  # fmt: skip
