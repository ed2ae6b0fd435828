"""Motion templates as text that a person reads and writes.

What must hold and for how long, one segment a line, one after the other:

    # sweeping with a hand brush
    features: full-body-40
    for 1.5 s: right hand fast, spine horizontal, right hand low
    for 0.3 to 0.5 s: not right knee bent
    for 0.2 s: anything

or, where features come and go at times of their own, by the time from the beginning:

    lasts 1.57 s
    throughout: not body moves fast
    from 0.4 to 1.1 s: right knee bent, left knee bent

Features go by name or id, "not" in front of those that must not hold; what is not
mentioned is free. A line that ends in a comma goes on in the next one; the first line may
name the feature set.

A segment has one length, and matching takes from half to double of it: one of a range gets
the length whose half and double cover the range.

Conventions: columns at 30 Hz; seconds are rounded to columns, segments are half-open. States
of cells are 1, 0 and -1 for free, shape (columns, features). What is refused is refused by
the number of its line.
"""

import re
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.features import FULL_BODY, FeatureSet, find_feature
from motionary.models.templates.template import (
    MotionTemplate,
    count_columns,
    find_set,
    fit_columns,
    quantise,
    show_seconds,
)
from motionary.recording import split_runs

States = NDArray[np.int8]
# Number and text of lines, without comments and needless spaces.
_Pieces = list[tuple[int, str]]

_FREE = -1
_ANYTHING = "anything"
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
_BY_HAND = "by hand"
# By state; that of free is the last.
_VALUES = np.array([0.0, 1.0, 0.5])
_FEW_SEGMENTS = 4
_LINE_WIDTH = 96
# Would be read as something else.
_MISLEADING = re.compile(rf"[,:#]|^not |^{_ANYTHING}$|^$")


def template_from_text(
    text: str, *, feature_set: FeatureSet = FULL_BODY, name: str = ""
) -> MotionTemplate:
    """Template that a text describes: cells are 0, 1 or free, columns weigh 1.

    Parameters
    ----------
    text : lines as above
    feature_set : what the features are called
    name : what is described, for the template's provenance

    Raises
    ------
    InvalidInput
        If a line is not understood, names an unknown feature or contradicts another one;
        names the line.
    """
    states = _parse_states(text, feature_set)
    return MotionTemplate(
        values=_VALUES[states],
        weights=np.ones(len(states)),
        feature_names=feature_set.ids,
        feature_set=feature_set.name,
        provenance=f"{name}, designed {_BY_HAND}" if name else f"designed {_BY_HAND}",
    )


def template_to_text(
    template: MotionTemplate, *, tolerance: float, feature_set: FeatureSet | None = None
) -> str:
    """Text of a template's fixed cells, which `template_from_text` reads back to the same.

    Fractions between and the weights of columns are not written; `revise_template` keeps them.

    Parameters
    ----------
    tolerance : in [0, 0.5); as in `quantise`
    feature_set : gives the features their phrases; sets that are known by their name
        need not be given

    Raises
    ------
    InvalidInput
        If the tolerance is out of range, or the set unknown or another one.
    """
    features = find_set(template, feature_set=feature_set)
    lines = [f"# {' '.join(template.provenance.split())}"] if template.provenance else []
    if template.unmeasured:
        names = dict(zip(features.ids, features.names, strict=True))
        unmeasured = ", ".join(names[id_] for id_ in template.unmeasured)
        lines.append(f"# measured in no example: {unmeasured}")
    lines.append(f"features: {features.name}")
    states, phrases = _states(template, tolerance), _phrases(features)
    few = len(split_runs(states)) <= _FEW_SEGMENTS
    lines += _write_in_turn(states, phrases) if few else _write_by_time(states, phrases)
    return "\n".join(lines) + "\n"


def revise_template(
    template: MotionTemplate,
    text: str,
    *,
    tolerance: float,
    feature_set: FeatureSet | None = None,
) -> MotionTemplate:
    """Template that fixes what its edited text asks for.

    Where the text is as long as the template, cells whose state did not change keep their
    fraction of the examples, and columns their weights; a text of another length replaces all.

    Parameters
    ----------
    text : `template_to_text` of the template, edited
    tolerance : what the text was made with
    feature_set : as in `template_to_text`

    Raises
    ------
    InvalidInput
        As in `template_from_text`.
    """
    features = find_set(template, feature_set=feature_set)
    provenance = template.provenance or "a template"
    if not provenance.endswith(_BY_HAND):
        provenance += f", edited {_BY_HAND}"
    states = _parse_states(text, features)
    if len(states) != template.n_columns:
        new = template_from_text(text, feature_set=features)
        return replace(new, provenance=provenance)
    changed = states != _states(template, tolerance)
    if not changed.any():
        return template
    values = np.where(changed, _VALUES[states], template.values)
    return replace(template, values=values, provenance=provenance)


def _states(template: MotionTemplate, tolerance: float) -> States:
    quantised = quantise(template, tolerance=tolerance)
    return np.where(quantised.fixed, quantised.values, _FREE).astype(np.int8)


# -- reading ------------------------------------------------------------------------------


