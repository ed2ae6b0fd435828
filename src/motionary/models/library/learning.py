"""A library from a folder of examples: read, looked at, learned, calibrated, queried.

One folder per class; the files in it are its examples. Folders within a class folder are
its prototypes, each with a template of its own. The order of the steps is here, and a
monitor follows them.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from motionary.batch import Failure
from motionary.errors import InvalidInput, MotionaryError, UnreadableFile, check_kind
from motionary.features import (
    FULL_BODY,
    FeatureSequence,
    FeatureSet,
    NamedFile,
    compute_features,
    read_features,
)
from motionary.io import MOTION_SUFFIXES, ReadOptions, format_suffix
from motionary.models.library.advice import advise
from motionary.models.library.assignment import measure_false_rates
from motionary.models.library.calibration import apply_calibrations, calibrate_thresholds
from motionary.models.library.classes import TrainingOptions
from motionary.models.library.cross_validation import N_FOLDS
from motionary.models.library.scoring import scoring_for
from motionary.models.library.storage import ClassLibrary
from motionary.models.library.training import (
    Examples,
    choose_queries,
    find_feature_set,
    learn_classes,
    learn_queries,
    list_sequences,
)
from motionary.motion import Motion


class Notice(NamedTuple):
    """Something in training that a person should know of.

    Attributes
    ----------
    text : a sentence
    is_failure : whether something that was given could not be used
    error : what stopped it; without a monitor it is raised
    file : name and path of the recording that the error is about
    """

    text: str
    is_failure: bool = False
    error: MotionaryError | None = None
    file: NamedFile | None = None


class Monitor(Protocol):
    """Follows training: a screen, a log."""

    def stage(self, name: str, total: int) -> AbstractContextManager[Callable[..., None]]:
        """Context of a stage of so many steps; what it yields is called after each step."""
        ...

    def notify(self, notice: Notice) -> None:
        """Take a notice; whoever raises here ends the training."""
        ...


class StrictMonitor:
    """Shows nothing, and raises the first error."""

    def stage(self, name: str, total: int) -> AbstractContextManager[Callable[..., None]]:
        """Context of a stage that nobody watches."""
        return nullcontext(lambda *_: None)

    def notify(self, notice: Notice) -> None:
        """Raise the error of a notice, if it has one."""
        if notice.error is not None:
            raise notice.error


@dataclass(slots=True)
class ReadExamples:
    """Examples of a folder: class -> prototype -> packed features; and what is unreadable."""

    classes: dict[str, dict[str, list[FeatureSequence]]] = field(default_factory=dict)
    failures: list[Failure[NamedFile]] = field(default_factory=list)


def learn(
    examples: str | Path | Examples | Mapping[str, Sequence[Motion | FeatureSequence]],
    training: TrainingOptions | None = None,
    *,
    negatives: Sequence[FeatureSequence] = (),
    reading: ReadOptions | None = None,
    feature_set: FeatureSet = FULL_BODY,
    jobs: int = 1,
    monitor: Monitor | None = None,
    **options: Any,
) -> ClassLibrary:
    """Library of classes learned from examples.

    In this order: templates, with their mirror images if asked for; thresholds; queries.

    Parameters
    ----------
    examples : a folder with one folder per class; or examples by class name, or by class
        and prototype
    training : how they are trained; the library remembers it
    negatives : other recordings, without any of the classes: thresholds are calibrated and
        scores told against them. Without any, scores are told from the corpus that comes
        with the package.
    reading : what the files do not say themselves
    feature_set : features that are measured
    jobs : processes; the result does not depend on it
    monitor : told what happens. With it, what cannot be used is left out, and examples are
        looked at first (`advise`); without it, the first error is raised.
    **options : fields of `TrainingOptions`, such as `mirror=True`, before those of `training`

    Raises
    ------
    InvalidInput, UnreadableFile
        If there are no examples, examples of a class have nothing in common, or one of
        them cannot be read.
    """
    settings = replace(training or TrainingOptions(), **options)
    watch = monitor or StrictMonitor()
    if isinstance(examples, str | Path):
        nested = _read_folder(Path(examples), reading, feature_set, jobs=jobs, monitor=watch)
    else:
        remedy = "give a folder with one folder per class, or a dict: {'squat': [motion, ...], ...}"
        check_kind(examples, (Mapping,), name="examples", remedy=remedy)
        nested = {name: _by_prototype(name, x, feature_set) for name, x in examples.items()}
    if not nested:
        raise InvalidInput("there are no examples to learn from; give at least one class")
    if monitor is not None:
        for advice in advise(nested, tolerance=settings.tolerance):
            watch.notify(Notice(str(advice)))
    library = _learn_templates(nested, settings, watch, negatives)
    if negatives and library:
        library = measure_false_rates(library, negatives)
    if settings.calibrate and library:
        learned = {name: nested[name] for name in library.names}
        library = calibrate(library, learned, negatives=negatives, jobs=jobs, monitor=watch)
    if settings.queries != "none" and library:
        library = _add_queries(library, nested, settings, jobs=jobs, monitor=watch)
    return library


def calibrate(
    library: ClassLibrary,
    examples: Examples,
    *,
    names: Sequence[str] | None = None,
    negatives: Sequence[FeatureSequence] = (),
    jobs: int = 1,
    monitor: Monitor,
) -> ClassLibrary:
    """Library with thresholds calibrated as its training asks for.

    Parameters
    ----------
    examples : of all classes, which are told from each other
    names : classes that get another threshold; by default all
    """
    training = library.training or TrainingOptions()
    if training.groups and not all(item.source for item in list_sequences(examples)):
        # A library keeps examples without their names.
        how = f"they are dealt at random, not by {training.groups!r}"
        monitor.notify(Notice(f"names of examples are not kept: {how}"))
        training = replace(training, groups=None)
    with monitor.stage("calibrating thresholds", N_FOLDS) as done:
        calibrations = calibrate_thresholds(
            examples, training=training, negatives=negatives, jobs=jobs, on_done=done
        )
    wanted = library.names if names is None else names
    for name in wanted:
        if name not in calibrations:
            kept = f"it stays {library[name].threshold:g}"
            text = f"class {name!r}: too little to calibrate its threshold by; {kept}"
            monitor.notify(Notice(text))
    chosen = {name: one for name, one in calibrations.items() if name in wanted}
    return apply_calibrations(library, chosen)


def read_examples(
    folder: Path,
    *,
    reading: ReadOptions | None = None,
    feature_set: FeatureSet = FULL_BODY,
    jobs: int = 1,
    on_done: Callable[[NamedFile], None] | None = None,
) -> ReadExamples:
    """Packed features of a folder of examples, and the files that could not be read.

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
    """Class, prototype and path of every example below a folder, sorted."""
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


