"""How does a person write, read and keep a keyframe query?

One keyframe a line, the gap to the next one on a line between:

    features: full-body-40
    right hand above neck, not left knee bent
    then within 0.1 to 0.5 s
    right hand fast          # comments are ignored

Relations go by name or id, "not" in front of those that must not hold; relations that are
not mentioned are free, a line "anything" frees all. Gaps are one of

    then within 0.1 to 0.5 s
    then within 0.5 s                from 0 s on
    then after 0.2 s                 exactly
    then after at least 0.2 s
    then                             at any later time, or the same
    at the same time

A keyframe may tell where it stands in its template: `at 0.5 s: right hand fast`. The first
line names the feature set; it may be left out. Seconds are counted from one keyframe to
the next; what is written reads back to the same frames. A line "or" separates queries of
which any may hit. A short query may stand on one line: `F13, then within 0.5 s F3`.
"""

import itertools
import math
import re
from collections.abc import Sequence

from motionary.errors import InvalidInput
from motionary.features import FULL_BODY, SEQUENCE_HZ
from motionary.models.keyframes.building import Vocabulary, find_feature, from_features
from motionary.models.keyframes.query import Gap, KeyframeQuery, check_features, gap_of_seconds
from motionary.packing import unpack

_NUMBER = r"(\d{1,9}\.?\d{0,9}|\.\d{1,9})"
_SECONDS = rf"{_NUMBER}\s*s(?:ec|econds?)?"
_WITHIN_BOTH = re.compile(rf"then within {_NUMBER}(?:\s*s)? (?:to|and) {_SECONDS}")
_WITHIN = re.compile(rf"then within {_SECONDS}")
_AFTER = re.compile(rf"then after {_SECONDS}")
_AFTER_LEAST = re.compile(rf"then after at least {_SECONDS}")
_GAP_INSIDE = re.compile(
    rf"[,;:]?\s*\b(then within {_NUMBER}(?:\s*s)? (?:to|and) {_SECONDS}|then within {_SECONDS}"
    rf"|then after at least {_SECONDS}|then after {_SECONDS}|then|at the same time)\b[,;:]?\s*",
    re.IGNORECASE,
)
_STARTS_AS_GAP = re.compile(r"(then|at the same time)\b", re.IGNORECASE)
_POSITION = re.compile(rf"at {_SECONDS}\s*:\s*(.*)")
_HEADER = re.compile(r"features\s*:\s*(.*)")
_ANYTHING = "anything"
_OR = "or"
#: Names that would be read as something else; such features are written by their id.
_NOT_A_NAME = re.compile(
    r"(not|at|anything|features)\b.*|.*([,#:]|\bthen\b|\bat the same time\b).*", re.IGNORECASE
)


def parse_query(
    text: str, *, vocabulary: Vocabulary = FULL_BODY, rate_hz: float = SEQUENCE_HZ
) -> KeyframeQuery:
    """Query that a text describes.

    Parameters
    ----------
    text : lines as above
    vocabulary : what the relations are called
    rate_hz : frames per second

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
            _check_order(gap is not None, n_keyframes=len(keyframes), n_gaps=len(gaps))
            if gap is not None:
                gaps.append(gap)
                continue
            position, keyframe = _parse_keyframe(line, vocabulary, rate_hz)
            positions.append(position)
            keyframes.append(keyframe)
        except InvalidInput as error:
            raise InvalidInput(f"line {number}: {error}") from None
    if len(gaps) != max(len(keyframes) - 1, 0):
        raise InvalidInput("the last line must be a keyframe, got a gap with nothing after it")
    columns = [position for position in positions if position is not None]
    if columns and len(columns) != len(keyframes):
        raise InvalidInput("either all keyframes tell their position ('at 0.5 s: ...') or none")
    return from_features(keyframes, gaps, vocabulary=vocabulary, positions=columns or None)


def format_query(
    query: KeyframeQuery, *, vocabulary: Vocabulary = FULL_BODY, rate_hz: float = SEQUENCE_HZ
) -> str:
    """Text of a query, which `parse_query` reads back to the same query.

    Raises
    ------
    InvalidInput
        If the query is over other features than the vocabulary.
    """
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
    """Text of queries, which `parse_queries` reads back to the same queries.

    Raises
    ------
    InvalidInput
        If a query is over other features than the vocabulary.
    """
    texts = [format_query(query, vocabulary=vocabulary, rate_hz=rate_hz) for query in queries]
    return f"{_OR}\n".join(texts)


def _lines(text: str) -> list[tuple[int, str]]:
    """Lines that say something, with their numbers; spaces and case evened out."""
    plain = [" ".join(line.split("#")[0].split()) for line in text.splitlines()]
    numbered = [(n, part) for n, line in enumerate(plain, start=1) for part in _at_gaps(line)]
    return [(number, part) for number, part in numbered if part]


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
    if line == "at the same time":
        return Gap(0, 0)
    if line == "then":
        return Gap(0, None)
    if found := _WITHIN_BOTH.fullmatch(line):
        return gap_of_seconds(float(found[1]), float(found[2]), rate_hz=rate_hz)
    if found := _WITHIN.fullmatch(line):
        return gap_of_seconds(0.0, float(found[1]), rate_hz=rate_hz)
    if found := _AFTER.fullmatch(line):
        return gap_of_seconds(float(found[1]), float(found[1]), rate_hz=rate_hz)
    if found := _AFTER_LEAST.fullmatch(line):
        return gap_of_seconds(float(found[1]), math.inf, rate_hz=rate_hz)
    if line.startswith("then "):
        raise InvalidInput(
            f"no gap of the form {line!r}; write 'then within 0.1 to 0.5 s', "
            "'then within 0.5 s', 'then after 0.2 s', 'then after at least 0.2 s', 'then' or "
            "'at the same time'"
        )
    return None


def _check_order(is_gap: bool, *, n_keyframes: int, n_gaps: int) -> None:
    if is_gap and n_gaps == n_keyframes:
        raise InvalidInput("a gap must stand between two keyframes")
    if not is_gap and n_gaps < n_keyframes:
        raise InvalidInput(
            "between two keyframes there must be a gap, such as 'then within 0.1 to 0.5 s'"
        )


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
