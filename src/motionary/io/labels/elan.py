"""Labels in files of ELAN (.eaf), format 3.0 of the Max Planck Institute's annotation tool.

Conventions: one recording a file. A tier per track, and per lane where labels overlap; their
names are a controlled vocabulary. Times are whole milliseconds. The recording's name and rate
are properties of the header; without them the recording is called as its media, or the file.
Tiers that refer to others are left out. An annotation without text is named after its tier.
"""

import io
from collections.abc import Iterable, Iterator, Mapping
from itertools import count
from pathlib import Path, PurePosixPath
from urllib.parse import unquote
from xml.etree import ElementTree as ET

from motionary.errors import UnreadableFile, Where
from motionary.files import write_atomically
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
from motionary.io.text import read_text, stem_of
from motionary.labels import Label, LabelTrack
from motionary.recording import Recording, Segment

RESOLUTION_S = 1e-3

_SCHEMA = "http://www.mpi.nl/tools/elan/EAFv3.0.xsd"
_INSTANCE = "http://www.w3.org/2001/XMLSchema-instance"
_RECORDING, _RATE, _FRAMES = "motionary.recording", "motionary.rate_hz", "motionary.frames"
_VOCABULARY, _LANGUAGE = "labels", "und"
_LANGUAGE_PLACE = "http://cdb.iso.org/lg/CDB-00130975-001"
# What XML 1.0 cannot hold, not even as a reference.
_NOT_IN_XML = {
    **dict.fromkeys([*range(9), 11, 12, *range(14, 32), 0xFFFE, 0xFFFF], "�"),
    **dict.fromkeys(range(0xD800, 0xE000), "�"),
}


def parse_xml(text: str, name: str) -> ET.Element:
    """The root of an XML text that defines no entities.

    Raises
    ------
    UnreadableFile
        If it is broken, or has a document type, by which a few bytes grow to gigabytes or
        other files are read.
    """
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise UnreadableFile(
            "has a document type (<!DOCTYPE ...>), which files of labels do not need and "
            "which may define entities without end; remove it if you know where it comes from",
            file=name,
        )
    try:
        return ET.fromstring(text)
    except ET.ParseError as error:
        raise UnreadableFile(f"broken XML: {error}", file=name) from error


def read_elan(path: Path, *, rate_hz: float | None = None) -> dict[str, LabelTrack]:
    """Labels of a file of ELAN; see `read_labels`."""
    root = parse_xml(read_text(path), path.name)
    if root.tag != "ANNOTATION_DOCUMENT":
        raise UnreadableFile(
            f"expected a file of ELAN (ANNOTATION_DOCUMENT), got <{root.tag[:40]}>", file=path.name
        )
    recording = _read_recording(root, path)
    times = {
        slot.get("TIME_SLOT_ID", ""): slot.get("TIME_VALUE") for slot in root.iter("TIME_SLOT")
    }
    names = {tier.get("TIER_ID", "") for tier in root.iter("TIER")}
    labels, unassessed = [], []
    for tier in root.iter("TIER"):
        name = tier.get("TIER_ID", "")
        where = Where(file=path.name, place=f"tier {name[:40]!r}")
        for text, segment in _read_annotations(tier, times, where):
            if name == UNASSESSED:
                unassessed.append((recording.name, segment))
                continue
            track = track_of_lane(name, names)
            at = Where(file=path.name, place=f"tier {name[:40]!r}, {segment.start_s:.3f} s")
            label = make_label(text or name, *segment, where=at, track=track)
            labels.append((recording.name, label))
    return build_tracks(labels, unassessed, {recording.name: recording})


def _read_recording(root: ET.Element, path: Path) -> Recording:
    properties = {p.get("NAME"): (p.text or "").strip() for p in root.iter("PROPERTY")}
    media = next(root.iter("MEDIA_DESCRIPTOR"), None)
    url = "" if media is None else media.get("RELATIVE_MEDIA_URL") or media.get("MEDIA_URL") or ""
    name = properties.get(_RECORDING) or PurePosixPath(unquote(url)).name or stem_of(path)
    rate = parse_number(properties.get(_RATE, ""))
    frames = properties.get(_FRAMES, "")
    return Recording(
        name,
        rate_hz=rate if 0 < rate < float("inf") else 0.0,
        n_frames=int(frames) if frames.isdecimal() else 0,
    )


def _read_annotations(
    tier: ET.Element, times: Mapping[str, str | None], where: Where
) -> Iterator[tuple[str, Segment]]:
    pairs = []
    for annotation in tier.iter("ALIGNABLE_ANNOTATION"):
        slots = [annotation.get(f"TIME_SLOT_REF{i}", "") for i in (1, 2)]
        lost = [slot for slot in slots if slot not in times]
        if lost:
            raise UnreadableFile(f"time slot {lost[0][:40]!r} is nowhere in the file", **where)
        value = annotation.find("ANNOTATION_VALUE")
        pairs.append((slots, "" if value is None else (value.text or "").strip()))
    at = _fill_times([slot for slots, _ in pairs for slot in slots], times, where)
    for (start, end), text in pairs:
        yield text, Segment(at[start], at[end])


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


def write_elan(tracks: Iterable[LabelTrack], path: Path, *, excel: bool = False) -> None:
    """Write the track of one recording for ELAN; see `write_labels`."""
    track = only_one(list(tracks), path)
    # A tier without labels, too: a person is to add some.
    lanes = split_lanes(track.labels) or {PLAIN: []}
    slots = _Slots()
    tiers = [_tier(name, labels, slots) for name, labels in lanes.items()]
    if track.unassessed:
        unseen = [Label(UNASSESSED, *segment) for segment in track.unassessed]
        tiers.append(_tier(UNASSESSED, unseen, slots, kind=UNASSESSED))
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
        self.annotations = count(1)

    def add(self, time_s: float) -> str:
        """The name of a new slot."""
        self._times_ms.append(round(time_s / RESOLUTION_S))
        return f"ts{len(self._times_ms)}"

    @property
    def n_annotations(self) -> int:
        """Annotations so far."""
        return len(self._times_ms) // 2

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
        annotation = ET.SubElement(
            ET.SubElement(tier, "ANNOTATION"),
            "ALIGNABLE_ANNOTATION",
            ANNOTATION_ID=f"a{next(slots.annotations)}",
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
    ET.SubElement(
        root,
        "LINGUISTIC_TYPE",
        {"CONTROLLED_VOCABULARY_REF": _VOCABULARY, "LINGUISTIC_TYPE_ID": PLAIN, **shared},
    )
    if has_unassessed:
        ET.SubElement(root, "LINGUISTIC_TYPE", {"LINGUISTIC_TYPE_ID": UNASSESSED, **shared})
    ET.SubElement(
        root,
        "LANGUAGE",
        LANG_DEF=_LANGUAGE_PLACE,
        LANG_ID=_LANGUAGE,
        LANG_LABEL="undetermined (und)",
    )
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
