"""Labels in tiers: files of ELAN (.eaf, format 3.0) and TextGrids of Praat, long and short.

Conventions: one recording a file. A tier per track, and per lane where labels overlap. ELAN:
names are a controlled vocabulary, times whole milliseconds; the recording's name and rate are
properties of the header, without them it is called as its media, or the file; tiers that refer to
others are left out, and an annotation without text is named after its tier. Praat: the recording
is called as the file; labels without duration stand in a point tier of the same name; as Praat
reads them: strings, flags and numbers that stand free, whatever else is around.
"""

import io
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path, PurePosixPath
from typing import NamedTuple
from urllib.parse import unquote
from xml.etree import ElementTree as ET

from motionary.errors import UnreadableFile, Where
from motionary.files import write_atomically
from motionary.io.formats.numbers import parse_number
from motionary.io.labels.lanes import (
    PLAIN,
    UNASSESSED,
    Found,
    list_unassessed,
    parse_recording,
    split_lanes,
    track_of_lane,
)
from motionary.io.text import parse_xml, read_text, stem_of, write_text
from motionary.labels import Label, LabelTrack
from motionary.recording import Recording, Segment

_SCHEMA = "http://www.mpi.nl/tools/elan/EAFv3.0.xsd"
_INSTANCE = "http://www.w3.org/2001/XMLSchema-instance"
_RECORDING, _RATE, _FRAMES = "motionary.recording", "motionary.rate_hz", "motionary.frames"
_VOCABULARY, _LANGUAGE = "labels", "und"
_LANGUAGE_PLACE = "http://cdb.iso.org/lg/CDB-00130975-001"
# What XML 1.0 cannot hold, not even as a reference.
_NOT_IN_XML = dict.fromkeys(
    [*range(9), 11, 12, *range(14, 32), *range(0xD800, 0xE000), 0xFFFE, 0xFFFF], "�"
)

_INTERVALS, _POINTS = "IntervalTier", "TextTier"
_TOKEN = re.compile(r'"((?:[^"]|"")*)"|(?<!\S)(<\w+>|[-+]?\d[\d.eE+-]*)(?!\S)|(?<!\S)![^\n]*')


def _to_tracks(
    recording: Recording, tiers: Iterable[tuple[str, Iterable[tuple[str, Segment, Where]]]]
) -> dict[str, LabelTrack]:
    """The track of tiers: their names and texts, each with its time and place."""
    tiers, found = list(tiers), Found(recording)
    names = {name for name, _ in tiers}
    for tier, items in tiers:
        track = track_of_lane(tier, names)
        for text, segment, where in items:
            name = None if tier == UNASSESSED else text
            found.add(recording.name, name, segment, where=where, track=track)
    return found.tracks()


# -- ELAN ---------------------------------------------------------------------------------


def read_elan(path: Path) -> dict[str, LabelTrack]:
    """Labels of a file of ELAN; see `read_labels`."""
    root = parse_xml(
        read_text(path),
        file=path.name,
        problem="broken XML",
        refusal="has a document type (<!DOCTYPE ...>), which files of labels do not need and "
        "which may define entities without end; remove it if you know where it comes from",
    )
    if root.tag != "ANNOTATION_DOCUMENT":
        raise UnreadableFile(
            f"expected a file of ELAN (ANNOTATION_DOCUMENT), got <{root.tag[:40]}>", file=path.name
        )
    times = {
        slot.get("TIME_SLOT_ID", ""): slot.get("TIME_VALUE") for slot in root.iter("TIME_SLOT")
    }
    tiers = list(root.iter("TIER"))
    return _to_tracks(
        _read_recording(root, path),
        [(t.get("TIER_ID", ""), _read_annotations(t, times, path.name)) for t in tiers],
    )


def _read_recording(root: ET.Element, path: Path) -> Recording:
    properties = {p.get("NAME"): (p.text or "").strip() for p in root.iter("PROPERTY")}
    media = next(root.iter("MEDIA_DESCRIPTOR"), None)
    url = "" if media is None else media.get("RELATIVE_MEDIA_URL") or media.get("MEDIA_URL") or ""
    name = properties.get(_RECORDING) or PurePosixPath(unquote(url)).name or stem_of(path)
    return parse_recording(name, properties.get(_RATE, ""), properties.get(_FRAMES, ""))


