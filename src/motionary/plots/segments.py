"""How are stretches of time drawn?"""

from collections.abc import Iterable
from itertools import pairwise
from typing import TYPE_CHECKING, Protocol

from motionary.plots.style import HATCH, UNKNOWN, UNKNOWN_HATCH, WHITE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Blocks shorter than this share of the axis have no room for a line between them.
_TOO_SHORT = 0.006


class Stretch(Protocol):
    """A stretch of a recording: a `Label` or a `Hit`."""

    @property
    def start_s(self) -> float:
        """Where it begins, seconds."""

    @property
    def end_s(self) -> float:
        """Where it ends, seconds, half-open."""


def draw_blocks(
    axes: "Axes", segments: Iterable[Stretch], *, low: float, height: float, colour: str,
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
            axes.vlines(start, low, low + height, color=WHITE, linewidth=0.8)


def hatch(axes: "Axes", segments: Iterable[tuple[float, float]]) -> None:
    """Hatching over stretches (start_s, end_s) that were not seen."""
    for start, stop in segments:
        axes.axvspan(
            start, stop, facecolor=UNKNOWN, edgecolor=UNKNOWN_HATCH, hatch=HATCH, linewidth=0,
            zorder=0.5,
        )  # fmt: skip
