"""Examples of classes: files of a folder, labelled parts of recordings, motions and arrays.

In a folder, there is a folder per class, and the files in it are its examples; folders within
a class folder are its prototypes. Labels give parts of recordings as examples of the classes
that they name; a further column `person` says who moves. What people do on either side is brought
to one before it is averaged.

Conventions: parts are cut from the features of the whole recording, at 30 Hz.
"""

import itertools
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from motionary.batch import Failure
from motionary.errors import InvalidInput, MotionaryError, UnreadableFile, check_kind
from motionary.features import (
    FULL_BODY,
    SEQUENCE_HZ,
    FeatureSequence,
    FeatureSet,
    NamedFile,
    compute_features,
    read_features,
)
from motionary.io import (
    MOTION_SUFFIXES,
    ReadOptions,
    explain_unmatched,
    format_suffix,
    match_recording,
    name_recordings,
    read_labels,
    split_files,
)
from motionary.labels import Label, LabelTrack, of_recording
from motionary.matching import Pattern, distance_function
from motionary.motion import Motion
from motionary.packing import pack, unpack

#: What recordings are measured from.
Measurable = Motion | FeatureSequence | ArrayLike
#: Paths of recordings, or the recordings themselves by name.
Recordings = str | Path | Sequence[str | Path] | Mapping[str, Measurable]

#: A file of labels, or their tracks.
Labels = str | Path | LabelTrack | Iterable[LabelTrack] | Mapping[str, LabelTrack]

#: The further column of labels that says who moves.
PERSON = "person"

_MOST_ROUNDS = 10
# An end of a match counts as that of the whole in this last part of a sequence.
_LAST_PART = 4
# What `check_kind` names: motions and features are told before.
_ARRAYS = (Motion, FeatureSequence, np.ndarray, list)


@dataclass(slots=True)
class ReadExamples:
    """Examples: class -> prototype -> packed features; and what is unreadable.

    Attributes
    ----------
    classes : the examples
    failures : recordings that could not be read
    unusable : why labels, or all of a recording's, give no example
    """

    classes: dict[str, dict[str, list[FeatureSequence]]] = field(default_factory=dict)
    failures: list[Failure[NamedFile]] = field(default_factory=list)
    unusable: list[MotionaryError] = field(default_factory=list)

    def add(self, name: str, prototype: str, example: FeatureSequence) -> None:
        """Add an example."""
        self.classes.setdefault(name, {}).setdefault(prototype, []).append(example)


# -- folders ------------------------------------------------------------------------------


def read_examples(
    folder: Path,
    *,
    reading: ReadOptions | None = None,
    feature_set: FeatureSet = FULL_BODY,
    jobs: int = 1,
    on_done: Callable[[NamedFile], None] | None = None,
    listed: Sequence[tuple[str, str, Path]] | None = None,
) -> ReadExamples:
    """Packed features of a folder of examples, and the files that could not be read.

    Examples are called by their path below the folder ("squat/one.bvh"). `listed` are those of
    `list_examples`, which opens files that may hold several recordings.
    """
    split = reading is None or reading.take is None
    files = list_examples(folder, split=split) if listed is None else listed
    result = ReadExamples()
    named = [(path.relative_to(folder).as_posix(), path) for _, _, path in files]
    packed = read_features(
        named, options=reading, feature_set=feature_set, jobs=jobs, on_done=on_done
    )
    for (name, prototype, _), item in zip(files, packed, strict=True):
        if isinstance(item, Failure):
            result.failures.append(item)
        else:
            result.add(name, prototype, item)
    return result


def list_examples(folder: Path, *, split: bool = True) -> list[tuple[str, str, Path]]:
    """Class, prototype and path of every example below a folder, sorted.

    Of files with several recordings each is one, unless `split` is false.
    """
    if not folder.is_dir():
        why = "is no folder" if folder.exists() else "no such folder"
        raise UnreadableFile(
            f"{why}; give a folder with one folder per class, or a table of labels with "
            "the recordings that they are of",
            file=folder,
        )
    files = []
    for path in sorted(folder.rglob("*")):
        parts = path.relative_to(folder).parts
        hidden = any(part.startswith(".") for part in parts)
        is_recording = format_suffix(path) in MOTION_SUFFIXES and path.is_file()
        if is_recording and len(parts) > 1 and not hidden:
            takes = split_files({"": path}) if split else {"": path}
            files += [(parts[0], "/".join(parts[1:-1]) or parts[0], p) for p in takes.values()]
    if not files:
        raise UnreadableFile(
            "no examples found; expected one folder per class with files of the "
            f"kinds {', '.join(MOTION_SUFFIXES)}, such as {folder.name}/squat/one.bvh",
            file=folder,
        )
    return files


