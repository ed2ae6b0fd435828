"""A library from examples: read, looked at, learned, calibrated, queried.

The order of the steps is here, and a monitor follows them.
"""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from motionary.errors import InvalidInput, MotionaryError, check_kind
from motionary.features import FULL_BODY, FeatureSequence, FeatureSet, NamedFile
from motionary.io import MOTION_SUFFIXES, ReadOptions, format_suffix
from motionary.io.labels import FORMATS
from motionary.labels import LabelTrack
from motionary.models.library.advice import advise
from motionary.models.library.assignment import measure_false_rates
from motionary.models.library.calibration import apply_calibrations, calibrate_thresholds
from motionary.models.library.classes import TrainingOptions
from motionary.models.library.examples import (
    ReadExamples,
    Recordings,
    list_examples,
    list_tracks,
    measure,
    read_examples,
    read_labelled,
)
from motionary.models.library.scoring import scoring_for
from motionary.models.library.storage import ClassLibrary
from motionary.models.library.training import (
    N_FOLDS,
    Examples,
    choose_queries,
    find_feature_set,
    learn_classes,
    learn_queries,
    list_sequences,
)

# C3D and tables may hold labels as well as points.
_OF_LABELS = frozenset(suffix for form in FORMATS for suffix in form.suffixes)


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


