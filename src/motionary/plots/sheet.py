"""What do the hits of a search look like?

A row of stick figures for the query and one for each hit, at one scale, so that the eye
can compare.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motionary.errors import InvalidInput
from motionary.plots.figures import (
    check_positions,
    draw_poses,
    legend_of_sides,
    poses,
    project,
)
from motionary.plots.lettering import fit
from motionary.plots.page import Layout, add_legend, new_page
from motionary.plots.style import FAINT, PALE, RULE, TRUNK, house_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]

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
#: More rows make a picture that no program opens any more.
_MOST_HITS = 100
#: A joint that flies off must not shrink all others: extents beyond so many medians are cut.
_OUTLIER = 1.6


class _Strip(NamedTuple):
    """A row: its title, its positions, what is seen of them, and which frames are drawn.

    Extents are those of the drawn figures, shape (figures,), metres.
    """

    title: str
    positions: Floats
    views: Floats
    frames: list[int]
    widths: Floats
    heights: Floats


@house_style()
def plot_sheet(
    query: tuple[str, ArrayLike] | None,
    hits: Sequence[tuple[str, ArrayLike]],
    *,
    n_figures: int = 8,
) -> "Figure":
    """Picture of a query and its hits, each as a row of stick figures.

    Time runs from the first frame on the left to the last on the right. Every row is
    turned so that the person is seen from the right side and a little from the front; all
    have one scale and stand on the lowest point of their stretch. Of more than 100 hits
    the first 100 are drawn.

    Parameters
    ----------
    query, hits : title and positions of the 24 generic joints, shape (frames, 24, 3),
        metres, y up, NaN = not seen; without a query the hits stand alone
    n_figures : stick figures a row; rows of fewer frames show all they have

    Raises
    ------
    InvalidInput
        If positions have another shape, `n_figures` is below 1, or there is nothing to draw.
    """
    if n_figures < 1:
        raise InvalidInput(f"n_figures must be 1 or more, got {n_figures}")
    shown = [*([] if query is None else [query]), *hits[:_MOST_HITS]]
    if not shown:
        raise InvalidInput("a sheet needs a query or hits, got neither")
    strips = [_strip(title, positions, n_figures) for title, positions in shown]
    slot = _WIDTH / max(len(strip.frames) for strip in strips)
    scale = _scale(strips, slot)
    heights = [_row_height(strip, scale) for strip in strips]
    note = _note(len(hits))
    layout = Layout(
        left=0.0, width=_WIDTH, heights=(sum(heights) + (_TITLE if note else 0.0),), below=0.0
    )
    figure, ((axes,),) = new_page(layout, title=_title(len(hits), with_query=query is not None))
    top = layout.heights[0]
    axes.set(xlim=(0.0, _WIDTH), ylim=(0.0, top), xticks=[], yticks=[])
    axes.axis("off")
    for row, (strip, height) in enumerate(zip(strips, heights, strict=True)):
        _draw_row(
            axes,
            strip,
            top,
            height,
            slot=slot,
            scale=scale,
            is_query=query is not None and row == 0,
        )
        top -= height
    axes.text(0.06, 0.08, note, color=TRUNK)
    add_legend(figure, legend_of_sides())
    return figure


def _strip(title: str, positions: ArrayLike, n_figures: int) -> _Strip:
    array = check_positions(positions, name=title)
    views = project(array, turn_deg=_TURN_DEG)
    floor = np.nanmin(views[..., 1]) if np.isfinite(views).any() else 0.0
    views[..., 1] -= floor
    frames = np.unique(np.linspace(0, len(array) - 1, n_figures).round().astype(np.intp))
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
    return _Strip(title, array, views, frames.tolist(), widths, heights)


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
    return _TITLE + max(tall, 0.3) + _GROUND + _BETWEEN


def _draw_row(
    axes: "Axes", strip: _Strip, top: float, height: float, *, slot: float, scale: float,
    is_query: bool,
) -> None:  # fmt: skip
    from matplotlib.patches import Rectangle

    if is_query:
        axes.add_patch(
            Rectangle((0.0, top - height), _WIDTH, height, color=PALE, linewidth=0, zorder=0)
        )
    else:
        axes.axhline(top, color=FAINT, linewidth=0.5)
    packed = fit(strip.title, _WIDTH - 0.12, bold=is_query)
    axes.text(0.06, top - 0.06, packed, va="top", weight="bold" if is_query else "normal")
    floor = top - height + _GROUND
    axes.hlines(floor, 0.06, _WIDTH - 0.06, color=RULE, linewidth=0.6, zorder=0.5)
    if np.isnan(strip.views[strip.frames]).all():
        axes.text(0.06, floor + 0.1, "nothing was seen", color=TRUNK)
    n_slots = round(_WIDTH / slot)
    at = np.arange(len(strip.frames)) * (n_slots - 1) / max(len(strip.frames) - 1, 1)
    places = np.stack([(at + 0.5) * slot, np.full(len(at), floor)], axis=1)
    figures = poses(strip.positions, strip.views, strip.frames)
    draw_poses(axes, figures, places, scale=scale)


def _title(n_hits: int, *, with_query: bool) -> str:
    if n_hits == 0:
        return "query without hits"
    packed = "1 hit" if n_hits == 1 else f"{n_hits} hits"
    return f"query and {packed}" if with_query else packed


def _note(n_hits: int) -> str:
    return f"and {n_hits - _MOST_HITS} more hits" if n_hits > _MOST_HITS else ""