def _read_folder(
    folder: Path,
    reading: ReadOptions | None,
    feature_set: FeatureSet,
    *,
    jobs: int,
    monitor: Monitor,
) -> Examples:
    listed = list_examples(folder)
    with monitor.stage("reading", len(listed)) as done:
        read = read_examples(
            folder, reading=reading, feature_set=feature_set, jobs=jobs, on_done=done
        )
    for failure in read.failures:
        monitor.notify(Notice(str(failure.error), True, failure.error, failure.item))
    for name in sorted({name for name, _, _ in listed} - set(read.classes)):
        text = f"class {name!r}: none of its examples could be read; left out"
        monitor.notify(Notice(text, True))
    stray = sorted(path.name for path in folder.iterdir() if format_suffix(path) in MOTION_SUFFIXES)
    if stray:
        more = f" and {len(stray) - 1} more" if len(stray) > 1 else ""
        hint = "in no class; put examples into a folder named after their class"
        monitor.notify(Notice(f"{stray[0]}{more}: {hint}", True))
    return read.classes


def _by_prototype(
    name: str,
    items: Mapping[str, Sequence[FeatureSequence]] | Sequence[Motion | FeatureSequence],
    feature_set: FeatureSet,
) -> Mapping[str, Sequence[FeatureSequence]]:
    """Packed features of a class by prototype; motions are measured."""
    remedy = "give lists of motions or features; motionary.read reads a file"
    prototypes = items if isinstance(items, Mapping) else {name: items}
    result: dict[str, list[FeatureSequence]] = {}
    for key, given in prototypes.items():
        check_kind(given, (Iterable,), name=f"examples of {key!r}", remedy=remedy)
        result[key] = []
        for one in given:
            check_kind(one, (Motion, FeatureSequence), name=f"an example of {key!r}", remedy=remedy)
            if isinstance(one, Motion):
                one = compute_features(one, feature_set=feature_set)
            result[key].append(one)
    return result


def _learn_templates(
    examples: Examples,
    training: TrainingOptions,
    monitor: Monitor,
    negatives: Sequence[FeatureSequence],
) -> ClassLibrary:
    def refuse(name: str, error: InvalidInput) -> None:
        monitor.notify(Notice(f"class {name!r} is left out: {error}", True, error))

    scoring = scoring_for(find_feature_set(examples), negatives)
    with monitor.stage("learning", len(examples)) as done:
        return learn_classes(
            examples, training=training, scoring=scoring, on_done=done, on_refused=refuse
        )


def _add_queries(
    library: ClassLibrary,
    examples: Examples,
    training: TrainingOptions,
    *,
    jobs: int,
    monitor: Monitor,
) -> ClassLibrary:
    with monitor.stage("keyframes", len(library)) as done:
        if training.queries == "chosen":
            queried = choose_queries(library, examples, on_done=done)
        else:
            runs = training.query_runs
            queried = learn_queries(library, examples, runs=runs, jobs=jobs, on_done=done)
    for name, reason in queried.without.items():
        monitor.notify(Notice(f"class {name!r} has no queries: {reason}"))
    return queried.library
