"""Assignment of labels by scores: scored matches of all classes, and which of them to keep.

Every warping path that ends in a local minimum of a template's distance function gets a
score, the log-likelihood ratio of its frames (see `matching.path_scores`). Of those above
the library's threshold, or their class's own, the compatible ones of the largest total are
chosen, each decided a bounded time after its end (see `matching.scheduling`).

Conventions: frames are those of the sequence, at 30 Hz, half-open.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motionary.errors import InvalidInput
from motionary.features import SEQUENCE_HZ, FeatureSequence
from motionary.matching import (
    CellRatios,
    Intervals,
    Pattern,
    SchedulingSettings,
    ScoredPaths,
    choose_causally,
    intervals,
    join_states,
    score_patterns,
)
from motionary.models.library.scoring import FalseRates, fit_false_rates, fit_probability
from motionary.models.library.storage import ClassLibrary

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

_MOST_GAP = SchedulingSettings().most_gap_s * SEQUENCE_HZ
# Rates of false labels are fitted from so far below the least score of a class on.
_BELOW = 1.0
_FRAMES_A_MINUTE = 60 * SEQUENCE_HZ


class PrototypePlace(NamedTuple):
    """A prototype by the numbers of its class and of itself in the class."""

    class_index: int
    prototype_index: int


class Candidates(NamedTuple):
    """Scored matches of all classes in one recording.

    Attributes
    ----------
    paths : extents and scores; `paths.patterns` are indices into `places`
    places : prototype of each pattern
    """

    paths: ScoredPaths
    places: tuple[PrototypePlace, ...]

    @property
    def classes(self) -> Indices:
        """Index of each match's class."""
        of_pattern = np.array([place.class_index for place in self.places], dtype=np.intp)
        return of_pattern[self.paths.patterns]

    def place_of(self, index: int) -> PrototypePlace:
        """Prototype of one match."""
        return self.places[int(self.paths.patterns[index])]


class JudgedLabel(NamedTuple):
    """A label of some score, and whether it is right."""

    name: str
    score: float
    is_right: bool


def find_candidates(sequence: FeatureSequence, library: ClassLibrary) -> Candidates:
    """Scored matches of all prototypes in one recording.

    Raises InvalidInput if the library has no priors.
    """
    check_has_scores(library)
    places: list[PrototypePlace] = []
    patterns: list[Pattern] = []
    ratios: list[CellRatios] = []
    for i, one in enumerate(library):
        places += [PrototypePlace(i, j) for j in range(len(one.prototypes))]
        patterns += [pattern for _, pattern in one.patterns]
        ratios += one.ratios
    known = None if sequence.known_features.all() else sequence.known
    return Candidates(score_patterns(patterns, ratios, sequence.packed, known), tuple(places))


def choose_candidates(
    candidates: Candidates, library: ClassLibrary, *, threshold: ArrayLike
) -> Indices:
    """Indices of the matches that become labels, by end; one threshold, or one a class."""
    scoring = library.scoring
    look_ahead_s = scoring.look_ahead_s if scoring else 0.0
    matches = as_intervals(candidates, library, threshold=threshold)
    chosen = choose_causally(matches, look_ahead=look_ahead_s * SEQUENCE_HZ)
    return np.asarray(chosen, dtype=np.intp)


def as_intervals(
    candidates: Candidates, library: ClassLibrary, *, threshold: ArrayLike
) -> Intervals:
    """Matches as intervals that compete, of what they score above the threshold."""
    masks = np.array([one.parts_mask for one in library], dtype=np.int64)
    least = np.broadcast_to(np.asarray(threshold, dtype=np.float64), len(library))
    paths, classes = candidates.paths, candidates.classes
    return intervals(paths.starts, paths.stops, paths.scores - least[classes], masks[classes])


def join_matches(
    candidates: Candidates, library: ClassLibrary, chosen: Indices, *, threshold: ArrayLike
) -> list[list[int]]:
    """Places in `chosen` of the matches of each label: of a state several may be one."""
    if not len(chosen):
        return []
    starts, ends, values, parts = as_intervals(candidates, library, threshold=threshold)
    classes = candidates.classes[chosen]
    is_state = np.array([one.kind == "state" for one in library])[classes]
    of_label = join_states(
        Intervals(starts[chosen], ends[chosen], values[chosen], parts[chosen]),
        classes,
        is_state,
        most_gap=_MOST_GAP,
    )
    return [np.flatnonzero(of_label == i).tolist() for i in range(int(of_label.max()) + 1)]


def check_has_scores(library: ClassLibrary) -> None:
    """Raise InvalidInput unless every class has what scores need."""
    if library.scoring is None:
        raise InvalidInput(
            "the library has no corpus that classes are told from, which scores need; learn it "
            "again, or assign labels by costs (assignment published)"
        )
    for one in library:
        if not one.prior:
            _ = one.ratios


