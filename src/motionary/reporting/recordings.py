"""Pages of recordings: a player over label lanes, curves and features; views of cameras.

Of a motion that was tracked in views what no view tells is drawn as unseen, where it is held to
be. Where images are given they stand behind the body. Lenses are taken for straight: near the
edges of bent images both differ.
"""

import base64
import io
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from motionary.errors import InvalidInput, UnreadableFile, check_kind
from motionary.features import FULL_BODY, FeatureSequence, FeatureSet, compute_features
from motionary.io import match_recording
from motionary.io.cameras import CalibratedCamera, natural
from motionary.labels import Label, LabelTrack
from motionary.models.library import ClassLibrary
from motionary.motion import Motion
from motionary.recording import Recording
from motionary.reporting.contents import (
    PAGE_HZ,
    Lane,
    describe_features,
    describe_recording,
    estimate_bytes,
    make_clip,
    make_curves,
    make_lanes,
    make_strip,
)
from motionary.reporting.html import Block, Page, build_page, check_bytes, check_rate
from motionary.retrieval.annotation import annotate_fully

if TYPE_CHECKING:
    from motionary.multiview import Tracking

#: Labels of some recordings: one track, several, or by the recordings' names.
Tracks = LabelTrack | Iterable[LabelTrack] | Mapping[str, LabelTrack]

#: What a page has of a recording: its poses, its features, or what is known of it.
Shown = Motion | FeatureSequence | Recording
_KINDS = (Motion, FeatureSequence, Recording)

#: A label may end so much later than its recording: tables round.
_SLACK_S = 0.5

_IMAGES = (".jpg", ".jpeg", ".png")
# Images of a page: so many a second, so wide, and so good.
_IMAGE_HZ, _WIDTH, _QUALITY = 10.0, 480, 60
# A point of which views tell less is drawn as unseen.
_SEEN_FROM = 0.05


class _Table(NamedTuple):
    """Labels of some recordings, by their names, under the name of their lane."""

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
    if isinstance(recordings, _KINDS):
        recordings = [recordings]
    given = {"labels": labels, **(lanes or {})}
    tables = [_Table(name, _by_name(one)) for name, one in given.items() if one is not None]
    if truth is not None:
        tables.append(_Table("truth", _by_name(truth), is_truth=True))
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
        content, own, sequence = _describe_shown(shown, feature_set, key=key, rate_hz=rate_hz)
        recording = shown if isinstance(shown, Recording) else shown.recording
        found = _lanes_of(recording, tables, used)
        if library is not None and sequence is not None:
            labelled = annotate_fully(sequence, library)
            found.insert(0, Lane("library", labelled.track))
            n_frames = len(sequence)
            content["curves"], block = make_curves(labelled, library, n_frames=n_frames, key=key)
            own.append(block)
        content["lanes"], whys = make_lanes(found, key=key)
        contents.append(content)
        blocks += [*own, *whys]
    if not contents:
        raise InvalidInput("a page needs at least one recording, got none")
    _check_used(tables, used, [content["name"] for content in contents])
    content = {"features": describe_features(feature_set), "recordings": contents}
    more = f" and {len(contents) - 1} more" if len(contents) > 1 else ""
    title = title or f"{contents[0]['name'] or 'motion'}{more}"
    return build_page(content, blocks, title=title, path=path)


def _by_name(tracks: Tracks) -> dict[str, LabelTrack]:
    """Tracks by the names of their recordings."""
    if isinstance(tracks, Mapping):
        return dict(tracks)
    several = [tracks] if isinstance(tracks, LabelTrack) else tracks
    return {track.recording.name: track for track in several}


def _lanes_of(
    recording: Recording, tables: Sequence[_Table], used: set[tuple[str, str]]
) -> list[Lane]:
    """Lanes of one recording; `used` gets the rows that belong to it."""
    lanes = []
    for table in tables:
        rows = (one for one in table.tracks if match_recording(one, [recording.name]) is not None)
        # One track without a name can only be of this recording.
        row = "" if list(table.tracks) == [""] else next(rows, None)
        track = LabelTrack(recording)
        if row is not None:
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


def _check_used(tables: Sequence[_Table], used: set[tuple[str, str]], names: Sequence[str]) -> None:
    """Refuse a table none of whose recordings is shown."""
    for table in tables:
        if table.tracks and not any((table.name, row) in used for row in table.tracks):
            raise InvalidInput(
                f"{table.name}: these labels are of {', '.join(list(table.tracks)[:3])}, the page "
                f"shows {', '.join(names[:3])}; give labels of the recordings that are shown"
            )


def _feature_set(library: ClassLibrary | None, tables: Sequence[_Table]) -> FeatureSet:
    """The features that reasons are about: of the library, or of the matches behind labels."""
    if library is not None:
        return library.feature_set
    labels = (label for table in tables for track in table.tracks.values() for label in track)
    sets = (one.evidence.sequence.feature_set for one in labels if one.evidence is not None)
    return next(sets, FULL_BODY)


