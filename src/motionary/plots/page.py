"""Layout of a page: axes, text, legends, time axes, and segments along them.

Pages are laid out in inches, and the room for text is measured: rows keep their height,
nothing is cut off, and the same input gives the same page.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from motionary.plots import style

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MARGIN = 0.12
_TITLE_HEIGHT = 0.24
_LEGEND_HEIGHT = 0.26
_STACK_GAP = 0.25
_TICKS_S = (
    0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1200, 1800, 3600,
    7200, 18000, 36000,
)  # fmt: skip
_TICK_SPACING = 0.55
#: Blocks shorter than this fraction of the axis have no room for a line between them.
_TOO_SHORT = 0.006


@dataclass(frozen=True, slots=True)
class Layout:
    """Measures of a page, in inches.

    Attributes
    ----------
    left, right : room for text beside the axes
    width : of the axes
    heights : of the axes, from top to bottom
    gap : between axes that stand one below the other
    above, below : room for text above the topmost and below the lowest axes
    n_stacks : stacks of axes side by side
    """

    left: float
    width: float
    heights: tuple[float, ...]
    right: float = 0.0
    gap: float = 0.1
    above: float = 0.0
    below: float = 0.36
    n_stacks: int = 1

    @property
    def page_width(self) -> float:
        """Width of the whole page."""
        return self.left + self.n_stacks * self.pitch - _STACK_GAP + self.right + 2 * _MARGIN

    @property
    def pitch(self) -> float:
        """Distance from one stack to the next."""
        return self.width + _STACK_GAP


def new_page(layout: Layout, *, title: str) -> "tuple[Figure, list[list[Axes]]]":
    """Page with a title, a line for the legend, stacks of axes and seconds below.

    Returns
    -------
    figure, and per stack its axes from top to bottom
    """
    from matplotlib.figure import Figure

    head = _MARGIN + _TITLE_HEIGHT + _LEGEND_HEIGHT + layout.above
    gaps = layout.gap * (len(layout.heights) - 1)
    height = head + sum(layout.heights) + gaps + layout.below + _MARGIN
    figure = Figure(figsize=(layout.page_width, height), dpi=style.DPI)
    tops = height - head - np.cumsum([0.0] + [tall + layout.gap for tall in layout.heights[:-1]])
    lefts = _MARGIN + layout.left + layout.pitch * np.arange(layout.n_stacks)
    stacks = [
        [
            add_axes(figure, left, top - tall, layout.width, tall)
            for top, tall in zip(tops.tolist(), layout.heights, strict=True)
        ]
        for left in lefts.tolist()
    ]
    text = style.fit(title, layout.page_width - 2 * _MARGIN, size=style.TITLE_PT, bold=True)
    place(figure, text, _MARGIN, height - _MARGIN, size=style.TITLE_PT, bold=True, va="top")
    return figure, stacks


def add_axes(figure: "Figure", left: float, bottom: float, width: float, height: float) -> "Axes":
    """Axes at a place in inches from the lower left corner."""
    across, up = figure.get_size_inches()
    return figure.add_axes((left / across, bottom / up, width / across, height / up))


def place(
    figure: "Figure",
    text: str,
    left: float,
    bottom: float,
    *,
    size: float = style.TEXT_PT,
    bold: bool = False,
    va: str = "baseline",
) -> None:
    """Text at a place in inches from the lower left corner."""
    across, up = figure.get_size_inches()
    weight = "bold" if bold else "normal"
    figure.text(left / across, bottom / up, text, size=size, weight=weight, va=va)


def add_legend(figure: "Figure", handles: "Sequence[Artist]") -> None:
    """Legend in its line below the title."""
    across, up = figure.get_size_inches()
    top = up - _MARGIN - _TITLE_HEIGHT
    figure.legend(
        handles=list(handles), ncols=max(len(handles), 1), loc="upper left", frameon=False,
        bbox_to_anchor=(_MARGIN / across, (top + 0.02) / up), borderpad=0, borderaxespad=0,
        handlelength=1.6, handletextpad=0.5, columnspacing=1.6,
    )  # fmt: skip


def swatch(label: str, colour: str) -> "Artist":
    """Entry of a legend: a filled box."""
    from matplotlib.patches import Patch

    return Patch(facecolor=colour, edgecolor=style.RULE, linewidth=0.6, label=label)


def unknown_swatch(label: str) -> "Artist":
    """Entry of a legend for what was not seen: a hatched box."""
    from matplotlib.patches import Patch

    return Patch(**style.UNKNOWN_PATCH, label=label)


def add_ramp(figure: "Figure", colours: NDArray[np.float64], ends: tuple[str, str]) -> None:
    """Scale of colours at the right end of the legend's line.

    Parameters
    ----------
    colours : array, shape (1, n, 3), from low to high
    ends : what they mean
    """
    across, up = figure.get_size_inches()
    bottom = up - _MARGIN - _TITLE_HEIGHT - 0.09
    right = across - _MARGIN - style.text_width(ends[1]) - 0.06
    axes = add_axes(figure, right - 1.1, bottom, 1.1, 0.12)
    axes.imshow(colours, aspect="auto", interpolation="nearest")
    axes.set(xticks=[], yticks=[])
    left = right - 1.1 - 0.06 - style.text_width(ends[0])
    place(figure, ends[0], left, bottom + 0.01)
    place(figure, ends[1], right + 0.06, bottom + 0.01)


def mark_seconds(axes: "Sequence[Axes]", stop_s: float, *, start_s: float = 0.0) -> None:
    """One time axis for stacked axes, its numbers below the last."""
    width = axes[-1].get_position().width * axes[-1].get_figure(root=True).get_figwidth()  # type: ignore[union-attr]
    fits = max(width / _TICK_SPACING, 1.0)
    length_s = stop_s - start_s
    step = next((t for t in _TICKS_S if length_s / t <= fits), length_s)
    first, last = math.ceil(start_s / step - 1e-9), int(stop_s / step + 1e-9)
    ticks = [i * step for i in range(first, last + 1)]
    for ax in axes:
        ax.set_xlim(start_s, stop_s)
        ax.set_xticks(ticks, labels=[])
        ax.tick_params(axis="x", color=style.RULE, length=2.5, width=0.6)
    axes[-1].set_xticks(ticks, labels=[f"{tick:g}" for tick in ticks])
    axes[-1].set_xlabel("seconds", labelpad=2.0)


def in_seconds(duration_s: float) -> str:
    """A duration as text: two decimals below ten seconds, one above."""
    return f"{duration_s:.2f} s" if duration_s < 10 else f"{duration_s:.1f} s"


class Timed(Protocol):
    """Whatever has a start and an end: a `Label`, a `Hit` or a `Segment`."""

    @property
    def start_s(self) -> float:
        """Where it begins, seconds."""

    @property
    def end_s(self) -> float:
        """Where it ends, seconds, half-open."""


def draw_blocks(
    axes: "Axes", segments: Iterable[Timed], *, low: float, height: float, colour: str,
    stop_s: float,
) -> None:  # fmt: skip
    """Blocks, with a line where one follows the other without a gap.

    Parameters
    ----------
    low, height : of the blocks, in units of the axes
    stop_s : length of the time axis, seconds
    """
    spans = sorted((x.start_s, x.end_s) for x in segments)
    # The edge keeps short blocks of long recordings visible.
    axes.broken_barh(
        [(start, stop - start) for start, stop in spans], (low, height), color=colour,
        linewidth=0.6,
    )  # fmt: skip
    least = _TOO_SHORT * stop_s
    for (first, end), (start, stop) in pairwise(spans):
        if start - end < least / 2 and min(start - first, stop - start) > least:
            axes.vlines(start, low, low + height, color=style.WHITE, linewidth=0.8)


def hatch(axes: "Axes", segments: Iterable[tuple[float, float]]) -> None:
    """Hatching over segments (start_s, end_s) that were not seen."""
    for start, stop in segments:
        axes.axvspan(start, stop, **style.UNKNOWN_PATCH, zorder=0.5)
