"""A record becomes a page: templates of `evidence/pages`, filled with the record alone.

A template sees the results by their keys and the names of its script. Numbers stand in no
template; `claim` holds a sentence to them.
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined

from evidence.common.recordings import BANDAI, CMU, HDM05
from motionary.errors import InvalidInput

#: What keys of records are called on pages.
CALLED = {
    "by surprise": "by self-information",
    "grown": "expanded",
    "one teacher": "one person",
    "told from each other": "from each other's clips",
    "told from other recordings too": "from other recordings too",
    "bred, 3 of 5 agree": "learned, 3 of 5 agree",
    "right ones alone": "relevant ones alone",
    "no dissenters": "no exceptions",
    "steadier": "more tolerance",
}


def render(record: Mapping[str, Any], script: ModuleType) -> str:
    """Page of a record: title, body, and how it was made."""
    results = record["results"]
    known = {key: value for key, value in results.items() if key.isidentifier()}
    pages = _environment()
    body = pages.get_template(f"{record['name']}.md").render(
        {**vars(script), **known, "results": results}
    )
    return pages.get_template("layout.md").render(record=record, body=body)


def fraction(value: float | None, digits: int = 2) -> str:
    """A number in [0, 1] without its leading zero, as the papers print it."""
    text = number(value, digits)
    return text[1:] if text.startswith("0.") else text


def fractions(
    values: Mapping[str, Any] | Iterable[float | None],
    keys: Sequence[str] = (),
    digits: int = 2,
    sep: str = " | ",
) -> str:
    """Several of them as cells of a table; of a mapping those of some keys."""
    chosen = [values[key] for key in keys] if isinstance(values, Mapping) else values
    return sep.join(fraction(value, digits) for value in chosen)


def number(value: float | None, digits: int = 1) -> str:
    """A number, or a dash for one that is not defined."""
    return "–" if value is None else f"{value:.{digits}f}"


def pair(first: float | None, second: float | None) -> str:
    """Two numbers, such as F1 and F2."""
    return f"{fraction(first)} / {fraction(second)}"


def claim(holds: bool) -> None:
    """What the next sentence says must be so by the numbers.

    Raises
    ------
    InvalidInput
        If it is not, with the line of the template in the traceback.
    """
    if not holds:
        raise InvalidInput("the record does not show any more what the page says of it")


def called(key: str) -> str:
    """Name on pages and pictures of what a record has under a key."""
    for old, new in CALLED.items():
        key = key.replace(old, new)
    return key


def picture(name: str, caption: str) -> str:
    """A picture and what it shows; `caption` is also read to those who do not see it."""
    return f"![{caption}](pictures/{name}.png)\n\n*{caption}*\n"


def means(rows: Iterable[Mapping[str, float]]) -> dict[str, float]:
    """Mean of each key over all rows."""
    table = list(rows)
    return {key: float(np.mean([row[key] for row in table])) for key in table[0]}


def stem(name: str) -> str:
    """Name of a recording without folder and suffix."""
    return Path(name).stem.removesuffix("_120")


@cache
def _environment() -> Environment:
    pages = Environment(
        loader=FileSystemLoader(Path(__file__).parents[1] / "pages"),
        extensions=["jinja2.ext.do"],
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    pages.globals.update(
        claim=claim, picture=picture, pair=pair, zip=zip, max=max, min=min,
        HDM05=HDM05, CMU=CMU, BANDAI=BANDAI,
    )  # fmt: skip
    pages.filters.update(
        called=called, fraction=fraction, fractions=fractions, number=number, means=means,
        mean=lambda values: float(np.mean(list(values))),
        median=lambda values: float(np.median(list(values))),
        general=lambda value: f"{value:g}",
        limits=lambda span: f"[{fraction(span['low'])}, {fraction(span['high'])}]",
        f_pair=lambda scores: pair(scores["F1"], scores["F2"]),
        of=lambda row, key: row[key],
        counts=lambda names: list(Counter(names).items()),
        stem=stem, short=lambda name: stem(name).removeprefix("HDM_"),
    )  # fmt: skip
    return pages