# -- labels of recordings -----------------------------------------------------------------


def read_labelled(
    labels: Labels,
    recordings: Recordings,
    *,
    reading: ReadOptions | None = None,
    feature_set: FeatureSet = FULL_BODY,
    jobs: int = 1,
    on_done: Callable[[NamedFile], None] | None = None,
) -> ReadExamples:
    """Packed features of labelled parts of recordings, by the names of the labels.

    Examples are called by their recording and times ("take.bvh 1.20-3.40 s").

    Parameters
    ----------
    labels : a file in any format of labels, or tracks
    reading, feature_set, jobs, on_done : as of `read_examples`; arrays take rate and skeleton
        from `reading`

    Raises
    ------
    InvalidInput
        If there is no label.
    UnreadableFile
        If the labels cannot be read, or there is no recording where one is looked for.
    """
    tracks = [track for track in list_tracks(labels, reading) if len(track)]
    if not tracks:
        raise InvalidInput("there are no labels to learn from")
    sequences = find_sequences(
        tracks, recordings, reading=reading, feature_set=feature_set, jobs=jobs, on_done=on_done
    )
    result = ReadExamples(failures=sequences.failures, unusable=sequences.unusable)
    for track, sequence in sequences.pairs:
        for label in track:
            try:
                result.add(label.name, label.name, cut_example(sequence, label))
            except InvalidInput as error:
                result.unusable.append(error)
    return result


def list_tracks(labels: Labels, reading: ReadOptions | None = None) -> list[LabelTrack]:
    """Tracks of a file of labels, or as they are given."""
    if isinstance(labels, str | Path):
        labels = read_labels(labels, rate_hz=reading.rate_hz if reading else None)
    if isinstance(labels, LabelTrack):
        return [labels]
    return list(labels.values() if isinstance(labels, Mapping) else labels)


@dataclass(slots=True)
class LabelledSequences:
    """Labelled recordings with their features.

    Attributes
    ----------
    pairs : a track of each, which fits the recording, and its features
    failures : recordings that could not be read
    unusable : why tracks have no recording, or do not fit theirs
    """

    pairs: list[tuple[LabelTrack, FeatureSequence]] = field(default_factory=list)
    failures: list[Failure[NamedFile]] = field(default_factory=list)
    unusable: list[MotionaryError] = field(default_factory=list)


def find_sequences(
    tracks: Sequence[LabelTrack],
    recordings: Recordings,
    *,
    reading: ReadOptions | None = None,
    feature_set: FeatureSet = FULL_BODY,
    jobs: int = 1,
    on_done: Callable[[NamedFile], None] | None = None,
) -> LabelledSequences:
    """Features of the recordings of tracks; others are not read."""
    result = LabelledSequences()
    done: Iterator[FeatureSequence | Failure[NamedFile]]
    if isinstance(recordings, Mapping):
        found = _match(tracks, recordings, result)
        how: dict[str, Any] = {"feature_set": feature_set, "reading": reading}
        done = (
            measure(recordings[name], name=f"recording {name!r}", **how).renamed(name)
            for _, name in found
        )
    else:
        split = reading is None or reading.take is None
        files = name_recordings(recordings, split=split)
        found = _match(tracks, files, result)
        named = [(name, files[name]) for _, name in found]
        done = read_features(
            named, options=reading, feature_set=feature_set, jobs=jobs, on_done=on_done
        )
    for (track, _), sequence in zip(found, done, strict=True):
        if isinstance(sequence, Failure):
            result.failures.append(sequence)
            continue
        try:
            result.pairs.append((of_recording(track, sequence.recording), sequence))
        except InvalidInput as error:
            result.unusable.append(error)
    return result


