"""Labels of the motions in a recording.

The annotation procedure of Müller, Baak and Seidel (2009), section 4: per frame the class whose
modified distance function is least; runs of one class, extended while the class's own function
does not rise. The other assignment ranks matches by what they tell and not by what they cost.
Both are those of `labelling`.

Conventions: frames are those of the sequence, at 30 Hz, 0-based; ties go to the earlier class.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any, Literal, NamedTuple, get_args

from motionary.batch import Failure, Workers, map_ordered
from motionary.errors import InvalidInput, check_kind
from motionary.features import FeatureSequence, compute_features
from motionary.labels import LabelTrack
from motionary.matching import SKIP_WEIGHT
from motionary.models.library import (
    THRESHOLD,
    Candidates,
    ClassLibrary,
    find_candidates,
    load_everyday,
    thresholds_for,
)
from motionary.motion import Motion
from motionary.packing import count
from motionary.recording import Segment, find_runs
from motionary.retrieval.explanation import ASSESSED_FROM
from motionary.retrieval.index import Collection, Index, Portion
from motionary.retrieval.labelling import (
    ClassDistance,
    class_distance,
    describe_cheapest,
    label_by_costs,
    label_by_scores,
)

#: How labels are assigned: by scores, or by costs as published in 2009.
Assignment = Literal["scores", "published"]


class Annotation(NamedTuple):
    """Labels of one recording, and what they were assigned by.

    Attributes
    ----------
    track : the labels
    distances : of each class of the library, by its name; empty where scores decided
    candidates : scored matches; None where costs decided
    """

    track: LabelTrack
    distances: dict[str, ClassDistance]
    candidates: Candidates | None = None


def annotate(
    recording: Motion | FeatureSequence,
    library: ClassLibrary | None = None,
    *,
    assignment: Assignment | None = None,
    threshold: float | None = None,
    at_most_false_per_min: float | None = None,
    preselect: bool = True,
    skip_weight: float = SKIP_WEIGHT,
) -> LabelTrack:
    """Labels of one recording.

    Parameters
    ----------
    recording : Motion or FeatureSequence
    library : classes to look for; by default the library of everyday motion that ships
    assignment : by scores, or by costs as published; by default as `default_assignment` says,
        and by costs where `threshold` is given alone
    threshold : by scores, the least score of a label, by default the library's; by costs,
        the largest cost of a match, by default each class's own
    at_most_false_per_min : by scores: choose the threshold by so many expected false labels
        a minute
    preselect : by costs: whether classes that have keyframes are looked for only around them
    skip_weight : by costs: how often the cell after a (2, 1) step counts

    Returns
    -------
    LabelTrack; each label carries the evidence that `explain` reads

    Raises
    ------
    InvalidInput
        If the library is empty, has another feature set, or lacks what scores need.
    """
    return annotate_fully(
        recording, library, assignment=assignment, threshold=threshold,
        at_most_false_per_min=at_most_false_per_min, preselect=preselect, skip_weight=skip_weight,
    ).track  # fmt: skip


def annotate_fully(
    recording: Motion | FeatureSequence,
    library: ClassLibrary | None = None,
    *,
    assignment: Assignment | None = None,
    threshold: float | None = None,
    at_most_false_per_min: float | None = None,
    preselect: bool = True,
    skip_weight: float = SKIP_WEIGHT,
) -> Annotation:
    """Labels of one recording and what they were assigned by; otherwise as `annotate`."""
    library = load_everyday() if library is None else library
    sequence = _sequence_of(recording, library)
    if assignment is None and at_most_false_per_min is not None:
        assignment = "scores"
    if assignment is None:
        assignment = "published" if threshold is not None else default_assignment(library)
    _check_assignment(assignment, threshold, at_most_false_per_min)
    distance = partial(class_distance, sequence, threshold=threshold, skip_weight=skip_weight)
    distances: dict[str, ClassDistance] = {}
    candidates = None
    if assignment == "published":
        distances = {one.name: distance(one, preselect=preselect) for one in library}
        labels, nearest = label_by_costs(sequence, list(distances.values())), ""
        if not labels:
            everywhere = [
                distance(one, preselect=False) if one.has_queries else distances[one.name]
                for one in library
            ]
            limits = [one.threshold if threshold is None else threshold for one in library]
            nearest = describe_cheapest(sequence, everywhere, limits)
    else:
        least = thresholds_for(library, at_most_false_per_min, given=threshold)
        candidates = find_candidates(sequence, library)
        labels, nearest = label_by_scores(sequence, library, candidates, limits=least)
        if not labels and not nearest:
            everywhere = [class_distance(sequence, one, preselect=False) for one in library]
            nearest = describe_cheapest(sequence, everywhere, [None] * len(library))
    track = LabelTrack(sequence.recording, labels, unassessed(sequence), nearest)
    return Annotation(track, distances, candidates)


def annotate_collection(
    recordings: Collection | Index,
    library: ClassLibrary | None = None,
    *,
    assignment: Assignment | None = None,
    threshold: float | None = None,
    at_most_false_per_min: float | None = None,
    preselect: bool = True,
    explainable: bool = False,
    jobs: Workers = 1,
) -> Iterator[LabelTrack]:
    """Labels of many recordings out of their features; the recordings are not read.

    Parameters
    ----------
    recordings : an index, or a collection of features, over those of the library, or over the
        everyday set for a library over the published ones
    library, assignment, threshold, at_most_false_per_min, preselect : as of `annotate`
    explainable : whether labels carry the evidence that `explain` reads, the features of their
        recording; of an archive that is much to hold, and to be sent by processes
    jobs : who labels: processes, or a cluster whose workers see the index under the same path

    Yields
    ------
    LabelTrack of each recording, sorted by name; the same whoever labels

    Raises
    ------
    InvalidInput
        As of `annotate`.
    Unreachable
        If a cluster is gone.
    """
    library = load_everyday() if library is None else library
    collection = _collection_of(recordings, library)
    label = partial(
        _label_one, library=library, explainable=explainable, assignment=assignment,
        threshold=threshold, at_most_false_per_min=at_most_false_per_min, preselect=preselect,
    )  # fmt: skip
    if jobs == 1:
        return map(label, collection.sequences)
    return _label_portions(label, collection, jobs)


def _label_one(
    sequence: FeatureSequence, *, library: ClassLibrary, explainable: bool, **options: Any
) -> LabelTrack:
    track = annotate(sequence, library, **options)
    if explainable:
        return track
    return replace(track, labels=tuple(replace(one, evidence=None) for one in track))


def _label_portions(
    label: Callable[[FeatureSequence], LabelTrack], collection: Collection, jobs: Workers
) -> Iterator[LabelTrack]:
    for tracks in map_ordered(
        partial(_label_portion, label=label), collection.portions(), jobs=jobs
    ):
        if isinstance(tracks, Failure):
            raise tracks.error
        yield from tracks


def _label_portion(
    portion: Portion, *, label: Callable[[FeatureSequence], LabelTrack]
) -> list[LabelTrack]:
    return [label(sequence) for sequence in portion.open()]


def _collection_of(recordings: Collection | Index, library: ClassLibrary) -> Collection:
    """Features of recordings over those of a library, if they lead their own."""
    remedy = "Index.open(folder), or motionary.retrieval.index.collect(folder)"
    check_kind(recordings, (Collection, Index), name="recordings", remedy=remedy)
    _check_library(library, "annotate_collection(index, ClassLibrary.load(folder))")
    collection = recordings if isinstance(recordings, Collection) else recordings.collection()
    for one in (collection, collection.published):
        if one.feature_set.ids == library.feature_set.ids:
            return one
    raise InvalidInput(
        f"the library is over {library.feature_set.name!r}, the recordings over "
        f"{collection.feature_set.name!r}; open an index elsewhere with "
        "feature_set=library.feature_set, and update it",
        file=recordings.place if isinstance(recordings, Index) else "",
    )


def default_assignment(library: ClassLibrary) -> Assignment:
    """By scores, unless the library has none or was made to label by costs.

    It was where a class has keyframes to be looked for around, or a threshold of costs of
    its own: calibrated, or given.
    """
    by_costs = any(
        one.threshold != THRESHOLD or one.estimated_precision is not None or one.has_queries
        for one in library
    )
    return "published" if by_costs or not library.has_scores else "scores"


def _check_assignment(
    assignment: str, threshold: float | None, at_most_false_per_min: float | None
) -> None:
    if assignment not in get_args(Assignment):
        raise InvalidInput(
            f"assignment must be one of {', '.join(get_args(Assignment))}, got {assignment!r}"
        )
    if at_most_false_per_min is not None:
        if assignment == "published":
            raise InvalidInput(
                "costs do not tell how many false labels to expect; at_most_false_per_min needs "
                "assignment='scores'"
            )
        if threshold is not None:
            raise InvalidInput("threshold or at_most_false_per_min: give one, not both")


def unassessed(sequence: FeatureSequence) -> tuple[Segment, ...]:
    """Segments in which fewer than half of the features are known."""
    known = count(sequence.known) / len(sequence.feature_set)
    return tuple(
        sequence.segment(start, stop) for start, stop in find_runs(known < ASSESSED_FROM).tolist()
    )


def _sequence_of(recording: Motion | FeatureSequence, library: ClassLibrary) -> FeatureSequence:
    check_kind(
        recording,
        (Motion, FeatureSequence),
        name="recording",
        remedy="read files first, and annotate one after the other: "
        "[annotate(read(path), library) for path in paths]",
    )
    _check_library(library, "annotate(recording, ClassLibrary.load(folder))")
    if isinstance(recording, Motion):
        return compute_features(recording, feature_set=library.feature_set)
    if recording.feature_set.name != library.feature_set.name:
        raise InvalidInput(
            f"features of {recording.feature_set.name!r}, but the library "
            f"uses {library.feature_set.name!r}; compute them with feature_set=",
            file=recording.source,
        )
    return recording


def _check_library(library: ClassLibrary, call: str) -> None:
    check_kind(library, (ClassLibrary,), name="library", remedy=f"it comes second: {call}")
    if not library:
        raise InvalidInput("the library has no classes, so there is nothing to look for")
