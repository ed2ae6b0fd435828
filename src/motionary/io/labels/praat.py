"""Labels in TextGrids of Praat, in its long and short text files.

Conventions: one recording a file, called as the file. An interval tier per track, and per lane
where labels overlap; labels without duration stand in a point tier of the same name. As Praat
reads them: strings, flags and numbers that stand free, whatever else is around.
"""

import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from motionary.errors import UnreadableFile, Where
from motionary.io.formats.numbers import parse_number
from motionary.io.labels.lanes import (
    PLAIN,
    UNASSESSED,
    build_tracks,
    make_label,
    only_one,
    split_lanes,
    track_of_lane,
)
from motionary.io.text import read_text, stem_of, write_text
from motionary.labels import Label, LabelTrack
from motionary.recording import Recording, Segment

_INTERVALS, _POINTS = "IntervalTier", "TextTier"
_TOKEN = re.compile(r'"((?:[^"]|"")*)"|(?<!\S)(<\w+>|[-+]?\d[\d.eE+-]*)(?!\S)|(?<!\S)![^\n]*')


class _Tier(NamedTuple):
    kind: str
    name: str
    items: list[tuple[float, float, str]]


def read_text_grid(path: Path, *, rate_hz: float | None = None) -> dict[str, LabelTrack]:
    """Labels of a TextGrid; see `read_labels`."""
    tiers = list(_read_tiers(_Tokens(read_text(path), path.name)))
    name, names = stem_of(path), {tier.name for tier in tiers}
    labels, unassessed = [], []
    for tier in tiers:
        for start, end, text in tier.items:
            if not text.strip():
                continue
            if tier.name == UNASSESSED:
                unassessed.append((name, Segment(start, end)))
                continue
            track = track_of_lane(tier.name, names)
            where = Where(file=path.name, place=f"tier {tier.name[:40]!r}")
            labels.append((name, make_label(text, start, end, where=where, track=track)))
    return build_tracks(labels, unassessed, {name: Recording(name)})


class _Tokens:
    """Strings and numbers of a file, one after the other."""

    def __init__(self, text: str, name: str) -> None:
        self._found = (token for token in _TOKEN.finditer(text) if not token[0].startswith("!"))
        self.name = name
        self._before = self._last = "the beginning"

    def string(self) -> str:
        """The next token, a string."""
        token = self._next("a text in quotes")
        if token[1] is None:
            raise self._wrong("a text in quotes", token[0])
        return token[1].replace('""', '"')

    def number(self) -> float:
        """The next token, a number."""
        token = self._next("a number")
        value = parse_number(token[2] or "")
        if value != value:
            raise self._wrong("a number", token[0])
        return value

    def size(self) -> int:
        """The next token, a number of items."""
        value = self.number()
        if value != int(value) or value < 0:
            raise self._wrong("a number of items", f"{value:g}")
        return int(value)

    def flag(self) -> str:
        """The next token, such as <exists>."""
        return self._next("<exists>")[0]

    def _next(self, wanted: str) -> re.Match[str]:
        token = next(self._found, None)
        if token is None:
            self._before = self._last
            raise self._wrong(wanted, "the end of the file")
        self._before, self._last = self._last, token[0]
        return token

    def _wrong(self, wanted: str, got: str) -> UnreadableFile:
        before, got = (" ".join(text.split())[:40] for text in (self._before, got))
        return UnreadableFile(
            f"no TextGrid: expected {wanted} after {before}, got {got}", file=self.name
        )


def _read_tiers(tokens: _Tokens) -> Iterator[_Tier]:
    kind, what = tokens.string(), tokens.string()
    if kind != "ooTextFile" or what != "TextGrid":
        raise UnreadableFile(
            "expected a TextGrid of Praat (ooTextFile, TextGrid), got "
            f"{kind[:40]}, {what[:40]}; "
            "save it in Praat as text file",
            file=tokens.name,
        )
    tokens.number(), tokens.number()
    if tokens.flag() != "<exists>":
        return
    for _ in range(tokens.size()):
        kind, name = tokens.string(), tokens.string()
        tokens.number(), tokens.number()
        items = []
        for _ in range(tokens.size()):
            start = tokens.number()
            end = tokens.number() if kind == _INTERVALS else start
            items.append((start, end, tokens.string()))
        yield _Tier(kind, name, items)


def write_text_grid(tracks: Iterable[LabelTrack], path: Path, *, excel: bool = False) -> None:
    """Write the track of one recording as a TextGrid; see `write_labels`."""
    track = only_one(list(tracks), path)
    ends = [x.end_s for x in track.labels] + [x.end_s for x in track.unassessed]
    # Praat takes no grid without duration.
    end = max(track.recording.duration_s, *ends, 0.0) or 1.0
    write_text(path, _format(_make_tiers(track, end), end))


def _make_tiers(track: LabelTrack, end: float) -> list[_Tier]:
    long = [label for label in track.labels if label.end_s > label.start_s]
    short = [label for label in track.labels if label.end_s == label.start_s]
    lanes = split_lanes(long)
    if not track.labels:
        lanes = {PLAIN: []}
    tiers = [_Tier(_INTERVALS, name, _fill(labels, end)) for name, labels in lanes.items()]
    for name, labels in split_lanes(short).items():
        items = [(label.start_s, label.start_s, label.name) for label in labels]
        tiers.append(_Tier(_POINTS, name, items))
    if track.unassessed:
        unseen = [Label(UNASSESSED, *segment) for segment in track.unassessed]
        tiers.append(_Tier(_INTERVALS, UNASSESSED, _fill(unseen, end)))
    return tiers


def _fill(labels: Iterable[Label], end: float) -> list[tuple[float, float, str]]:
    """Intervals from 0 to the end, without text where there is no label."""
    items, at = [], 0.0
    for label in labels:
        if label.start_s > at:
            items.append((at, label.start_s, ""))
        items.append((label.start_s, label.end_s, label.name))
        at = label.end_s
    return [*items, (at, end, "")] if at < end or not items else items


def _format(tiers: list[_Tier], end: float) -> Iterator[str]:
    yield 'File type = "ooTextFile"\nObject class = "TextGrid"\n\n'
    yield f"xmin = 0 \nxmax = {end!r} \ntiers? <exists> \nsize = {len(tiers)} \nitem []: \n"
    for number, tier in enumerate(tiers, start=1):
        is_points = tier.kind == _POINTS
        word = "points" if is_points else "intervals"
        yield f'    item [{number}]:\n        class = "{tier.kind}" \n'
        yield f"        name = {_quote(tier.name)} \n        xmin = 0 \n        xmax = {end!r} \n"
        yield f"        {word}: size = {len(tier.items)} \n"
        for i, (start, stop, text) in enumerate(tier.items, start=1):
            yield f"        {word} [{i}]:\n"
            if is_points:
                yield f"            number = {start!r} \n            mark = {_quote(text)} \n"
                continue
            yield f"            xmin = {start!r} \n            xmax = {stop!r} \n"
            yield f"            text = {_quote(text)} \n"


def _quote(text: str) -> str:
    return '"' + text.replace('"', '""') + '"'