def _read_annotations(
    tier: ET.Element, times: Mapping[str, str | None], file: str
) -> Iterator[tuple[str, Segment, Where]]:
    name = tier.get("TIER_ID", "")
    place = f"tier {name[:40]!r}"
    pairs = []
    for annotation in tier.iter("ALIGNABLE_ANNOTATION"):
        slots = [annotation.get(f"TIME_SLOT_REF{i}", "") for i in (1, 2)]
        lost = [slot for slot in slots if slot not in times]
        if lost:
            raise UnreadableFile(
                f"time slot {lost[0][:40]!r} is nowhere in the file", file=file, place=place
            )
        pairs.append((slots, (annotation.findtext("ANNOTATION_VALUE") or "").strip()))
    where = Where(file=file, place=place)
    at = _fill_times([slot for slots, _ in pairs for slot in slots], times, where)
    for (start, end), text in pairs:
        there = Where(file=file, place=f"{place}, {at[start]:.3f} s")
        yield text or name, Segment(at[start], at[end]), there


def _fill_times(
    slots: list[str], times: Mapping[str, str | None], where: Where
) -> dict[str, float]:
    """Seconds of slots; of those without a time, between their neighbours."""
    slots = list(dict.fromkeys(slots))
    at: dict[str, float] = {}
    open_slots: list[str] = []
    for slot in slots:
        text = times[slot]
        if text is None:
            open_slots.append(slot)
            continue
        if not text.strip().isdecimal():
            raise UnreadableFile(f"times are whole milliseconds, got {text[:40]!r}", **where)
        end = int(text) / 1000
        start = list(at.values())[-1] if at else end
        for i, between in enumerate(open_slots, start=1):
            at[between] = start + (end - start) * i / (len(open_slots) + 1)
        open_slots = []
        at[slot] = end
    return at | dict.fromkeys(open_slots, max(at.values(), default=0.0))


def write_elan(track: LabelTrack, path: Path) -> None:
    """Write the track of one recording for ELAN; see `write_labels`."""
    # A tier without labels, too: a person is to add some.
    lanes = split_lanes(track.labels) or {PLAIN: []}
    slots = _Slots()
    tiers = [_tier(name, labels, slots) for name, labels in lanes.items()]
    if track.unassessed:
        tiers.append(_tier(UNASSESSED, list_unassessed(track), slots, kind=UNASSESSED))
    root = ET.Element(
        "ANNOTATION_DOCUMENT",
        {
            "AUTHOR": "motionary", "DATE": "1970-01-01T00:00:00+00:00", "FORMAT": "3.0",
            "VERSION": "3.0", f"{{{_INSTANCE}}}noNamespaceSchemaLocation": _SCHEMA,
        },
    )  # fmt: skip
    root.append(_header(track.recording, slots))
    root.append(slots.element())
    root.extend(tiers)
    _append_types(root, track.names, has_unassessed=bool(track.unassessed))
    _write_xml(root, path)


class _Slots:
    """Points of time that annotations refer to, each with a number of its own."""

    def __init__(self) -> None:
        self._times_ms: list[int] = []
        self.n_annotations = 0

    def add(self, time_s: float) -> str:
        """The name of a new slot."""
        self._times_ms.append(round(time_s / 1e-3))
        return f"ts{len(self._times_ms)}"

    def element(self) -> ET.Element:
        """All slots, in the sequence of their times as ELAN has them."""
        order = ET.Element("TIME_ORDER")
        numbered = sorted(enumerate(self._times_ms, start=1), key=lambda pair: pair[1])
        for number, time in numbered:
            ET.SubElement(order, "TIME_SLOT", TIME_SLOT_ID=f"ts{number}", TIME_VALUE=str(time))
        return order


