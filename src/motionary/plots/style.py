"""How do pictures look?

Hues are those of Okabe and Ito (2008), which people with any of the common kinds of
colour blindness tell apart; where two of them stand side by side they also differ in
lightness, so that a print in grey still shows which is which.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

BLACK = "#000000"
ORANGE = "#E69F00"
YELLOW = "#F0E442"
BLUE = "#0072B2"
VERMILLION = "#D55E00"

WHITE = "#FFFFFF"
RULE = "#999999"
PALE = "#F3F3F3"
#: Sky blue, thinned out.
PALE_BLUE = "#C4E4F8"
FAINT = "#D0D0D0"
TRUNK = "#333333"

#: Relations and stretches that were not seen.
UNKNOWN = "#C9D5E0"
UNKNOWN_HATCH = "#5F7D99"
HATCH = "//////"

#: Cells of a template that match anything.
FREE = "#C4C4C4"

#: Between "in no example" (black) and "in all" (white): lightness rises all the way.
BETWEEN = ("#6E1A00", VERMILLION, ORANGE, YELLOW)

#: From a distance of nothing to the dearest one shown; what is dearer is white.
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
