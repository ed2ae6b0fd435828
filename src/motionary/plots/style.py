"""The look of pictures: colours, fonts, text measurement, and the layout of pages.

Hues are those of Okabe and Ito (2008), which people with any of the common kinds of
colour blindness tell apart; where two of them stand side by side they also differ in
lightness, so that a print in grey still shows which is which.

Pages are laid out in inches, and the width of text is measured, not guessed: rows keep their
height, what does not fit is shortened before it is drawn, and the same input gives the same page.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

BLACK = "#000000"
ORANGE = "#E69F00"
YELLOW = "#F0E442"
BLUE = "#0072B2"
VERMILLION = "#D55E00"
GREEN = "#009E73"

WHITE = "#FFFFFF"

#: What colours stand for in pictures over time.
LABEL, TRUTH, THRESHOLD = VERMILLION, BLACK, VERMILLION

RULE = "#999999"
PALE = "#F3F3F3"
#: Sky blue and vermillion, thinned out.
PALE_BLUE = "#C4E4F8"
PALE_ORANGE = "#F4CDB0"
FAINT = "#D0D0D0"
TRUNK = "#333333"

#: Features and segments that were not seen.
UNKNOWN = "#C9D5E0"
UNKNOWN_PATCH: dict[str, Any] = {
    "facecolor": UNKNOWN, "edgecolor": "#5F7D99", "hatch": "//////", "linewidth": 0,
}  # fmt: skip

#: Cells of a template that match anything.
FREE = "#C4C4C4"

#: Between "in no example" (black) and "in all" (white): lightness rises all the way.
BETWEEN = ("#6E1A00", VERMILLION, ORANGE, YELLOW)

#: From a distance of nothing to the highest one shown; what is above is white.
NEAR_TO_FAR = ("#08306B", "#2171B5", "#6BAED6", "#C6DBEF")

LEFT_SIDE = BLUE
RIGHT_SIDE = ORANGE

TEXT_PT = 8.0
TITLE_PT = 10.0
DPI = 150

# It comes with matplotlib: the same picture on every machine.
_OWN_FONT = "DejaVu Sans"
#: Chinese, Japanese and Korean letters on the usual systems.
_FURTHER_FONTS = (
    "Noto Sans CJK JP", "Hiragino Sans", "Yu Gothic", "Microsoft YaHei", "PingFang SC",
    "Malgun Gothic",
)  # fmt: skip

_SETTINGS = {
    "axes.edgecolor": RULE,
    "axes.labelsize": TEXT_PT,
    "axes.linewidth": 0.6,
    "axes.titlesize": TEXT_PT,
    "figure.dpi": DPI,
    "font.size": TEXT_PT,
    "hatch.linewidth": 0.5,
    "legend.fontsize": TEXT_PT,
    "savefig.dpi": "figure",
    # A `$` or `_` in the name of a recording is no mathematics.
    "text.parse_math": False,
    "xtick.labelsize": TEXT_PT,
    "ytick.labelsize": TEXT_PT,
}

_POINTS = 72.0
_MISSING = "□"
#: No text is narrower than this fraction of the font's size per letter.
_NARROWEST = 0.2
#: Text is set a little wider on screen than it is drawn.
_SETTING = 1.06
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


@cache
def font_families() -> tuple[str, ...]:
    """Fonts to write with, in the order in which they are asked for a letter."""
    from matplotlib.font_manager import fontManager

    there = set(fontManager.get_font_names())
    return (_OWN_FONT, *(font for font in _FURTHER_FONTS if font in there))


@contextmanager
def house_style() -> Iterator[None]:
    """Settings of matplotlib for our pictures, whatever the person's own are.

    Also a decorator: `@house_style()`.
    """
    from matplotlib import style

    with style.context(["default", _SETTINGS, {"font.family": list(font_families())}]):
        yield


@cache
def _writable() -> frozenset[int]:
    """Code points that one of the fonts has."""
    from matplotlib.font_manager import findfont, get_font

    fonts = [get_font(findfont(family)) for family in font_families()]
    return frozenset(code for font in fonts for code in font.get_charmap())


def text_width(text: str, *, size: float = TEXT_PT, bold: bool = False) -> float:
    """Width of a line of text, inches."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import text_to_path

    weight = "bold" if bold else "normal"
    font = FontProperties(family=list(font_families()), size=size, weight=weight)
    width, _, _ = text_to_path.get_text_width_height_descent(text, font, ismath=False)
    return float(width) * _SETTING / _POINTS