def cut_example(sequence: FeatureSequence, label: Label) -> FeatureSequence:
    """The labelled part of a recording, with the person that the label knows.

    A label without duration, or outside of the recording, is refused.
    """
    start = max(round(label.start_s * SEQUENCE_HZ), 0)
    stop = min(round(label.end_s * SEQUENCE_HZ), len(sequence))
    called = f"{sequence.source} {label.start_s:.2f}-{label.end_s:.2f} s"
    if stop <= start:
        raise InvalidInput(f"{called} ({label.name}): too short for an example; left out")
    part = sequence.part(start, stop)
    person = label.extra.get(PERSON) or sequence.recording.person
    return replace(part, recording=replace(part.recording, name=called, person=person))


def measure(
    recording: Measurable,
    *,
    name: str,
    feature_set: FeatureSet = FULL_BODY,
    reading: ReadOptions | None = None,
) -> FeatureSequence:
    """Features of a motion, or of an array whose rate and skeleton `reading` gives."""
    if isinstance(recording, FeatureSequence):
        return recording
    if isinstance(recording, Motion):
        return compute_features(recording, feature_set=feature_set)
    remedy = "give motions, features or arrays; motionary.read reads a file"
    check_kind(recording, _ARRAYS, name=name, remedy=remedy)
    options = reading or ReadOptions()
    skeleton = None if options.skeleton is None else str(options.skeleton)
    return compute_features(
        recording, rate_hz=options.rate_hz, skeleton=skeleton, feature_set=feature_set
    )


def _match(
    tracks: Sequence[LabelTrack], known: Collection[str], result: LabelledSequences
) -> list[tuple[LabelTrack, str]]:
    """Tracks and their recordings' names; those without one are noted as unusable."""
    named = [(track, match_recording(track.recording.name, known)) for track in tracks]
    without = [track.recording.name for track, name in named if name is None]
    result.unusable += map(InvalidInput, explain_unmatched(without, known))
    return [(track, name) for track, name in named if name is not None]


# -- sides --------------------------------------------------------------------------------


def fold_sides(examples: Sequence[FeatureSequence]) -> list[FeatureSequence]:
    """The examples of a class, each as it is or as its mirror image; most stay as they are.

    Of a motion that people do on either side, such as a lunge, examples have little in common.
    Each is taken as it fits the others best: starting from no change, sides are exchanged one at
    a time until none gains.
    """
    flipped = [mirror_sequence(example) for example in examples]
    n = len(examples)
    gain = np.zeros((n, n))
    for i, j in itertools.combinations(range(n), 2):
        same = _difference(examples[j], examples[i])
        gain[i, j] = gain[j, i] = _difference(examples[j], flipped[i]) - same
    side = np.ones(n)
    for _ in range(_MOST_ROUNDS):
        before = side.copy()
        for i in range(n):
            vote = float((gain[i] * side).sum())
            if vote:
                side[i] = np.sign(vote)
        if np.array_equal(side, before):
            break
    if side.sum() < 0:
        side = -side
    return [one if s > 0 else other for one, other, s in zip(examples, flipped, side, strict=True)]


def mirror_sequence(sequence: FeatureSequence) -> FeatureSequence:
    """Features of the mirror image of a recording."""
    feature_set = sequence.feature_set
    packed, known = (
        pack(unpack(integers, len(feature_set))[:, feature_set.mirror_order])
        for integers in (sequence.packed, sequence.known)
    )
    return replace(sequence, packed=packed, known=known)


def _difference(first: FeatureSequence, second: FeatureSequence) -> float:
    """Mean cost of matching each sequence as a whole in the other."""
    return (_cost(first, second) + _cost(second, first)) / 2


def _cost(pattern: FeatureSequence, target: FeatureSequence) -> float:
    asked = Pattern(pattern.packed & pattern.known, pattern.known, np.ones(len(pattern)))
    distance = distance_function(asked, target.packed, target.known)
    last = distance[-max(1, len(target) // _LAST_PART) :]
    # Where none fits, by its length, all that is asked for fails.
    return min(float(last.min()), 1.0)