def _describe_shown(
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
        blocks.append(block)
    return content, blocks, sequence


# -- seen through cameras -------------------------------------------------------------------


def report_tracking(
    tracking: "Tracking",
    path: str | Path | None = None,
    *,
    images: str | Path | None = None,
    rate_hz: float = PAGE_HZ,
    title: str = "",
) -> Page:
    """A page that plays what was tracked, from any side and as each camera saw it.

    Parameters
    ----------
    tracking : from `track`
    path : file to write, .html; otherwise `Page.save` does, and notebooks show the page
    images : a folder with a folder for each camera, of its name, that holds a .jpg or .png for
        each frame; they are kept small
    rate_hz : most frames a second that are kept
    title : of the page; by default the recording's name

    Raises
    ------
    InvalidInput
        If images are not as many as frames.
    """
    check_rate(rate_hz)
    motion = tracking.motion
    is_seen = tracking.confidence > _SEEN_FROM
    seen = replace(motion, positions=np.where(is_seen[..., None], motion.positions, np.nan))
    content, blocks = make_clip(motion, key="r0", rate_hz=rate_hz, seen=seen)
    content["strip"], strip = make_strip(compute_features(seen), key="r0")
    content["lanes"], whys = make_lanes(_lanes_of_tracking(tracking), key="r0")
    content["views"] = []
    pictures: list[Block] = []
    for k, (camera, late) in enumerate(zip(tracking.cameras, tracking.offsets, strict=True)):
        own: list[Block] = []
        if images is not None:
            files = _find_images(Path(images) / camera.name, motion.n_frames)
            own = _embed(files, motion.rate_hz, late, key=f"r0-view{k}")
        content["views"].append(_describe_camera(camera, own))
        pictures += own
    return build_page(
        {"features": describe_features(FULL_BODY), "recordings": [content]},
        [*blocks, strip, *whys, *pictures],
        title=title or motion.recording.name or "tracked motion",
        path=path,
    )


def _lanes_of_tracking(tracking: "Tracking") -> list[Lane]:
    """What was recognised, which priors were taken, and where sides were exchanged."""
    recording = tracking.motion.recording
    lanes = []
    if tracking.labels is not None:
        lanes.append(Lane("recognised", tracking.labels))
        taken = tuple(
            Label(one.name, one.first / recording.rate_hz, one.stop / recording.rate_hz)
            for one in tracking.priors
            if one.kept
        )
        lanes.append(Lane("priors taken", LabelTrack(recording, taken)))
    named = tuple(
        replace(one, name=f"{one.name}, {one.extra['camera']}") for one in tracking.exchanges
    )
    return [*lanes, Lane("sides", LabelTrack(recording, named))]


def _describe_camera(camera: CalibratedCamera, images: Sequence[Block]) -> dict[str, Any]:
    """A camera as the page has it: place, axes to the right, up and back, and its lens."""
    across, down, ahead = camera.rotation
    size = camera.size or tuple(2 * camera.matrix[:2, 2])
    return {
        "name": camera.name,
        "place": [round(float(one), 4) for one in camera.position],
        "axes": [[round(float(one), 6) for one in axis] for axis in (across, -down, -ahead)],
        "focal": [float(camera.matrix[0, 0]), float(camera.matrix[1, 1])],
        "centre": [float(one) for one in camera.matrix[:2, 2]],
        "size": [float(one) for one in size],
        "images": [block.name for block in images],
        "images_hz": _IMAGE_HZ,
    }


def _find_images(folder: Path, n_frames: int) -> list[Path]:
    try:
        found = [one for one in folder.iterdir() if one.suffix.lower() in _IMAGES]
    except OSError as error:
        raise UnreadableFile(
            "no folder of images there; give one for each camera, of its name", file=folder
        ) from error
    if len(found) != n_frames:
        raise InvalidInput(
            f"needs an image for each of {n_frames} frames, got {len(found)}", file=folder
        )
    return sorted(found, key=lambda one: natural(one.stem))


def _embed(files: Sequence[Path], rate_hz: float, late: int, *, key: str) -> list[Block]:
    """Small images at the page's rate, each a block of base64."""
    from PIL import Image, UnidentifiedImageError

    blocks = []
    for number in range(int(np.ceil(len(files) / rate_hz * _IMAGE_HZ))):
        frame = min(max(round(number / _IMAGE_HZ * rate_hz) + late, 0), len(files) - 1)
        try:
            with Image.open(files[frame]) as image:
                small = image.convert("RGB")
        except (OSError, UnidentifiedImageError) as error:
            raise UnreadableFile("is no image that can be read", file=files[frame]) from error
        small.thumbnail((_WIDTH, _WIDTH))
        buffer = io.BytesIO()
        small.save(buffer, "JPEG", quality=_QUALITY)
        blocks.append(Block(f"{key}-{number}", base64.b64encode(buffer.getvalue()).decode()))
    return blocks
