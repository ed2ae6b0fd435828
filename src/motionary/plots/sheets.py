"""Sheets of many poses: a query with its hits, and depth images with what was found in them.

Of a query and its hits a row of stick figures each at one scale, so that the eye can compare. Of
depth images the least sure poses are among those shown.
"""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motionary.errors import InvalidInput
from motionary.plots import style
from motionary.plots.figures import check_positions, draw_poses, legend_of_sides, poses, project
from motionary.plots.style import Floats

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from motionary.depth import Tracking

#: Title, positions and, perhaps, times of a row.
SheetRow = tuple[str, ArrayLike] | tuple[str, ArrayLike, ArrayLike]

_WIDTH = 8.0
_TITLE = 0.24
_TALLEST = 1.1
_GROUND = 0.08
#: Inches per metre where nothing was seen.
_ANY_SCALE = 0.6
#: From the side, a little turned to the viewer: both arms and legs show.
_TURN_DEG = 20.0
_BETWEEN = 0.1
_FULL = 0.9
_TIMES = 0.14
#: More rows make a picture that no program opens any more.
_MOST_HITS = 100
#: Hits of one of several pages.
HITS_A_PAGE = 12
#: A joint that flies off must not shrink all others: extents beyond so many medians are cut.
_OUTLIER = 1.6

# Depth images: so many a row, so wide and tall together, in inches.
_COLUMNS, _SIZE = 4, (7.5, 4.8)
_MARGIN_PX = 12


class _Strip(NamedTuple):
    """A row: its title, its positions, what is seen of them, and which frames are drawn.

    `strongest` is the drawn frame in which the pose changes most, -1 if it is not drawn. Extents
    are those of the drawn figures, shape (figures,), metres.
    """

    title: str
    positions: Floats
    views: Floats
    frames: list[int]
    widths: Floats
    heights: Floats
    times_s: Floats | None
    strongest: int


@style.house_style()
def plot_sheet(
    query: SheetRow | None,
    hits: Sequence[SheetRow],
    *,
    n_figures: int = 8,
) -> "Figure":
    """Picture of a query and its hits, each as a row of stick figures.

    Time runs from the first frame on the left to the last on the right, evenly but for the frame
    in which the pose changes most, which takes the place of its neighbour. Every row is
    turned so that the person is seen from the right side and a little from the front; all
    have one scale and stand on the lowest point of their segment. Of more than 100 hits
    the first 100 are drawn.

    Parameters
    ----------
    query, hits : title and positions of the 24 generic joints, shape (frames, 24, 3),
        metres, y up, NaN = not seen; and, where times are to stand under the figures, the time
        of each frame in seconds. Without a query the hits stand alone.
    n_figures : stick figures a row; rows of fewer frames show all they have

    Raises
    ------
    InvalidInput
        If positions have another shape, `n_figures` is below 1, or there is nothing to draw.
    """
    (figure,) = _draw_pages(query, hits, n_figures, most=_MOST_HITS, a_page=_MOST_HITS)
    return figure


@style.house_style()
def plot_sheets(
    query: SheetRow | None, hits: Sequence[SheetRow], *, n_figures: int = 8
) -> "list[Figure]":
    """Pictures of a query above twelve of its hits each, all at one scale; as `plot_sheet`."""
    return list(_draw_pages(query, hits, n_figures, most=len(hits), a_page=HITS_A_PAGE))


def _draw_pages(
    query: SheetRow | None, hits: Sequence[SheetRow], n_figures: int, *, most: int, a_page: int
) -> "Iterator[Figure]":
    if n_figures < 1:
        raise InvalidInput(f"n_figures must be 1 or more, got {n_figures}")
    queries = [] if query is None else [query]
    if not queries and not hits:
        raise InvalidInput("a sheet needs a query or hits, got neither")
    leads, others = ([_strip(row, n_figures) for row in rows] for rows in (queries, hits[:most]))
    note = f"and {len(hits) - most} more hits" if len(hits) > most else ""
    for at in range(0, max(len(others), 1), a_page):
        shown = others[at : at + a_page]
        title = _title(len(hits), with_query=bool(leads))
        if len(others) > a_page:
            title += f", {at + 1} to {at + len(shown)}"
        yield _draw_strips([*leads, *shown], [*leads, *others], title, note, n_queries=len(leads))


