"""The page of one or several recordings: a player over label lanes, curves and features."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from motionary.errors import InvalidInput, check_kind
from motionary.features import FULL_BODY, FeatureSequence, FeatureSet, compute_features
from motionary.io import match_recording
from motionary.labels import Label, LabelTrack
from motionary.models.library import ClassLibrary
from motionary.motion import Motion
from motionary.recording import Recording
from motionary.reporting.clips import PAGE_HZ, describe_recording, estimate_bytes, make_clip
from motionary.reporting.html import Block, Page, build_page, check_bytes
from motionary.reporting.lanes import Lane, describe_features, make_curves, make_lanes, make_strip
from motionary.retrieval.annotation import annotate_fully

#: Labels of some recordings: one track, several, or by the recordings' names.
Tracks = LabelTrack | Iterable[LabelTrack] | Mapping[str, LabelTrack]

#: What a page has of a recording: its poses, its features, or what is known of it.
Shown = Motion | FeatureSequence | Recording
_KINDS = (Motion, FeatureSequence, Recording)

#: Further frames a second tell nothing to eyes, and fill the page.
MOST_HZ = 240.0
#: A label may end so much later than its recording: tables round.
_SLACK_S = 0.5


class LabelTable(NamedTuple):
    """Labels of some recordings under the name of their lane.

    Attributes
    ----------
    name : of the lane
    tracks : by the name of the recording
    is_truth : whether the others are compared with it
    """

    name: str
    tracks: dict[str, LabelTrack]
    is_truth: bool = False


def report(
    recordings: Shown | Iterable[Shown],
    path: str | Path | None = None,
    *,
    labels: Tracks | None = None,
    truth: Tracks | None = None,
    lanes: Mapping[str, Tracks] | None = None,
    library: ClassLibrary | None = None,
    rate_hz: float = PAGE_HZ,
    title: str = "",
) -> Page:
    """A page that plays recordings over their labels; it opens without a network.

    Parameters
    ----------
    recordings : one or several; iterables are read one after the other. Of features, or of a
        recording that is known by name alone, labels are shown without a body
    path : file to write, .html; otherwise `Page.save` does, and notebooks show the page
    labels : found or made, of any of the recordings, matched by name
    truth : true labels
    lanes : further labels, by the name of their lane
    library : classes that each recording is labelled with, in a lane of its own; labels then
        say why, and curves stand below them
    rate_hz : most frames a second that are kept
    title : of the page; by default the recordings' names

    Raises
    ------
    InvalidInput
        If there is no recording, labels belong to none of them or end after it, or the page
        would be larger than browsers open.
    UnwritableFile
        If the file cannot be written; what was there before stays.
    """
    check_rate(rate_hz)
    if isinstance(recordings, Motion | FeatureSequence | Recording):
        recordings = [recordings]
    given = {"labels": labels, **(lanes or {})}
    tables = [LabelTable(name, by_name(one)) for name, one in given.items() if one is not None]
    if truth is not None:
        tables.append(LabelTable("truth", by_name(truth), is_truth=True))
    feature_set = _feature_set(library, tables)
    contents: list[dict[str, Any]] = []
    blocks: list[Block] = []
    used: set[tuple[str, str]] = set()
    for number, shown in enumerate(recordings):
        check_kind(shown, _KINDS, name="recordings", remedy="read files first")
        key = f"r{number}"
        if isinstance(shown, Motion):
            # Of a folder too large for a page one learns so at once, not when memory is full.
            n_bytes = sum(len(block.text) for block in blocks)
            check_bytes(n_bytes + estimate_bytes(shown, rate_hz=rate_hz))
        content, own, sequence = describe_shown(shown, feature_set, key=key, rate_hz=rate_hz)
        recording = shown if isinstance(shown, Recording) else shown.recording
        found = _lanes_of(recording, tables, used)
        if library is not None and sequence is not None:
            found.insert(0, _label(sequence, library, content, own, key=key))
        content["lanes"], whys = make_lanes(found, key=key)
        contents.append(content)
        blocks += [*own, *whys]
    if not contents:
        raise InvalidInput("a page needs at least one recording, got none")
    _check_used(tables, used, [content["name"] for content in contents])
    content = {"features": describe_features(feature_set), "recordings": contents}
    page = build_page(content, blocks, title=title or _title(contents))
    if path is not None:
        page.save(path)
    return page


def check_rate(rate_hz: float) -> None:
    """Raise InvalidInput unless a page can keep so many frames a second."""
    if not 1 <= rate_hz <= MOST_HZ:
        raise InvalidInput(f"rate_hz must be from 1 to {MOST_HZ:g}, got {rate_hz}")


def by_name(tracks: Tracks) -> dict[str, LabelTrack]:
    """Tracks by the names of their recordings."""
    if isinstance(tracks, Mapping):
        return dict(tracks)
    several = [tracks] if isinstance(tracks, LabelTrack) else tracks
    return {track.recording.name: track for track in several}


def _title(contents: Sequence[Mapping[str, Any]]) -> str:
    more = f" and {len(contents) - 1} more" if len(contents) > 1 else ""
    return f"{contents[0]['name'] or 'motion'}{more}"


def _lanes_of(
    recording: Recording, tables: Sequence[LabelTable], used: set[tuple[str, str]]
) -> list[Lane]:
    """Lanes of one recording; `used` gets the rows that belong to it."""
    lanes = []
    for table in tables:
        # One track without a name can only be of this recording.
        row = "" if list(table.tracks) == [""] else None
        for name in table.tracks:
            if row is None and match_recording(name, [recording.name]) is not None:
                row = name
        if row is None:
            lanes.append(Lane(table.name, LabelTrack(recording), table.is_truth))
            continue
        used.add((table.name, row))
        track = table.tracks[row]
        _check_within(track, recording, table.name)
        lanes.append(Lane(table.name, track, table.is_truth))
    return lanes


def _check_within(track: LabelTrack, recording: Recording, table: str) -> None:
    late = [label for label in track if label.end_s > recording.duration_s + _SLACK_S]
    if late:
        label: Label = max(late, key=lambda one: one.end_s)
        raise InvalidInput(
            f"{label.name!r} ends at {label.end_s:.2f} s, but "
            f"{recording.name or 'motion'} has {recording.duration_s:.2f} s; give the labels of "
            "this recording",
            file=table,
        )


def _check_used(
    tables: Sequence[LabelTable], used: set[tuple[str, str]], names: Sequence[str]
) -> None:
    """Refuse a table none of whose recordings is shown."""
    for table in tables:
        if table.tracks and not any((table.name, row) in used for row in table.tracks):
            raise InvalidInput(
                f"{table.name}: these labels are of {', '.join(list(table.tracks)[:3])}, the page "
                f"shows {', '.join(names[:3])}; give labels of the recordings that are shown"
            )


def _feature_set(library: ClassLibrary | None, tables: Sequence[LabelTable]) -> FeatureSet:
    """The features that reasons are about: of the library, or of the matches behind labels."""
    if library is not None:
        return library.feature_set
    labels = (label for table in tables for track in table.tracks.values() for label in track)
    sets = (one.evidence.sequence.feature_set for one in labels if one.evidence is not None)
    return next(sets, FULL_BODY)


def describe_shown(
    shown: Shown, feature_set: FeatureSet, *, key: str, rate_hz: float
) -> tuple[dict[str, Any], list[Block], FeatureSequence | None]:
    """What the page has of one recording but its labels, and its features."""
    blocks: list[Block] = []
    sequence: FeatureSequence | None = None
    if isinstance(shown, Motion):
        content, blocks = make_clip(shown, key=key, rate_hz=rate_hz)
        if shown.mapping is not None:
            sequence = compute_features(shown, feature_set=feature_set)
    else:
        content = describe_recording(shown if isinstance(shown, Recording) else shown.recording)
        if isinstance(shown, FeatureSequence) and shown.feature_set.ids == feature_set.ids:
            sequence = shown
    if sequence is not None:
        content["strip"], block = make_strip(sequence, key=key)
        blocks = [*blocks, block]
    return content, blocks, sequence


def _label(
    sequence: FeatureSequence,
    library: ClassLibrary,
    content: dict[str, Any],
    blocks: list[Block],
    *,
    key: str,
) -> Lane:
    """The lane of a library; its curves go into content and blocks."""
    found = annotate_fully(sequence, library)
    content["curves"], block = make_curves(found, library, n_frames=len(sequence), key=key)
    blocks.append(block)
    return Lane("library", found.track)
