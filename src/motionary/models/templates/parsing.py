"""Parsing of the text of a template: which cells it fixes.

The language is that of `motionary.models.templates.text`, read a line at a time; what is
refused is refused by the number of the line. Matching takes from half to double of a segment
(steps (1, 1), (1, 2), (2, 1)), so that a range of lengths is one length whose half and double
cover it.

Conventions: states of cells are 1, 0 and -1 for free, shape (columns, features); columns at
30 Hz; segments are half-open.
"""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.features import FeatureSet, find_feature
from motionary.models.templates.template import RATE_HZ

States = NDArray[np.int8]

FREE = -1
ANYTHING = "anything"
#: Longer templates are slips of the pen: ten minutes.
MOST_S = 600.0

_NUMBER = r"(\d+\.?\d*|\.\d+)"
_UNIT = r"\s*s(?:ec|econds?)?"
_FOR = re.compile(rf"for {_NUMBER}{_UNIT}")
_FOR_RANGE = re.compile(rf"for {_NUMBER}(?:{_UNIT})? to {_NUMBER}{_UNIT}")
_FROM = re.compile(rf"from {_NUMBER}(?:{_UNIT})? to {_NUMBER}{_UNIT}")
_LASTS = re.compile(rf"lasts {_NUMBER}{_UNIT}")
_FORMS = (
    "'for 1.5 s: right hand fast, not body low', 'from 0.2 to 0.5 s: ...', 'throughout: ...' or "
    "'lasts 1.5 s'"
)


class _Piece(NamedTuple):
    """Text of one line, without comment and needless spaces."""

    line: int
    text: str


@dataclass(frozen=True, slots=True)
class _Segment:
    """Features of a segment; without an end it is as long as the template."""

    line: int
    start: int
    stop: int | None
    features: tuple[_Piece, ...]


def parse_states(text: str, feature_set: FeatureSet) -> States:
    """States of the cells that a text describes.

    Raises
    ------
    InvalidInput
        If a line is not understood, names an unknown feature or contradicts another one.
    """
    segments: list[_Segment] = []
    length: int | None = None
    end = 0
    for number, pieces in enumerate(_logical_lines(text)):
        line, content = pieces[0]
        try:
            if _is_header(content, feature_set, first=number == 0):
                continue
            if found := _LASTS.fullmatch(content.casefold()):
                length = _read_length(found[1], length)
                continue
            segment, end = _read_segment(pieces, end)
        except InvalidInput as error:
            raise InvalidInput(f"line {line}: {error}") from None
        segments.append(segment)
    return _fill(segments, _check_length(length, segments), feature_set)


def _logical_lines(text: str) -> Iterator[list[_Piece]]:
    """Lines that say something, those that end in a comma with their continuation."""
    pieces: list[_Piece] = []
    for number, line in enumerate(text.splitlines(), start=1):
        content = " ".join(line.split("#")[0].split())
        if not content:
            continue
        if pieces and ":" in content:
            raise InvalidInput(f"line {pieces[-1].line}: ends in a comma, and a new line begins")
        pieces.append(_Piece(number, content.removesuffix(",")))
        if not content.endswith(","):
            yield pieces
            pieces = []
    if pieces:
        raise InvalidInput(f"line {pieces[-1].line}: ends in a comma, and nothing follows")


def _is_header(content: str, feature_set: FeatureSet, *, first: bool) -> bool:
    head, colon, name = content.partition(":")
    if not colon or head.strip().casefold() != "features":
        return False
    if not first:
        raise InvalidInput("the feature set is named in the first line")
    if name.strip() != feature_set.name:
        raise InvalidInput(
            f"the text is over {name.strip()!r}, asked for is {feature_set.name!r}; "
            "pass feature_set=... of the text"
        )
    return True


def _read_length(seconds: str, before: int | None) -> int:
    if before is not None:
        raise InvalidInput("the length was given before")
    return count_columns(float(seconds))


def _read_segment(pieces: list[_Piece], end: int) -> tuple[_Segment, int]:
    """What a line says, and where a segment that follows begins."""
    line, content = pieces[0]
    head, colon, rest = content.partition(":")
    features = (_Piece(line, rest), *pieces[1:])
    when = head.strip().casefold()
    if colon and when == "throughout":
        return _Segment(line, 0, None, features), end
    if colon and (found := _FOR.fullmatch(when)):
        stop = end + count_columns(float(found[1]))
        return _Segment(line, end, stop, features), stop
    if colon and (found := _FOR_RANGE.fullmatch(when)):
        stop = end + fit_columns(float(found[1]), float(found[2]))
        return _Segment(line, end, stop, features), stop
    if colon and (found := _FROM.fullmatch(when)):
        start, stop = count_columns(float(found[1]), least=0), count_columns(float(found[2]))
        if stop <= start:
            raise InvalidInput(f"must end after its start, got {found[1]} to {found[2]} s")
        return _Segment(line, start, stop, features), end
    raise InvalidInput(f"not understood: {content if not colon else head!r}; expected {_FORMS}")


