"""Keyframe queries given by names of features: as text, and as authors' patterns.

One keyframe a line, the gap to the next one on a line between:

    features: full-body-40
    right hand above neck, not left knee bent
    then within 0.1 to 0.5 s
    right hand fast          # comments are ignored

Features go by name or id, "not" in front of those that must not hold; features that are
not mentioned are free, a line "anything" frees all. Gaps are one of

    then within 0.1 to 0.5 s
    then within 0.5 s                from 0 s on
    then after 0.2 s                 exactly
    then after at least 0.2 s
    then                             at any later time, or the same
    at the same time

A keyframe may give its place in its template: `at 0.5 s: right hand fast`. The first line
names the feature set; it may be left out. Seconds are counted from one keyframe to the
next; what is written reads back to the same frames. A line "or" separates queries of which
any may hit. A short query may stand on one line: `F13, then within 0.5 s F3`.
"""

import difflib
import itertools
import math
import re
from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.features import FULL_BODY, SEQUENCE_HZ, FeatureSet
from motionary.models.keyframes.query import (
    Gap,
    KeyframeQuery,
    check_features,
    gap_of_seconds,
    gaps_of,
    group_members,
)
from motionary.packing import pack, unpack

_NUMBER = r"(\d{1,9}\.?\d{0,9}|\.\d{1,9})"
_SECONDS = rf"{_NUMBER}\s*s(?:ec|econds?)?"
#: Groups: least and most seconds, or whether at least, and after how many.
_GAP = (
    rf"then within (?:{_NUMBER}(?:\s*s)? (?:to|and) )?{_SECONDS}|then after (at least )?{_SECONDS}"
    r"|then|at the same time"
)
_GAP_LINE = re.compile(_GAP, re.IGNORECASE)
_GAP_INSIDE = re.compile(rf"[,;:]?\s*\b({_GAP})\b[,;:]?\s*", re.IGNORECASE)
_STARTS_AS_GAP = re.compile(r"(then|at the same time)\b", re.IGNORECASE)
_POSITION = re.compile(rf"at {_SECONDS}\s*:\s*(.*)")
_HEADER = re.compile(r"features\s*:\s*(.*)")
_ANYTHING = "anything"
_OR = "or"
#: Names that would be read as something else; such features are written by their id.
_NOT_A_NAME = re.compile(
    r"(not|at|anything|features)\b.*|.*([,#:]|\bthen\b|\bat the same time\b).*", re.IGNORECASE
)

#: Signs of the authors' patterns: value, and whether it is fixed.
_SIGNS = {"0": (False, True), "1": (True, True), "*": (False, False)}


class Vocabulary(Protocol):
    """Names of yes/no features; a `FeatureSet` is one."""

    @property
    def name(self) -> str:
        """Name of the set."""

    @property
    def ids(self) -> tuple[str, ...]:
        """Short names, in the order of the bits."""

    @property
    def names(self) -> tuple[str, ...]:
        """Phrases, in the order of the bits."""


def from_features(
    keyframes: Sequence[Mapping[str, bool]],
    gaps: Sequence[Gap],
    *,
    vocabulary: Vocabulary = FULL_BODY,
    positions: Sequence[int] | None = None,
) -> KeyframeQuery:
    """Query of keyframes given as features that hold and that do not.

    Parameters
    ----------
    keyframes : per keyframe, True or False by id or name of a feature; others are free
    positions : template columns of the keyframes

    Raises
    ------
    InvalidInput
        If there is no keyframe, a feature is unknown, or a gap contradicts itself.
    """
    values, fixed = np.zeros((2, len(keyframes), len(vocabulary.ids)), dtype=np.bool_)
    for k, features in enumerate(keyframes):
        for feature, holds in features.items():
            i = find_feature(feature, vocabulary)
            if fixed[k, i] and values[k, i] != holds:
                raise InvalidInput(f"keyframe {k + 1} wants {feature!r} to hold and not to hold")
            values[k, i], fixed[k, i] = holds, True
    return _query(values, fixed, gaps, vocabulary, positions)


