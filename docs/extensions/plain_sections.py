"""Sections of docstrings in plain text.

The package writes `name : what it is`, goes on in further lines, and seldom names a type.
Napoleon would set the first line in italics as a type, and take what stands before a colon
in a property for one; here all of it is the description. A default that fills a page is
left out of the signature.
"""

import inspect
import re
from collections.abc import Callable, Iterator
from typing import Any

from sphinx.application import Sphinx

_UNDERLINE = re.compile(r"-{3,}")
_SECTIONS = ("Parameters", "Attributes")
_LONGEST_SIGNATURE = 600
_LONGEST_DEFAULT = 60
_ENTRY = re.compile(r"(?P<names>\*{0,2}\w[\w, ]*?) : (?P<text>.*)")


def _rewrite(lines: list[str]) -> Iterator[str]:
    number = 0
    while number < len(lines):
        if lines[number] in _SECTIONS and _is_underlined(lines, number):
            stop = _end_of_section(lines, number + 2)
            yield f":{lines[number]}:"
            yield from _entries(lines[number + 2 : stop])
            yield ""
            number = stop
        else:
            yield lines[number]
            number += 1


def _is_underlined(lines: list[str], number: int) -> bool:
    return number + 1 < len(lines) and _UNDERLINE.fullmatch(lines[number + 1]) is not None


def _end_of_section(lines: list[str], start: int) -> int:
    headings = (i for i in range(start, len(lines)) if lines[i] and _is_underlined(lines, i))
    return next(headings, len(lines))


def _entries(lines: list[str]) -> Iterator[str]:
    for number, line in enumerate(lines):
        entry = _ENTRY.fullmatch(line)
        if entry:
            names = entry["names"].replace("*", r"\*")
            yield f"    - **{names}** – {entry['text']}" + _stop_before(lines, number + 1)
        elif line.strip():
            yield f"      {line.strip()}"


def _stop_before(lines: list[str], number: int) -> str:
    """A full stop where a sentence follows that is no continuation."""
    following = lines[number].strip() if number < len(lines) else ""
    is_sentence = following[:1].isupper() and lines[number].startswith(" ")
    return "." if is_sentence and not lines[number - 1].endswith((".", ",", ";", ":")) else ""


def _process(
    app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]
) -> None:
    if what == "property" and lines:
        lines[0] = lines[0].replace(": ", " – ")
    lines[:] = _rewrite(lines)


class _Long:
    """A default that is too long to show."""

    def __repr__(self) -> str:
        return "…"


def _shorten(
    app: Sphinx,
    what: str,
    name: str,
    obj: Callable[..., Any],
    options: object,
    signature: str | None,
    returns: str | None,
) -> tuple[str, str | None] | None:
    if signature is None or len(signature) < _LONGEST_SIGNATURE:
        return None
    found = inspect.signature(obj)
    parameters = [
        p.replace(
            annotation=p.empty,
            default=_Long() if len(repr(p.default)) > _LONGEST_DEFAULT else p.default,
        )
        for p in found.parameters.values()
    ]
    return str(inspect.Signature(parameters)), returns


def setup(app: Sphinx) -> dict[str, bool]:
    """Rewrite docstrings before napoleon sees them, and signatures."""
    app.connect("autodoc-process-signature", _shorten)
    app.connect("autodoc-process-docstring", _process, priority=100)
    return {"parallel_read_safe": True}