class _Segment(NamedTuple):
    """Features of a segment, by lines; without an end it is as long as the template."""

    line: int
    start: int
    stop: int | None
    features: _Pieces


def _parse_states(text: str, feature_set: FeatureSet) -> States:
    """States of the cells that a text describes."""
    segments: list[_Segment] = []
    length: int | None = None
    end = 0
    for number, pieces in enumerate(_logical_lines(text)):
        line, content = pieces[0]
        try:
            if _is_header(content, feature_set, first=number == 0):
                continue
            if found := _LASTS.fullmatch(content.casefold()):
                if length is not None:
                    raise InvalidInput("the length was given before")
                length = count_columns(float(found[1]))
                continue
            segment, end = _read_segment(pieces, end)
        except InvalidInput as error:
            raise InvalidInput(f"line {line}: {error}") from None
        segments.append(segment)
    return _fill(segments, _check_length(length, segments), feature_set)


def _logical_lines(text: str) -> Iterator[_Pieces]:
    """Lines that say something, those that end in a comma with their continuation."""
    pieces: _Pieces = []
    for number, line in enumerate(text.splitlines(), start=1):
        content = " ".join(line.split("#")[0].split())
        if not content:
            continue
        if pieces and ":" in content:
            raise InvalidInput(f"line {pieces[-1][0]}: ends in a comma, and a new line begins")
        pieces.append((number, content.removesuffix(",")))
        if not content.endswith(","):
            yield pieces
            pieces = []
    if pieces:
        raise InvalidInput(f"line {pieces[-1][0]}: ends in a comma, and nothing follows")


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


def _read_segment(pieces: _Pieces, end: int) -> tuple[_Segment, int]:
    """What a line says, and where a segment that follows begins."""
    line, content = pieces[0]
    head, colon, rest = content.partition(":")
    features = [(line, rest), *pieces[1:]]
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
    states = np.full((n_columns, len(feature_set)), _FREE, dtype=np.int8)
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
    if len(names) == 1 and names[0][1].casefold() == _ANYTHING:
        return
    for line, name in names:
        holds = not name.casefold().startswith("not ")
        try:
            if not name:
                raise InvalidInput(f"a feature is missing; {_ANYTHING!r} stands for none")
            if name.casefold() == _ANYTHING:
                raise InvalidInput(f"{_ANYTHING!r} stands alone: what is not mentioned is free")
            yield line, find_feature(name if holds else name[4:], feature_set), int(holds)
        except InvalidInput as error:
            raise InvalidInput(f"line {line}: {error}") from None


# -- writing ------------------------------------------------------------------------------


def _phrases(feature_set: FeatureSet) -> list[str]:
    """What each feature is called: its name where that reads back, else its id."""
    names = [" ".join(name.split()).casefold() for name in feature_set.names]
    ids = [id_.casefold() for id_ in feature_set.ids]
    phrases = []
    for feature, name, id_ in zip(feature_set.features, names, ids, strict=True):
        readable = names.count(name) == 1 and name not in ids and not _MISLEADING.search(name)
        if not readable and (_MISLEADING.search(id_) or ids.count(id_) > 1):
            raise InvalidInput(
                f"feature {feature.id!r} of {feature_set.name!r} has no name that reads back; "
                "give it an id of letters and digits"
            )
        phrases.append(feature.name if readable else feature.id)
    return phrases


def _write_in_turn(states: States, phrases: list[str]) -> list[str]:
    lines = []
    for start, stop in split_runs(states):
        asked = [
            _with_sign(phrases[i], states[start, i]) for i in np.flatnonzero(states[start] != _FREE)
        ]
        lines += _fold(f"for {show_seconds(stop - start)} s", asked or [_ANYTHING])
    return lines


def _write_by_time(states: States, phrases: list[str]) -> list[str]:
    """Each run of each feature, those of the same time together, in the order of time."""
    runs: dict[tuple[int, int], list[str]] = {}
    for i, phrase in enumerate(phrases):
        for start, stop in split_runs(states[:, i]):
            if states[start, i] != _FREE:
                runs.setdefault((start, stop), []).append(_with_sign(phrase, states[start, i]))
    lines = [f"lasts {show_seconds(len(states))} s"]
    lines += _fold("throughout", runs.pop((0, len(states)), []))
    for start, stop in sorted(runs):
        lines += _fold(f"from {show_seconds(start)} to {show_seconds(stop)} s", runs[start, stop])
    return lines


def _with_sign(phrase: str, state: np.int8) -> str:
    return phrase if state == 1 else f"not {phrase}"


def _fold(head: str, phrases: list[str]) -> list[str]:
    """A line of phrases, folded at its commas; nothing for none."""
    lines: list[str] = []
    for i, phrase in enumerate(phrases):
        comma = "," if i < len(phrases) - 1 else ""
        if i == 0:
            lines.append(f"{head}: {phrase}{comma}")
        elif len(lines[-1]) + len(phrase) + 2 > _LINE_WIDTH:
            lines.append(f"    {phrase}{comma}")
        else:
            lines[-1] += f" {phrase}{comma}"
    return lines
