"""Which examples of which classes are in a folder?

One folder per class; the files in it are its examples. Folders within a class folder are
its subclasses, each with a template of its own.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from motionary.batch import Failure
from motionary.errors import InvalidInput, UnreadableFile
from motionary.features import FULL_BODY, FeatureSequence, FeatureSet, NamedFile, read_features
from motionary.io import MOTION_SUFFIXES, ReadOptions, format_suffix

#: Words of examples: class -> subclass -> words.
Examples = Mapping[str, Mapping[str, Sequence[FeatureSequence]]]


@dataclass(slots=True)
class ReadExamples:
    """Examples of a folder: class -> subclass -> words; and what could not be read."""

    classes: dict[str, dict[str, list[FeatureSequence]]] = field(default_factory=dict)
    failures: list[Failure[NamedFile]] = field(default_factory=list)


def read_examples(
    folder: Path,
    *,
    reading: ReadOptions | None = None,
    feature_set: FeatureSet = FULL_BODY,
    jobs: int = 1,
    on_done: Callable[[NamedFile], None] | None = None,
) -> ReadExamples:
    """Words of a folder of examples, and the files that could not be read.

    Examples are called by their path below the folder ("squat/one.bvh").
    """
    files = list_examples(folder)
    result = ReadExamples()
    named = [(path.relative_to(folder).as_posix(), path) for _, _, path in files]
    packed = read_features(
        named, options=reading, feature_set=feature_set, jobs=jobs, on_done=on_done
    )
    for (name, prototype, _), item in zip(files, packed, strict=True):
        if isinstance(item, Failure):
            result.failures.append(item)
        else:
            result.classes.setdefault(name, {}).setdefault(prototype, []).append(item)
    return result


def list_examples(folder: Path) -> list[tuple[str, str, Path]]:
    """Class, subclass and path of every example below a folder, sorted."""
    if not folder.is_dir():
        raise UnreadableFile(f"{folder}: no such folder; give a folder with one folder per class")
    files = []
    for path in sorted(folder.rglob("*")):
        parts = path.relative_to(folder).parts
        hidden = any(part.startswith(".") for part in parts)
        is_recording = format_suffix(path) in MOTION_SUFFIXES and path.is_file()
        if is_recording and len(parts) > 1 and not hidden:
            files.append((parts[0], "/".join(parts[1:-1]) or parts[0], path))
    if not files:
        raise UnreadableFile(
            f"{folder}: no examples found; expected one folder per class with files of the "
            f"kinds {', '.join(MOTION_SUFFIXES)}, such as {folder.name}/squat/one.bvh"
        )
    return files


def find_feature_set(examples: Examples) -> FeatureSet:
    """The one set of relations that all examples have.

    Raises
    ------
    InvalidInput
        If they have several.
    """
    sets = {
        item.feature_set.name: item.feature_set
        for prototypes in examples.values()
        for items in prototypes.values()
        for item in items
    }
    if len(sets) > 1:
        raise InvalidInput(f"examples must share one feature set, got {', '.join(sorted(sets))}")
    return next(iter(sets.values()), FULL_BODY)