# -- rates of false labels ----------------------------------------------------------------


def measure_false_rates(library: ClassLibrary, others: Sequence[FeatureSequence]) -> ClassLibrary:
    """Library that knows how many false labels a minute to expect at each score.

    The others are recordings without any of its classes.
    """
    check_has_scores(library)
    lowest = lowest_scores(library)
    scores: list[list[float]] = [[] for _ in library]
    for sequence in others:
        found = find_candidates(sequence, library)
        for i in choose_candidates(found, library, threshold=lowest).tolist():
            scores[found.place_of(i).class_index].append(float(found.paths.scores[i]))
    minutes = sum(map(len, others)) / _FRAMES_A_MINUTE
    return _with_rates(library, scores, minutes)


def calibrate_scores(
    library: ClassLibrary, labels: Sequence[JudgedLabel], *, minutes: float
) -> ClassLibrary:
    """Library that knows rates of false labels, and how probably a label is right.

    Parameters
    ----------
    library : with scores
    labels : assigned in recordings of people who taught none of the classes, from
        `lowest_scores` on
    minutes : length of those recordings, but for what right labels cover

    Raises
    ------
    InvalidInput
        If there is no label.
    """
    check_has_scores(library)
    least = dict(zip(library.names, thresholds_for(library).tolist(), strict=True))
    false = [[x.score for x in labels if x.name == n and not x.is_right] for n in library.names]
    rated = _with_rates(library, false, minutes)
    margins = [label.score - least[label.name] for label in labels]
    curve = fit_probability(margins, [label.is_right for label in labels])
    rounded = (round(curve[0], 4), round(curve[1], 4))
    return replace(rated, scoring=rated.scoring and replace(rated.scoring, probability=rounded))


def lowest_scores(library: ClassLibrary) -> Floats:
    """Of each class, the score from which on labels are looked at to calibrate."""
    return thresholds_for(library) - _BELOW


def _with_rates(
    library: ClassLibrary, scores: Sequence[Sequence[float]], minutes: float
) -> ClassLibrary:
    """Library with the rates of false labels of these scores, by class."""
    own = _own_thresholds(library)
    rates = fit_false_rates(scores, minutes, lowest=lowest_scores(library), least=own)
    classes = tuple(
        replace(one, false_level=round(float(level), 4))
        for one, level in zip(library, rates.levels, strict=True)
    )
    scoring = library.scoring and replace(library.scoring, false_slope=round(rates.slope, 4))
    return replace(library, classes=classes, scoring=scoring)


def false_rates_of(library: ClassLibrary) -> FalseRates | None:
    """Rates of false labels of all classes; None unless all are known."""
    levels = [one.false_level for one in library if one.false_level is not None]
    slope = library.scoring.false_slope if library.scoring else None
    if slope is None or len(levels) < len(library):
        return None
    return FalseRates(np.array(levels), slope, _own_thresholds(library))


def thresholds_for(
    library: ClassLibrary,
    at_most_false_per_min: float | None = None,
    *,
    given: float | None = None,
) -> Floats:
    """Least scores of the labels of each class, shape (classes,).

    Parameters
    ----------
    at_most_false_per_min : all so much higher or lower that so many false labels are
        expected in a minute of motion without right ones; by default the library's
    given : one score for all classes, before those

    Raises
    ------
    InvalidInput
        If rates of false labels are asked for and not known.
    """
    if given is not None:
        return np.full(len(library), given, dtype=np.float64)
    check_has_scores(library)
    thresholds = _own_thresholds(library)
    if at_most_false_per_min is None:
        return thresholds
    rates = false_rates_of(library)
    if rates is None:
        raise InvalidInput(
            "the library does not know how many false labels to expect; learn it with other "
            "recordings, without its classes (learn --calibrate --negatives PATH)"
        )
    return rates.shift(thresholds, at_most_false_per_min)


def _own_thresholds(library: ClassLibrary) -> Floats:
    common = library.scoring.threshold if library.scoring else 0.0
    own = [common if c.score_threshold is None else c.score_threshold for c in library]
    return np.array(own, dtype=np.float64)


def format_thresholds(
    library: ClassLibrary,
    at_most_false_per_min: float | None = None,
    *,
    given: float | None = None,
) -> str:
    """Least score of most classes, and in brackets those of the others; or the given one."""
    if given is not None:
        return f"{given:g}"
    least = [round(float(x), 2) for x in thresholds_for(library, at_most_false_per_min)]
    common = max(sorted(set(least)), key=least.count, default=0.0)
    own = [
        f"{', '.join(n for n, y in zip(library.names, least, strict=True) if y == x)} {x:g}"
        for x in sorted(set(least) - {common})
    ]
    return f"{common:g}" + (f" ({'; '.join(own)})" if own else "")