def from_patterns(
    patterns: Sequence[str],
    groups: Sequence[str],
    *,
    distances: Sequence[float],
    stiffness: Sequence[float],
    positions: Sequence[int] | None = None,
    feature_set: FeatureSet = FULL_BODY,
) -> KeyframeQuery:
    """Query of patterns over groups of features, as the authors' collections hold them.

    Parameters
    ----------
    patterns : per keyframe, "0", "1" or "*" for the first features of its group; features
        that the pattern is too short for are free
    groups : per keyframe, the group of its features, of this feature set
    distances, stiffness : per gap, frames and stiffness
    positions : template columns, from 0

    Raises
    ------
    InvalidInput
        If a pattern is malformed or longer than its group, or numbers do not fit.
    """
    if len(patterns) != len(groups):
        raise InvalidInput(f"{len(patterns)} keyframes need as many groups, got {len(groups)}")
    values, fixed = np.zeros((2, len(patterns), len(feature_set)), dtype=np.bool_)
    for k, (pattern, group) in enumerate(zip(patterns, groups, strict=True)):
        members = np.flatnonzero(group_members(group, feature_set))
        if len(pattern) > len(members) or not set(pattern) <= _SIGNS.keys():
            raise InvalidInput(
                f"keyframe {k + 1}: a pattern of group {group!r} needs at most {len(members)} "
                f"signs 0, 1 or *, got {pattern!r}"
            )
        for i, sign in zip(members, pattern, strict=False):
            values[k, i], fixed[k, i] = _SIGNS[sign]
    return _query(values, fixed, gaps_of(distances, stiffness), feature_set, positions)


def parse_query(
    text: str, *, vocabulary: Vocabulary = FULL_BODY, rate_hz: float = SEQUENCE_HZ
) -> KeyframeQuery:
    """Query that a text describes, in lines as in the module's description.

    Raises
    ------
    InvalidInput
        If a line is not understood; names the line.
    """
    keyframes: list[dict[str, bool]] = []
    gaps: list[Gap] = []
    positions: list[int | None] = []
    for number, line in _lines(text):
        try:
            if _is_header(line, vocabulary, first=not keyframes):
                continue
            gap = _parse_gap(line, rate_hz)
            if gap is not None:
                if len(gaps) == len(keyframes):
                    raise InvalidInput("a gap must stand between two keyframes")
                gaps.append(gap)
                continue
            if len(gaps) < len(keyframes):
                raise InvalidInput(
                    "between two keyframes there must be a gap, such as 'then within 0.1 to 0.5 s'"
                )
            position, keyframe = _parse_keyframe(line, vocabulary, rate_hz)
            positions.append(position)
            keyframes.append(keyframe)
        except InvalidInput as error:
            raise InvalidInput(f"line {number}: {error}") from None
    if len(gaps) != max(len(keyframes) - 1, 0):
        raise InvalidInput("the last line must be a keyframe, got a gap with nothing after it")
    columns = [position for position in positions if position is not None]
    if columns and len(columns) != len(keyframes):
        raise InvalidInput("either all keyframes give their position ('at 0.5 s: ...') or none")
    return from_features(keyframes, gaps, vocabulary=vocabulary, positions=columns or None)


def format_query(
    query: KeyframeQuery, *, vocabulary: Vocabulary = FULL_BODY, rate_hz: float = SEQUENCE_HZ
) -> str:
    """Text of a query over this vocabulary; `parse_query` reads it back to the same query."""
    check_features(query, vocabulary.name, vocabulary.ids)
    n_features = len(vocabulary.ids)
    fixed, values = unpack(query.fixed, n_features), unpack(query.values, n_features)
    lines = [f"features: {vocabulary.name}"]
    for k in range(len(query)):
        if k > 0:
            lines.append(_format_gap(query.gaps[k - 1], rate_hz))
        features = [
            ("" if values[k, i] else "not ") + _name(int(i), vocabulary)
            for i in fixed[k].nonzero()[0]
        ]
        line = ", ".join(features) or _ANYTHING
        if query.positions is not None:
            line = f"at {_format_seconds(query.positions[k], rate_hz)} s: {line}"
        lines.append(line)
    return "\n".join(lines) + "\n"


def parse_queries(
    text: str, *, vocabulary: Vocabulary = FULL_BODY, rate_hz: float = SEQUENCE_HZ
) -> tuple[KeyframeQuery, ...]:
    """Queries of a text, separated by lines "or"; see `parse_query`.

    Raises
    ------
    InvalidInput
        If a line is not understood, or there is no query; names the line.
    """
    lines = text.splitlines()
    plain = [line.split("#")[0].strip().lower() for line in lines]
    borders = [i for i, line in enumerate(plain) if line == _OR]
    queries = []
    for start, stop in itertools.pairwise([-1, *borders, len(lines)]):
        # Empty lines before a query keep its lines' numbers.
        part = [""] * (start + 1) + lines[start + 1 : stop]
        queries.append(parse_query("\n".join(part), vocabulary=vocabulary, rate_hz=rate_hz))
    return tuple(queries)


def format_queries(
    queries: Sequence[KeyframeQuery],
    *,
    vocabulary: Vocabulary = FULL_BODY,
    rate_hz: float = SEQUENCE_HZ,
) -> str:
    """Text of queries over this vocabulary; `parse_queries` reads it back to the same."""
    texts = (format_query(query, vocabulary=vocabulary, rate_hz=rate_hz) for query in queries)
    return f"{_OR}\n".join(texts)