@lru_cache(maxsize=4096)
def fit(text: str, inches: float, *, size: float = TEXT_PT, bold: bool = False) -> str:
    """One line of printable text that fits, its middle left out if need be."""
    line = plain(text)
    if text_width(line, size=size, bold=bold) <= inches:
        return line
    most = int(inches * _POINTS / (size * _NARROWEST)) + 1
    short, long = 0, min(len(line), most)
    while long - short > 1:
        middle = (short + long) // 2
        if text_width(_elide(line, middle), size=size, bold=bold) <= inches:
            short = middle
        else:
            long = middle
    return _elide(line, short)


def plain(text: str) -> str:
    """One line of letters that can be written; others become boxes."""
    line = "".join(letter if letter.isprintable() else " " for letter in text).strip()
    return "".join(letter if ord(letter) in _writable() else _MISSING for letter in line)


def wrap(text: str, inches: float) -> list[str]:
    """At most three lines of text that fit; the middle of a longer last one is left out."""
    lines = [""]
    for word in plain(text).split():
        longer = f"{lines[-1]} {word}".strip()
        if lines[-1] and text_width(longer) > inches:
            longer = word
            lines.append("")
        lines[-1] = longer
    kept = [*lines[:2], " ".join(lines[2:])]
    return [fit(line, inches) for line in kept if line]


def _elide(line: str, keep: int) -> str:
    head = -(-keep // 2)
    return f"{line[:head].rstrip()}…{line[len(line) - (keep - head) :].lstrip()}"


# -- pages --------------------------------------------------------------------------------


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
    """Page with a title, a line for the legend, and per stack its axes from top to bottom."""
    from matplotlib.figure import Figure

    head = _MARGIN + _TITLE_HEIGHT + _LEGEND_HEIGHT + layout.above
    gaps = layout.gap * (len(layout.heights) - 1)
    height = head + sum(layout.heights) + gaps + layout.below + _MARGIN
    figure = Figure(figsize=(layout.page_width, height), dpi=DPI)
    tops = height - head - np.cumsum([0.0] + [tall + layout.gap for tall in layout.heights[:-1]])
    lefts = _MARGIN + layout.left + layout.pitch * np.arange(layout.n_stacks)
    stacks = [
        [
            add_axes(figure, left, top - tall, layout.width, tall)
            for top, tall in zip(tops.tolist(), layout.heights, strict=True)
        ]
        for left in lefts.tolist()
    ]
    text = fit(title, layout.page_width - 2 * _MARGIN, size=TITLE_PT, bold=True)
    place(figure, text, _MARGIN, height - _MARGIN, size=TITLE_PT, bold=True, va="top")
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
    size: float = TEXT_PT,
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


def swatch(label: str, colour: str | None = None) -> "Artist":
    """Entry of a legend: a filled box, without a colour the hatched one of what was not seen."""
    from matplotlib.patches import Patch

    if colour is None:
        return Patch(**UNKNOWN_PATCH, label=label)
    return Patch(facecolor=colour, edgecolor=RULE, linewidth=0.6, label=label)


def add_ramp(figure: "Figure", colours: Floats, ends: tuple[str, str]) -> None:
    """Scale of colours (1, n, 3), low to high, at the right end of the legend's line."""
    across, up = figure.get_size_inches()
    bottom = up - _MARGIN - _TITLE_HEIGHT - 0.09
    right = across - _MARGIN - text_width(ends[1]) - 0.06
    axes = add_axes(figure, right - 1.1, bottom, 1.1, 0.12)
    axes.imshow(colours, aspect="auto", interpolation="nearest")
    axes.set(xticks=[], yticks=[])
    left = right - 1.1 - 0.06 - text_width(ends[0])
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
        ax.tick_params(axis="x", color=RULE, length=2.5, width=0.6)
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
    """Blocks on a time axis up to `stop_s`; a line where one follows without a gap."""
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
    """Hatching over segments (start_s, end_s) that were not seen."""
    for start, stop in segments:
        axes.axvspan(start, stop, **UNKNOWN_PATCH, zorder=0.5)
