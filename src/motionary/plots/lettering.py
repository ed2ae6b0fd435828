"""Which letters can be written, and how much room do they take?

Room is measured, not guessed: what does not fit is shortened before it is written.
"""

from functools import cache, lru_cache

from motionary.plots.style import TEXT_PT, font_families

_POINTS = 72.0
_MISSING = "□"

#: No run of letters is narrower than this share of the font's size per letter.
_NARROWEST = 0.2
#: Letters are set a little wider on screen than they are drawn.
_SETTING = 1.06


@cache
def _writable() -> frozenset[int]:
    """Codes of the letters that one of the fonts has."""
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