def _lines(text: str) -> list[tuple[int, str]]:
    """Lines that are not empty, with their numbers; spaces evened out."""
    plain = [" ".join(line.split("#")[0].split()) for line in text.splitlines()]
    return [(n, part) for n, line in enumerate(plain, start=1) for part in _at_gaps(line) if part]


def _at_gaps(line: str) -> list[str]:
    """A line, or its parts where gaps stand between keyframes on it."""
    if _STARTS_AS_GAP.match(line):
        return [line]
    parts, at = [], 0
    for gap in _GAP_INSIDE.finditer(line):
        parts += [line[at : gap.start()], gap[1]]
        at = gap.end()
    return [*parts, line[at:]]


def _is_header(line: str, vocabulary: Vocabulary, *, first: bool) -> bool:
    header = _HEADER.fullmatch(line)
    if header is None:
        return False
    if not first:
        raise InvalidInput("the feature set is named in the first line")
    if header[1] != vocabulary.name:
        raise InvalidInput(
            f"the query is over {header[1]!r}, asked for is {vocabulary.name!r}; "
            "both must be of one set"
        )
    return True


def _parse_gap(line: str, rate_hz: float) -> Gap | None:
    line = line.lower()
    if found := _GAP_LINE.fullmatch(line):
        least_s, most_s, at_least, after_s = found.groups()
        if most_s is not None:
            return gap_of_seconds(float(least_s or 0.0), float(most_s), rate_hz=rate_hz)
        if after_s is not None:
            most = math.inf if at_least else float(after_s)
            return gap_of_seconds(float(after_s), most, rate_hz=rate_hz)
        return Gap(0, None) if line == "then" else Gap(0, 0)
    if line.startswith("then "):
        raise InvalidInput(
            f"no gap of the form {line!r}; write 'then within 0.1 to 0.5 s', "
            "'then within 0.5 s', 'then after 0.2 s', 'then after at least 0.2 s', 'then' or "
            "'at the same time'"
        )
    return None


def _parse_keyframe(
    line: str, vocabulary: Vocabulary, rate_hz: float
) -> tuple[int | None, dict[str, bool]]:
    position = None
    if found := _POSITION.fullmatch(line):
        position, line = round(float(found[1]) * rate_hz), found[2]
    features: dict[str, bool] = {}
    if line.lower() == _ANYTHING:
        return position, features
    for part in line.split(","):
        name = part.strip()
        holds = not name.lower().startswith("not ")
        feature = vocabulary.ids[find_feature(name if holds else name[4:], vocabulary)]
        if features.setdefault(feature, holds) != holds:
            raise InvalidInput(f"{name!r} and its opposite in one keyframe")
    return position, features


def _name(feature: int, vocabulary: Vocabulary) -> str:
    """Phrase of a feature, or its id where the phrase would not be read as that."""
    name = vocabulary.names[feature]
    if _NOT_A_NAME.fullmatch(name) or find_feature(name, vocabulary) != feature:
        return vocabulary.ids[feature]
    return name


def _format_gap(gap: Gap, rate_hz: float) -> str:
    least = _format_seconds(gap.least, rate_hz)
    if gap.most is None:
        return f"then after at least {least} s" if gap.least else "then"
    if gap.most == 0:
        return "at the same time"
    if gap.most == gap.least:
        return f"then after {least} s"
    return f"then within {least} to {_format_seconds(gap.most, rate_hz)} s"


def _format_seconds(frames: int, rate_hz: float) -> str:
    # At most a twentieth of a frame beside the frame, as `gap_of_seconds` expects.
    digits = max(math.ceil(math.log10(10 * rate_hz)), 1)
    return f"{frames / rate_hz:.{digits}f}".rstrip("0").rstrip(".")


def _query(
    values: NDArray[np.bool_],
    fixed: NDArray[np.bool_],
    gaps: Sequence[Gap],
    vocabulary: Vocabulary,
    positions: Sequence[int] | None,
) -> KeyframeQuery:
    columns = None if positions is None else tuple(positions)
    return KeyframeQuery(
        pack(values), pack(fixed), tuple(gaps), vocabulary.name, vocabulary.ids, columns
    )


def find_feature(name: str, vocabulary: Vocabulary) -> int:
    """Number of a feature by its id or name, in any case; an unknown name is refused."""
    wanted = " ".join(name.split()).casefold()
    for known in (vocabulary.ids, vocabulary.names):
        folded = [one.casefold() for one in known]
        if wanted in folded:
            return folded.index(wanted)
    all_names = [*vocabulary.names, *vocabulary.ids]
    near = difflib.get_close_matches(wanted, all_names, n=1, cutoff=0.5)
    hint = f"; did you mean {near[0]!r}?" if near else f"; there are {', '.join(all_names)}"
    raise InvalidInput(f"no feature {name!r} in {vocabulary.name!r}{hint}")
