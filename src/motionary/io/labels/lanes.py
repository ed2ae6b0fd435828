"""What formats of labels have in common: tracks, lanes without overlaps, frames, plain lines.

Conventions: the track of a label (a tier, a subject) is its further column `track`; without
one it is of the track `labels`. Where a format lets nothing overlap within a tier, labels that
overlap go to further lanes, `labels (2)`, and come back as one track. What was not assessed is
a tier of its own, `unassessed`.
"""

import re
from collections.abc import Collection, Iterable
from dataclasses import replace

from motionary.errors import InvalidInput, UnreadableFile, Where
from motionary.io.formats.numbers import parse_number
from motionary.labels import Label, LabelTrack
from motionary.recording import Recording, Segment

#: The further column that says of which track a label is.
TRACK = "track"
#: What labels without a track are put under.
PLAIN = "labels"
UNASSESSED = "unassessed"
#: A line of text that says it.
UNSEEN = f"[{UNASSESSED}]"

_LANE = re.compile(r"(.*) \(([2-9]|[1-9]\d+)\)", re.DOTALL)
_BRACKETS = re.compile(r"\[([^\]]*)\] (.*)", re.DOTALL)
# A name that Windows would refuse in a line of text, or that ends the line.
_BREAKS = re.compile(r"[\x00-\x1f\x7f\x85\u2028\u2029]+")
_SLACK_S = 1e-9


def track_of(label: Label) -> str:
    """The track of a label.

    Raises
    ------
    InvalidInput
        If it has the name of what was not assessed.
    """
    track = label.extra.get(TRACK) or PLAIN
    if track == UNASSESSED:
        raise InvalidInput(
            f"a track cannot be called {UNASSESSED!r}, which stands for what was not seen well "
            "enough; call it otherwise"
        )
    return track


def with_track(track: str) -> dict[str, str]:
    """The further columns that say a track; none for labels that have none."""
    return {} if track in ("", PLAIN) else {TRACK: track}


def split_lanes(labels: Iterable[Label], *, by_name: bool = False) -> dict[str, list[Label]]:
    """Labels by lane, so that within a lane none overlaps another.

    Parameters
    ----------
    labels : sorted by start
    by_name : whether labels of other names may overlap within a lane
    """
    lanes: dict[str, list[Label]] = {}
    taken: set[str] = set()
    ends: dict[tuple[str, str], float] = {}
    for label in labels:
        track, number = track_of(label), 1
        lane = track
        while ends.get(key := (lane, label.name if by_name else ""), -1.0) > label.start_s:
            number += 1
            lane = f"{track} ({number})"
        ends[key] = max(label.end_s, ends.get(key, 0.0))
        lanes.setdefault(lane, []).append(label)
        taken.add(track)
    clash = sorted((set(lanes) - taken) & {track_of(label) for label in labels})
    if clash:
        raise InvalidInput(f"the track {clash[0]!r} has the name of a lane; call it otherwise")
    return lanes


def track_of_lane(lane: str, lanes: Collection[str]) -> str:
    """The track that a lane belongs to."""
    parts = _LANE.fullmatch(lane)
    return parts[1] if parts and parts[1] in lanes else lane


def join_track(label: Label) -> str:
    """A label and its track as one line: `walk`, or `[left hand] walk`."""
    name, track = plain_line(label.name), plain_line(track_of(label))
    if track == PLAIN:
        # What begins so would be read as a track.
        return f"[] {name}" if name.startswith("[") else name
    if "]" in track:
        raise InvalidInput(f"a track cannot have a bracket in its name here, got {track!r}")
    return f"[{track}] {name}"


def part_track(text: str) -> tuple[str, str]:
    """The track, empty without one, and the name of a line."""
    parts = _BRACKETS.fullmatch(text)
    return (parts[1], parts[2]) if parts and parts[2] else ("", text)


def plain_line(text: str) -> str:
    """Text without line breaks and other control characters."""
    return _BREAKS.sub(" ", text).strip() or "?"


class Found:
    """Labels as a file says them, by recording, in any sequence.

    Parameters
    ----------
    recordings : what is known of recordings; each of them has a track
    """

    def __init__(self, *recordings: Recording) -> None:
        self.recordings = {recording.name: recording for recording in recordings}
        self._labels: dict[str, list[Label]] = {}
        self._unassessed: dict[str, list[Segment]] = {}

    def add(
        self, recording: str, name: str | None, segment: Segment, *, where: Where, track: str = ""
    ) -> None:
        """Add a label, or without a name a segment that was not assessed.

        Raises
        ------
        UnreadableFile
            If it makes no sense; `where` it stands is said.
        """
        try:
            if name is None:
                self.add_unassessed(recording, segment)
            else:
                self.add_label(recording, Label(name, *segment, extra=with_track(track)))
        except InvalidInput as error:
            raise UnreadableFile(str(error), **where) from error

    def add_line(self, recording: str, text: str, segment: Segment, where: Where) -> None:
        """Add what a line says: `walk`, `[left hand] walk`, or `[unassessed]`."""
        track, name = part_track(text)
        self.add(recording, None if text == UNSEEN else name or "?", segment, where=where,
                 track=track)  # fmt: skip

    def add_label(self, recording: str, label: Label) -> None:
        """Add a label that is one already."""
        self._labels.setdefault(recording, []).append(label)

    def add_unassessed(self, recording: str, segment: Segment) -> None:
        """Add a segment that was not assessed; its times are checked as those of labels."""
        Label(UNASSESSED, *segment)
        self._unassessed.setdefault(recording, []).append(segment)

    def tracks(self) -> dict[str, LabelTrack]:
        """Tracks by recording, sorted."""
        return {
            name: LabelTrack(
                self.recordings.get(name, Recording(name)),
                tuple(self._labels.get(name, ())),
                tuple(sorted(self._unassessed.get(name, ()))),
            )
            for name in sorted({*self.recordings, *self._labels, *self._unassessed})
        }


def parse_recording(name: str, rate_hz: str, n_frames: str) -> Recording:
    """A recording by texts of its rate and length; what is no number is unknown."""
    rate = parse_number(rate_hz)
    return Recording(
        name,
        rate_hz=rate if 0 < rate < float("inf") else 0.0,
        n_frames=int(n_frames) if n_frames.isdecimal() else 0,
    )


def list_unassessed(track: LabelTrack) -> list[Label]:
    """Segments that were not assessed, as labels."""
    return [Label(UNASSESSED, *segment) for segment in track.unassessed]


def put_on_frames(track: LabelTrack, rate_hz: float, resolution_s: float) -> LabelTrack:
    """Times that a format rounded, on the frames that they were of.

    Times further from a frame than the format's resolution explains stay.
    """

    def put(time_s: float) -> float:
        on_frame = round(time_s * rate_hz) / rate_hz
        is_near = abs(on_frame - time_s) <= resolution_s / 2 + _SLACK_S
        return on_frame if is_near else time_s

    labels = (replace(x, start_s=put(x.start_s), end_s=put(x.end_s)) for x in track.labels)
    unassessed = tuple(Segment(put(start), put(end)) for start, end in track.unassessed)
    return replace(track, labels=tuple(labels), unassessed=unassessed)