def _draw_strips(
    strips: Sequence[_Strip], every: Sequence[_Strip], title: str, note: str, *, n_queries: int
) -> "Figure":
    """A page of strips, at the scale at which the figures of all pages fit."""
    from matplotlib.lines import Line2D

    slot = _WIDTH / max(len(strip.frames) for strip in every)
    scale = _scale(every, slot)
    heights = [_row_height(strip, scale) for strip in strips]
    layout = style.Layout(
        left=0.0, width=_WIDTH, heights=(sum(heights) + (_TITLE if note else 0.0),), below=0.0
    )
    figure, ((axes,),) = style.new_page(layout, title=title)
    top = layout.heights[0]
    axes.set(xlim=(0.0, _WIDTH), ylim=(0.0, top), xticks=[], yticks=[])
    axes.axis("off")
    for row, (strip, height) in enumerate(zip(strips, heights, strict=True)):
        _draw_row(axes, strip, top, height, slot=slot, scale=scale, is_query=row < n_queries)
        top -= height
    axes.text(0.06, 0.08, note, color=style.TRUNK)
    legend: list[Artist] = [*legend_of_sides()]
    if any(strip.times_s is not None and strip.strongest >= 0 for strip in strips):
        legend.append(Line2D([], [], linestyle="", label="bold time: where the pose changes most"))
    style.add_legend(figure, legend)
    return figure


def _strip(row: SheetRow, n_figures: int) -> _Strip:
    title, positions, *times = row
    array = check_positions(positions, name=title)
    times_s = None if not times else np.asarray(times[0], dtype=np.float64)
    if times_s is not None and times_s.shape != (len(array),):
        raise InvalidInput(f"{title}: times need shape ({len(array)},), got {times_s.shape}")
    views = project(array, turn_deg=_TURN_DEG)
    floor = np.nanmin(views[..., 1]) if np.isfinite(views).any() else 0.0
    views[..., 1] -= floor
    frames, strongest = _choose_frames(array, n_figures)
    chosen = views[frames]
    # A figure in which nothing was seen has no extent.
    low = np.fmin.reduce(chosen, axis=1)
    high = np.fmax.reduce(chosen, axis=1)
    widths, heights = np.nan_to_num(high[:, 0] - low[:, 0]), np.nan_to_num(high[:, 1])
    centres = (low[:, 0] + high[:, 0]) / 2
    # Where one joint flies off, the others stay in their place.
    wild = widths > _OUTLIER * np.median(np.maximum(widths, heights))
    centres[wild] = np.nanmedian(chosen[wild, :, 0], axis=1)
    views[frames, :, 0] -= np.nan_to_num(centres)[:, np.newaxis]
    return _Strip(title, array, views, frames.tolist(), widths, heights, times_s, strongest)


def _choose_frames(positions: Floats, n_figures: int) -> tuple[NDArray[np.intp], int]:
    """Frames to draw, and that of them in which the pose changes most."""
    frames = np.unique(np.linspace(0, len(positions) - 1, n_figures).round().astype(np.intp))
    speeds = _speed_of_pose(positions)
    # A sudden change is smoothed to a plateau; its middle is meant.
    strongest = int(np.median(np.flatnonzero(speeds >= speeds.max() * (1 - 1e-9))))
    if len(frames) > 2 and strongest not in frames:
        # First and last stay: they say where the segment begins and ends.
        nearest = 1 + int(np.argmin(np.abs(frames[1:-1] - strongest)))
        frames[nearest] = strongest
    return frames, strongest if strongest in frames else -1