def learn(
    examples: str | Path | LabelTrack | Sequence[LabelTrack] | Mapping[str, Any],
    training: TrainingOptions | None = None,
    *,
    recordings: Recordings | None = None,
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
    examples : a folder with one folder per class; a file in any format of labels, whose
        times are examples of the classes they name; label tracks, one or several; or
        motions, features or arrays of positions by class name, or by class and prototype
    training : how they are trained; the library remembers it
    recordings : those of the labels: files and folders, or motions, features or arrays by
        name; by default the folder that holds the file of labels
    negatives : other recordings, without any of the classes: thresholds are calibrated and
        scores told against them. Without any, scores are told from the corpus that comes
        with the package.
    reading : what the files, and arrays, do not say themselves
    feature_set : features that are measured
    jobs : processes; the result does not depend on it
    monitor : told what happens. With it, what cannot be used is left out, and examples are
        looked at first (`advise`); without it, the first error is raised.
    **options : fields of `TrainingOptions` and `ReadOptions`, such as `mirror=True` or
        `rate_hz=60, skeleton="smpl"`, before those of `training` and `reading`

    Raises
    ------
    InvalidInput, UnreadableFile
        If there are no examples, examples of a class have nothing in common, or one of
        them cannot be read.
    """
    names = {one.name for one in fields(ReadOptions)} & options.keys()
    reading = replace(reading or ReadOptions(), **{name: options.pop(name) for name in names})
    settings = replace(training or TrainingOptions(), **options)
    watch = monitor or StrictMonitor()
    nested = _read(examples, recordings, reading, feature_set, jobs=jobs, monitor=watch)
    if not nested:
        raise InvalidInput("there are no examples to learn from; give at least one class")
    if monitor is not None:
        for advice in advise(nested, tolerance=settings.tolerance):
            watch.notify(Notice(str(advice)))

    def refuse(name: str, error: InvalidInput) -> None:
        watch.notify(Notice(f"class {name!r} is left out: {error}", True, error))

    scoring = scoring_for(find_feature_set(nested), negatives)
    with watch.stage("learning", len(nested)) as done:
        library = learn_classes(
            nested, training=settings, scoring=scoring, on_done=done, on_refused=refuse
        )
    if negatives and library:
        library = measure_false_rates(library, negatives)
    if settings.calibrate and library:
        learned = {name: nested[name] for name in library.names}
        library = calibrate(library, learned, negatives=negatives, jobs=jobs, monitor=watch)
    if settings.queries == "none" or not library:
        return library
    with watch.stage("keyframes", len(library)) as done:
        if settings.queries == "chosen":
            queried = choose_queries(library, nested, on_done=done)
        else:
            runs = settings.query_runs
            queried = learn_queries(library, nested, runs=runs, jobs=jobs, on_done=done)
    for name, reason in queried.without.items():
        watch.notify(Notice(f"class {name!r} has no queries: {reason}"))
    return queried.library


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


def _read(
    examples: Any,
    recordings: Recordings | None,
    reading: ReadOptions,
    feature_set: FeatureSet,
    *,
    jobs: int,
    monitor: Monitor,
) -> Examples:
    """Examples in whichever way they are given."""
    measured: Any = {"reading": reading, "feature_set": feature_set}
    if _is_labels(examples):
        tracks = list_tracks(examples, reading)
        if recordings is None and not isinstance(examples, str | Path):
            raise InvalidInput(
                "labels without a file need the recordings that they are of (recordings=)"
            )
        recordings = Path(examples).parent if recordings is None else recordings
        with monitor.stage("reading", sum(len(track) > 0 for track in tracks)) as done:
            read = read_labelled(tracks, recordings, jobs=jobs, on_done=done, **measured)
        _report(read, {label.name for track in tracks for label in track}, monitor)
        return read.classes
    if recordings is not None:
        raise InvalidInput("recordings go with labels of their times; examples are whole files")
    if isinstance(examples, str | Path):
        folder = Path(examples)
        listed = list_examples(folder, split=reading.take is None)
        with monitor.stage("reading", len(listed)) as done:
            read = read_examples(folder, listed=listed, jobs=jobs, on_done=done, **measured)
        _report(read, {name for name, _, _ in listed}, monitor)
        _report_stray(folder, monitor)
        return read.classes
    remedy = "give a folder with one folder per class, or a dict: {'squat': [motion, ...], ...}"
    check_kind(examples, (Mapping,), name="examples", remedy=remedy)
    return {name: _by_prototype(name, x, **measured) for name, x in examples.items()}


def _by_prototype(name: str, items: Any, **measured: Any) -> Mapping[str, list[FeatureSequence]]:
    """Packed features of a class by prototype; motions and arrays are measured."""
    remedy = "give lists of motions, features or arrays; motionary.read reads a file"
    prototypes = items if isinstance(items, Mapping) else {name: items}
    for key, given in prototypes.items():
        check_kind(given, (Iterable,), name=f"examples of {key!r}", remedy=remedy)
    return {
        key: [measure(one, name=f"an example of {key!r}", **measured) for one in given]
        for key, given in prototypes.items()
    }


def _is_labels(examples: object) -> bool:
    if isinstance(examples, str | Path):
        return Path(examples).is_file() and format_suffix(examples) in _OF_LABELS
    items = examples.values() if isinstance(examples, Mapping) else examples
    if isinstance(items, LabelTrack):
        return True
    if isinstance(items, Collection) and len(items):
        return all(isinstance(one, LabelTrack) for one in items)
    return False


def _report(read: ReadExamples, names: Collection[str], monitor: Monitor) -> None:
    """Notify of what could not be read, and of classes that are left without examples."""
    for failure in read.failures:
        monitor.notify(Notice(str(failure.error), True, failure.error, failure.item))
    for error in read.unusable:
        monitor.notify(Notice(str(error), True, error))
    for name in sorted(set(names) - set(read.classes)):
        text = f"class {name!r}: none of its examples could be read; left out"
        monitor.notify(Notice(text, True))


def _report_stray(folder: Path, monitor: Monitor) -> None:
    """Notify of recordings that are in no class."""
    stray = sorted(path.name for path in folder.iterdir() if format_suffix(path) in MOTION_SUFFIXES)
    if stray:
        more = f" and {len(stray) - 1} more" if len(stray) > 1 else ""
        hint = "in no class; put examples into a folder named after their class"
        monitor.notify(Notice(f"{stray[0]}{more}: {hint}", True))
