"""The page of one or several recordings: a player over label lanes, curves and features."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from motionary import __version__
from motionary.errors import InvalidInput, check_kind
from motionary.features import FULL_BODY, compute_features
from motionary.io import match_recording
from motionary.labels import Label, LabelTrack
from motionary.models.library import ClassLibrary
from motionary.motion import GENERIC_JOINTS, Motion
from motionary.reporting.clips import PAGE_HZ, make_clip
from motionary.reporting.encoding import UNIT_M, Block
from motionary.reporting.html import build_page, write_page
from motionary.reporting.lanes import Lane, describe_features, make_curves, make_lanes, make_strip
from motionary.retrieval.annotation import annotate

#: Labels of some recordings: one track, several, or by the recordings' names.
Tracks = LabelTrack | Iterable[LabelTrack] | Mapping[str, LabelTrack]

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
    recordings: Motion | Iterable[Motion],
    path: str | Path,
    *,
    labels: Tracks | None = None,
    truth: Tracks | None = None,
    lanes: Mapping[str, Tracks] | None = None,
    library: ClassLibrary | None = None,
    rate_hz: float = PAGE_HZ,
    title: str = "",
) -> None:
    """Write a page that plays recordings over their labels; it opens without a network.

    Parameters
    ----------
    recordings : one or several; iterables are read one after the other
    path : the file, .html
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
    page = build_report(
        recordings, labels=labels, truth=truth, lanes=lanes, library=library, rate_hz=rate_hz,
        title=title,
    )  # fmt: skip
    write_page(page, path)


def build_report(
    recordings: Motion | Iterable[Motion],
    *,
    labels: Tracks | None = None,
    truth: Tracks | None = None,
    lanes: Mapping[str, Tracks] | None = None,
    library: ClassLibrary | None = None,
    rate_hz: float = PAGE_HZ,
    title: str = "",
) -> str:
    """The page of `report` as text."""
    if not 1 <= rate_hz <= MOST_HZ:
        raise InvalidInput(f"rate_hz must be from 1 to {MOST_HZ:g}, got {rate_hz}")
    if isinstance(recordings, Motion):
        recordings = [recordings]
    given = {"labels": labels, **(lanes or {})}
    tables = [LabelTable(name, by_name(one)) for name, one in given.items() if one is not None]
    if truth is not None:
        tables.append(LabelTable("truth", by_name(truth), is_truth=True))
    contents: list[dict[str, Any]] = []
    blocks: list[Block] = []
    used: set[tuple[str, str]] = set()
    for number, motion in enumerate(recordings):
        check_kind(motion, (Motion,), name="recordings", remedy="read files first")
        found = _lanes_of(motion, tables, used)
        content, own = _describe(motion, found, library, key=f"r{number}", rate_hz=rate_hz)
        contents.append(content)
        blocks += own
    if not contents:
        raise InvalidInput("a page needs at least one recording, got none")
    _check_used(tables, used, [content["name"] for content in contents])
    feature_set = FULL_BODY if library is None else library.feature_set
    page = {
        "version": __version__,
        "unit_m": UNIT_M,
        "joints": GENERIC_JOINTS,
        "features": describe_features(feature_set),
        "recordings": contents,
    }
    return build_page(page, blocks, title=title or _title(contents))


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
    motion: Motion, tables: Sequence[LabelTable], used: set[tuple[str, str]]
) -> list[Lane]:
    """Lanes of one recording; `used` gets the rows that belong to it."""
    lanes = []
    for table in tables:
        # One track without a name can only be of this recording.
        row = "" if list(table.tracks) == [""] else None
        for name in table.tracks:
            if row is None and match_recording(name, [motion.source]) is not None:
                row = name
        if row is None:
            lanes.append(Lane(table.name, LabelTrack(motion.recording), table.is_truth))
            continue
        used.add((table.name, row))
        track = table.tracks[row]
        _check_within(track, motion, table.name)
        lanes.append(Lane(table.name, track, table.is_truth))
    return lanes


def _check_within(track: LabelTrack, motion: Motion, table: str) -> None:
    late = [label for label in track if label.end_s > motion.duration_s + _SLACK_S]
    if late:
        label: Label = max(late, key=lambda one: one.end_s)
        raise InvalidInput(
            f"{table}: {label.name!r} ends at {label.end_s:.2f} s, but {motion.source or 'motion'} "
            f"has {motion.duration_s:.2f} s; give the labels of this recording"
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


def _describe(
    motion: Motion, lanes: Sequence[Lane], library: ClassLibrary | None, *, key: str, rate_hz: float
) -> tuple[dict[str, Any], list[Block]]:
    """What the page has of one recording."""
    content, blocks = make_clip(motion, key=key, rate_hz=rate_hz)
    found = list(lanes)
    if motion.mapping is not None:
        feature_set = FULL_BODY if library is None else library.feature_set
        sequence = compute_features(motion, feature_set=feature_set)
        content["strip"], block = make_strip(sequence, key=key)
        blocks.append(block)
        if library is not None:
            track = annotate(sequence, library)
            found.insert(0, Lane("library", track))
            curves = make_curves(sequence, library, track, key=key)
            if curves:
                content["curves"] = curves[0]
                blocks.append(curves[1])
    content["lanes"], whys = make_lanes(found, key=key)
    return content, [*blocks, *whys]
