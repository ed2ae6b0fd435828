"""How are classes learned from examples?

One folder per class; the files in it are its examples. Folders within a class folder are
its subclasses, each with a template of its own.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from motionary.batch import Failure
from motionary.errors import InvalidInput, UnreadableFile
from motionary.features import (
    FULL_BODY,
    FeatureSequence,
    FeatureSet,
    NamedFile,
    Reading,
    compute_features,
    read_features,
)
from motionary.io import MOTION_SUFFIXES
from motionary.keyframes import mirror_query
from motionary.library.classes import (
    THRESHOLD,
    TOLERANCE,
    ClassLibrary,
    MotionClass,
    Subclass,
)
from motionary.matching import concatenate, share_of_ones
from motionary.motion import Motion
from motionary.templates import learn_template
from motionary.templates import mirror as mirror_template
from motionary.words import full_mask

#: Examples of one class, by the name of the subclass.
Examples = Mapping[str, Sequence[Motion | FeatureSequence]]


@dataclass(frozen=True, slots=True)
class Teaching:
    """Settings of learned classes.

    Attributes
    ----------
    threshold, tolerance : of the classes; defaults of the publications of 2006 and 2009
    mirror : also learn the mirror image of every template, as a subclass
    by_surprise : whether relations that are rare among the examples weigh more; False
        weighs all alike, as published
    provenance, licence : written into the library
    """

    threshold: float = THRESHOLD
    tolerance: float = TOLERANCE
    mirror: bool = False
    by_surprise: bool = True
    provenance: str = ""
    licence: str = ""


@dataclass(slots=True)
class ReadExamples:
    """Examples of a folder: class -> subclass -> words; and what could not be read."""

    classes: dict[str, dict[str, list[FeatureSequence]]] = field(default_factory=dict)
    failures: list[Failure[NamedFile]] = field(default_factory=list)


def learn(
    examples: str | Path | Mapping[str, Sequence[Motion | FeatureSequence]],
    *,
    mirror: bool = False,
    teaching: Teaching | None = None,
    reading: Reading | None = None,
    jobs: int = 1,
) -> ClassLibrary:
    """Library of classes learned from examples.

    Parameters
    ----------
    examples : a folder with one folder per class, or examples by class name
    mirror : also learn every class's mirror image, as a subclass of the same name
    teaching : further settings
    reading : what the files do not say themselves
    jobs : processes that read

    Raises
    ------
    InvalidInput, UnreadableFile
        If there are no examples, or one of them cannot be read.
    """
    settings = teaching or Teaching(mirror=mirror)
    if isinstance(examples, str | Path):
        read = read_examples(Path(examples), reading=reading, jobs=jobs)
        if read.failures:
            raise read.failures[0].error
        nested = {name: dict(subclasses) for name, subclasses in read.classes.items()}
    else:
        nested = {name: {name: _sequences(items)} for name, items in examples.items()}
    return learn_classes(nested, teaching=settings)


def learn_classes(
    examples: Mapping[str, Mapping[str, Sequence[FeatureSequence]]],
    *,
    teaching: Teaching,
    on_done: Callable[[], None] | None = None,
) -> ClassLibrary:
    """Library learned from words: class -> subclass -> examples."""
    classes = []
    feature_set = _feature_set(examples)
    background = _background(examples, feature_set, teaching)
    for name, subclasses in examples.items():
        learned = [_learn_subclass(key, items) for key, items in subclasses.items()]
        if teaching.mirror:
            learned += [_mirrored(subclass, feature_set) for subclass in learned]
        classes.append(
            MotionClass(name, tuple(learned), teaching.threshold, teaching.tolerance, background)
        )
        if on_done:
            on_done()
    return ClassLibrary(tuple(classes), feature_set, teaching.provenance, teaching.licence)


def read_examples(
    folder: Path,
    *,
    reading: Reading | None = None,
    jobs: int = 1,
    on_done: Callable[[NamedFile], None] | None = None,
) -> ReadExamples:
    """Words of a folder of examples, and the files that could not be read."""
    files = list_examples(folder)
    result = ReadExamples()
    named = [(path.name, path) for _, _, path in files]
    words = read_features(named, reading=reading, jobs=jobs, on_done=on_done)
    for (name, subclass, _), item in zip(files, words, strict=True):
        if isinstance(item, Failure):
            result.failures.append(item)
        else:
            result.classes.setdefault(name, {}).setdefault(subclass, []).append(item)
    return result


def list_examples(folder: Path) -> list[tuple[str, str, Path]]:
    """Class, subclass and path of every example below a folder, sorted."""
    if not folder.is_dir():
        raise UnreadableFile(f"{folder}: no such folder; give a folder with one folder per class")
    files = []
    for path in sorted(folder.rglob("*")):
        parts = path.relative_to(folder).parts
        hidden = any(part.startswith(".") for part in parts)
        is_recording = path.suffix.lower() in MOTION_SUFFIXES and path.is_file()
        if is_recording and len(parts) > 1 and not hidden:
            files.append((parts[0], "/".join(parts[1:-1]) or parts[0], path))
    if not files:
        raise UnreadableFile(
            f"{folder}: no examples found; expected one folder per class with files of the "
            f"kinds {', '.join(MOTION_SUFFIXES)}, such as {folder.name}/squat/one.bvh"
        )
    return files


def _sequences(items: Sequence[Motion | FeatureSequence]) -> list[FeatureSequence]:
    return [i if isinstance(i, FeatureSequence) else compute_features(i) for i in items]


def _feature_set(examples: Mapping[str, Mapping[str, Sequence[FeatureSequence]]]) -> FeatureSet:
    sets = {
        item.feature_set.name: item.feature_set
        for subclasses in examples.values()
        for items in subclasses.values()
        for item in items
    }
    if len(sets) > 1:
        raise InvalidInput(f"examples must share one feature set, got {', '.join(sorted(sets))}")
    return next(iter(sets.values()), FULL_BODY)


def _background(
    examples: Mapping[str, Mapping[str, Sequence[FeatureSequence]]],
    feature_set: FeatureSet,
    teaching: Teaching,
) -> tuple[float, ...]:
    """Share of the examples' frames in which each relation holds; empty if all weigh alike."""
    sequences = [s for subclasses in examples.values() for i in subclasses.values() for s in i]
    if not teaching.by_surprise or not sequences:
        return ()
    words, known = [s.words for s in sequences], [s.known for s in sequences]
    corpus = concatenate(words, known, full=full_mask(1, len(feature_set))[0])
    ones = share_of_ones(corpus, len(feature_set))
    if teaching.mirror:
        ones = (ones + ones[feature_set.mirror_order]) / 2
    return tuple(round(float(share), 6) for share in np.clip(ones, 1e-6, 1 - 1e-6))


def _learn_subclass(name: str, examples: Sequence[FeatureSequence]) -> Subclass:
    if not examples:
        raise InvalidInput(f"class {name!r} needs at least one example, got none")
    feature_set = examples[0].feature_set
    every = all(bool(e.known_features.all()) for e in examples)
    template = learn_template(
        [e.features for e in examples],
        known=None if every else [e.known_features.astype(np.bool_) for e in examples],
        feature_names=feature_set.ids,
        feature_set=feature_set.name,
        provenance=f"learned from {len(examples)} recordings",
    )
    return Subclass(name, template)


def _mirrored(subclass: Subclass, feature_set: FeatureSet) -> Subclass:
    template = mirror_template(subclass.template, feature_set.mirror_order)
    query = None if subclass.query is None else mirror_query(subclass.query, feature_set)
    return Subclass(f"{subclass.name}Mirrored", template, query)