def _tier(name: str, labels: Iterable[Label], slots: _Slots, *, kind: str = PLAIN) -> ET.Element:
    tier = ET.Element("TIER", LINGUISTIC_TYPE_REF=kind, TIER_ID=_clean(name))
    for label in labels:
        slots.n_annotations += 1
        annotation = ET.SubElement(
            ET.SubElement(tier, "ANNOTATION"),
            "ALIGNABLE_ANNOTATION",
            ANNOTATION_ID=f"a{slots.n_annotations}",
            TIME_SLOT_REF1=slots.add(label.start_s),
            TIME_SLOT_REF2=slots.add(label.end_s),
        )
        ET.SubElement(annotation, "ANNOTATION_VALUE").text = _clean(label.name)
    return tier


def _header(recording: Recording, slots: _Slots) -> ET.Element:
    header = ET.Element("HEADER", MEDIA_FILE="", TIME_UNITS="milliseconds")
    properties = {_RECORDING: recording.name}
    if recording.rate_hz:
        properties[_RATE] = repr(float(recording.rate_hz))
    if recording.n_frames:
        properties[_FRAMES] = str(recording.n_frames)
    properties["lastUsedAnnotationId"] = str(slots.n_annotations)
    for name, value in properties.items():
        ET.SubElement(header, "PROPERTY", NAME=name).text = _clean(value)
    return header


def _append_types(root: ET.Element, names: Iterable[str], *, has_unassessed: bool) -> None:
    """The kinds of tiers, and the names that labels may have."""
    shared = {"GRAPHIC_REFERENCES": "false", "TIME_ALIGNABLE": "true"}
    named = {"CONTROLLED_VOCABULARY_REF": _VOCABULARY, "LINGUISTIC_TYPE_ID": PLAIN}
    ET.SubElement(root, "LINGUISTIC_TYPE", named | shared)
    if has_unassessed:
        ET.SubElement(root, "LINGUISTIC_TYPE", {"LINGUISTIC_TYPE_ID": UNASSESSED} | shared)
    language = {"LANG_DEF": _LANGUAGE_PLACE, "LANG_ID": _LANGUAGE}
    ET.SubElement(root, "LANGUAGE", language, LANG_LABEL="undetermined (und)")
    vocabulary = ET.SubElement(root, "CONTROLLED_VOCABULARY", CV_ID=_VOCABULARY)
    ET.SubElement(vocabulary, "DESCRIPTION", LANG_REF=_LANGUAGE)
    for number, name in enumerate(names, start=1):
        entry = ET.SubElement(vocabulary, "CV_ENTRY_ML", CVE_ID=f"cve{number}")
        ET.SubElement(entry, "CVE_VALUE", DESCRIPTION="", LANG_REF=_LANGUAGE).text = _clean(name)


def _write_xml(root: ET.Element, path: Path) -> None:
    ET.register_namespace("xsi", _INSTANCE)
    ET.indent(root, "    ")
    content = io.BytesIO()
    ET.ElementTree(root).write(content, encoding="UTF-8", xml_declaration=True)
    with write_atomically(path) as beside:
        beside.write_bytes(content.getvalue() + b"\n")


def _clean(text: str) -> str:
    return text.translate(_NOT_IN_XML)


# -- Praat --------------------------------------------------------------------------------


def read_text_grid(path: Path) -> dict[str, LabelTrack]:
    """Labels of a TextGrid; see `read_labels`."""
    tiers = _read_tiers(_Tokens(read_text(path), path.name))
    return _to_tracks(Recording(stem_of(path)), ((t.name, _texts(t, path.name)) for t in tiers))


class _Tier(NamedTuple):
    kind: str
    name: str
    items: list[tuple[float, float, str]]


def _texts(tier: _Tier, file: str) -> Iterator[tuple[str, Segment, Where]]:
    where = Where(file=file, place=f"tier {tier.name[:40]!r}")
    return ((text, Segment(*times), where) for *times, text in tier.items if text.strip())


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
            f"expected a TextGrid of Praat (ooTextFile, TextGrid), got {kind[:40]}, {what[:40]}; "
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


def write_text_grid(track: LabelTrack, path: Path) -> None:
    """Write the track of one recording as a TextGrid; see `write_labels`."""
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
        tiers.append(_Tier(_INTERVALS, UNASSESSED, _fill(list_unassessed(track), end)))
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
