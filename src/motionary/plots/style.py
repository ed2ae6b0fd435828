"""Colours, fonts and text measurement of pictures, and the writing of them.

Hues are those of Okabe and Ito (2008), which people with any of the common kinds of
colour blindness tell apart; where two of them stand side by side they also differ in
lightness, so that a print in grey still shows which is which. The width of text is measured,
not guessed: what does not fit is shortened before it is drawn.
"""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import cache, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from motionary.errors import InvalidInput
from motionary.files import write_atomically

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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

# The same picture gives the same bytes: no date, no version, no random names.
_METADATA: dict[str, dict[str, str | None]] = {
    "png": {"Software": None},
    "svg": {"Date": None, "Creator": "motionary"},
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}


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


def wrap(text: str, inches: float, *, most: int = 3) -> list[str]:
    """Lines of text that fit; words beyond the last line are left out."""
    lines = [""]
    for word in plain(text).split():
        longer = f"{lines[-1]} {word}".strip()
        if lines[-1] and text_width(longer) > inches:
            longer = word
            lines.append("")
        lines[-1] = longer
    kept = [*lines[: most - 1], " ".join(lines[most - 1 :])]
    return [fit(line, inches) for line in kept if line]


def _elide(line: str, keep: int) -> str:
    head = -(-keep // 2)
    return f"{line[:head].rstrip()}…{line[len(line) - (keep - head) :].lstrip()}"


def save_pages(figures: "Iterable[Figure]", path: str | Path) -> list[Path]:
    """Write pictures, the second as `name-2.png` and so on; their paths come back."""
    first, paths = Path(path), []
    for number, figure in enumerate(figures, start=1):
        paths.append(first if number == 1 else first.with_stem(f"{first.stem}-{number}"))
        save(figure, paths[-1])
    return paths


@house_style()
def save(figure: "Figure", path: str | Path) -> None:
    """Write a picture; the suffix of the name says how: png, svg or pdf.

    Parameters
    ----------
    figure : from any function of this package
    path : file to write; is replaced only once the new one is complete

    Raises
    ------
    InvalidInput
        If the suffix is another one.
    UnwritableFile
        If the file cannot be written.
    """
    kind = Path(path).suffix.lower().lstrip(".")
    if kind not in _METADATA:
        raise InvalidInput(
            "pictures are written as .png, .svg or .pdf, got "
            f"{Path(path).suffix!r}; give the file one of these suffixes",
            file=Path(path).name,
        )
    from matplotlib import rc_context

    with write_atomically(path) as beside, rc_context({"svg.hashsalt": "motionary"}):
        figure.savefig(beside, format=kind, metadata=_METADATA[kind])