def _speed_of_pose(positions: Floats) -> Floats:
    """How fast the joints move about the root, metres a frame, smoothed; 0 where unseen."""
    around = positions - positions[:, :1]
    steps = np.linalg.norm(np.diff(around, axis=0, prepend=around[:1]), axis=2)
    known = ~np.isnan(steps)
    mean = np.nan_to_num(steps).sum(axis=1) / np.maximum(known.sum(axis=1), 1)
    width = max(len(positions) // 20 | 1, 1)
    return np.convolve(mean, np.full(width, 1 / width), mode="same")


def _scale(strips: Sequence[_Strip], slot: float) -> float:
    """Inches per metre at which the figures of all rows fit."""
    widths = np.concatenate([strip.widths for strip in strips])
    heights = np.concatenate([strip.heights for strip in strips])
    sizes = np.maximum(widths, heights)
    if not sizes.any():
        return _ANY_SCALE
    most = _OUTLIER * float(np.median(sizes[sizes > 0]))
    widest, tallest = min(widths.max(), most), min(heights.max(), most)
    fits_across = _FULL * slot / widest if widest else np.inf
    fits_up = _TALLEST / tallest if tallest else np.inf
    return float(min(fits_across, fits_up))


def _row_height(strip: _Strip, scale: float) -> float:
    tall = min(scale * float(strip.heights.max()), _TALLEST)
    times = 0.0 if strip.times_s is None else _TIMES
    return _TITLE + max(tall, 0.3) + _GROUND + _BETWEEN + times


def _draw_row(
    axes: "Axes", strip: _Strip, top: float, height: float, *, slot: float, scale: float,
    is_query: bool,
) -> None:  # fmt: skip
    from matplotlib.patches import Rectangle

    if is_query:
        axes.add_patch(
            Rectangle((0.0, top - height), _WIDTH, height, color=style.PALE, linewidth=0, zorder=0)
        )
    else:
        axes.axhline(top, color=style.FAINT, linewidth=0.5)
    title = style.fit(strip.title, _WIDTH - 0.12, bold=is_query)
    axes.text(0.06, top - 0.06, title, va="top", weight="bold" if is_query else "normal")
    floor = top - height + _GROUND + (0.0 if strip.times_s is None else _TIMES)
    axes.hlines(floor, 0.06, _WIDTH - 0.06, color=style.RULE, linewidth=0.6, zorder=0.5)
    if np.isnan(strip.views[strip.frames]).all():
        axes.text(0.06, floor + 0.1, "nothing was seen", color=style.TRUNK)
    n_slots = round(_WIDTH / slot)
    at = np.arange(len(strip.frames)) * (n_slots - 1) / max(len(strip.frames) - 1, 1)
    places = np.stack([(at + 0.5) * slot, np.full(len(at), floor)], axis=1)
    figures = poses(strip.positions, strip.views, strip.frames)
    draw_poses(axes, figures, places, scale=scale)
    if strip.times_s is None:
        return
    for frame, x in zip(strip.frames, places[:, 0].tolist(), strict=True):
        weight = "bold" if frame == strip.strongest else "normal"
        axes.text(
            x, floor - 0.04, f"{strip.times_s[frame]:.2f} s", ha="center", va="top",
            size=style.TEXT_PT, color=style.TRUNK, weight=weight,
        )  # fmt: skip


def _title(n_hits: int, *, with_query: bool) -> str:
    if n_hits == 0:
        return "query without hits"
    hits = "1 hit" if n_hits == 1 else f"{n_hits} hits"
    return f"query and {hits}" if with_query else hits


@style.house_style()
def plot_depth(images: Sequence[Floats], tracking: "Tracking") -> "Figure":
    """Picture of eight images with their poses: four through the recording, the least sure below.

    Parameters
    ----------
    images : depth (height, width) in metres, one for each pose
    tracking : what was found in them
    """
    from matplotlib.figure import Figure

    found = tracking.poses
    seen = [k for k, pose in enumerate(found) if pose.status != "none"]
    if len(images) != len(found) or not seen:
        raise InvalidInput(
            f"a picture needs an image for each of {len(found)} poses, one of them of a person; "
            f"got {len(images)} images"
        )
    steady = [seen[k] for k in np.linspace(0, len(seen) - 1, _COLUMNS).astype(int)]
    by_confidence = sorted(seen, key=lambda k: float(found[k].confidence.mean()))
    figure = Figure(figsize=_SIZE)
    for number, k in enumerate([*steady, *sorted(by_confidence[:_COLUMNS])]):
        row, column = divmod(number, _COLUMNS)
        left, bottom = column / _COLUMNS, 0.5 - row / 2
        axes = figure.add_axes((left, bottom, 1 / _COLUMNS, 0.43))
        pose = found[k]
        axes.imshow(images[k], cmap="gray_r")
        flat = tracking.camera.project(pose.joints)
        for joint, parent in enumerate(tracking.body.parents):
            if parent >= 0:
                axes.plot(*flat[[joint, parent]].T, color=style.BLUE, lw=1.2)
        whole = np.concatenate([flat, tracking.camera.project(pose.ends)])
        low, high = whole.min(axis=0) - _MARGIN_PX, whole.max(axis=0) + _MARGIN_PX
        axes.set(xlim=(low[0], high[0]), ylim=(high[1], low[1]))
        axes.set_axis_off()
        text = f"image {k}, {pose.status}, {float(pose.confidence.mean()):.2f}"
        figure.text(left + 0.5 / _COLUMNS, bottom + 0.45, text, ha="center", size=7)
    return figure