def _check_length(length: int | None, segments: list[_Segment]) -> int:
    """Columns of the template."""
    ends = [(s.stop, s.line) for s in segments if s.stop is not None]
    longest, line = max(ends, default=(0, segments[0].line if segments else 1))
    if length is None and longest == 0:
        raise InvalidInput(f"line {line}: the text gives no length; expected {_FORMS}")
    if length is not None and longest > length:
        raise InvalidInput(
            f"line {line}: ends at {show_seconds(longest)} s, but the template lasts "
            f"{show_seconds(length)} s"
        )
    return length or longest


def _fill(segments: list[_Segment], n_columns: int, feature_set: FeatureSet) -> States:
    states = np.full((n_columns, len(feature_set)), FREE, dtype=np.int8)
    given_in = np.zeros(states.shape, dtype=np.intp)
    for segment in segments:
        part = slice(segment.start, segment.stop)
        for line, feature, holds in _read_features(segment, feature_set):
            cells, lines = states[part, feature], given_in[part, feature]
            against = np.flatnonzero(cells == 1 - holds)
            if len(against):
                first, stop = segment.start + against[0], segment.start + against[-1] + 1
                raise InvalidInput(
                    f"line {line}: {_phrase(feature, holds, feature_set)!r} contradicts "
                    f"{_phrase(feature, 1 - holds, feature_set)!r} of line {lines[against[0]]}, "
                    f"from {show_seconds(first)} to {show_seconds(stop)} s"
                )
            cells[:], lines[:] = holds, line
    return states


def _phrase(feature: int, holds: int, feature_set: FeatureSet) -> str:
    return ("" if holds else "not ") + feature_set.names[feature]


def _read_features(segment: _Segment, feature_set: FeatureSet) -> Iterator[tuple[int, int, int]]:
    """Line, number of the feature, and 1 if it must hold, else 0."""
    names = [
        (line, name.strip()) for line, content in segment.features for name in content.split(",")
    ]
    if len(names) == 1 and names[0][1].casefold() == ANYTHING:
        return
    for line, name in names:
        try:
            yield line, *_read_feature(name, feature_set)
        except InvalidInput as error:
            raise InvalidInput(f"line {line}: {error}") from None


def _read_feature(name: str, feature_set: FeatureSet) -> tuple[int, int]:
    if not name:
        raise InvalidInput(f"a feature is missing; {ANYTHING!r} stands for none")
    if name.casefold() == ANYTHING:
        raise InvalidInput(f"{ANYTHING!r} stands alone: what is not mentioned is free")
    if name.casefold().startswith("not "):
        return find_feature(name[4:], feature_set), 0
    return find_feature(name, feature_set), 1


# -- lengths ------------------------------------------------------------------------------


def count_columns(seconds: float, *, least: int = 1) -> int:
    """Columns of a segment of so many seconds.

    Raises
    ------
    InvalidInput
        If it rounds to fewer than `least` columns, or lasts more than ten minutes.
    """
    if not 0.0 <= seconds <= MOST_S:
        raise InvalidInput(f"a template needs times from 0 to {MOST_S:g} s, got {seconds:g}")
    columns = math.floor(seconds * RATE_HZ + 0.5)
    if columns < least:
        raise InvalidInput(
            f"a segment needs at least {least / RATE_HZ:.2f} s ({least} column), got {seconds:g}"
        )
    return columns


def fit_columns(least_s: float, most_s: float) -> int:
    """Columns of a segment that matches any length of a range, and as little more as can be.

    Raises
    ------
    InvalidInput
        If the range is empty, or too wide for one segment.
    """
    if not 0.0 < least_s <= most_s:
        raise InvalidInput(
            f"a range of lengths needs 0 < least <= most, got {least_s:g} to {most_s:g} s"
        )
    least, most = count_columns(least_s), count_columns(most_s)
    # K columns match 1 + ceil((K - 1) / 2) to 2 K - 1 frames.
    fewest, greatest = math.ceil((most + 1) / 2), 2 * least - 1
    if fewest > greatest:
        raise InvalidInput(
            f"{least_s:g} to {most_s:g} s is too wide: a segment matches from half to double of "
            "its length, so the longest may be nearly four times the shortest; "
            "for wider gaps make a keyframe query"
        )
    return min(max(math.floor(math.sqrt(least * most) + 0.5), fewest), greatest)


def show_seconds(columns: int) -> str:
    """Seconds of so many columns, as short as finds the columns again."""
    # Two digits do: a column is 0.033 s long.
    text = f"{columns / RATE_HZ:.2f}"
    return text.rstrip("0").rstrip(".")
