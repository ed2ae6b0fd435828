"""Assignment of labels by scores: scored matches of all classes, and which of them to keep.

Every warping path that ends in a local minimum of a template's distance function gets a
score, the log-likelihood ratio of its frames (see `matching.path_scores`). Of those above
one threshold for all classes, the compatible ones of the largest total are chosen, each
decided a bounded time after its end (see `matching.scheduling`).

Conventions: frames are those of the sequence, at 30 Hz, half-open.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.features import SEQUENCE_HZ, FeatureSequence
from motionary.matching import (
    CellRatios,
    Intervals,
    Pattern,
    ScoredPaths,
    choose_causally,
    intervals,
    score_patterns,
)
from motionary.models.library.false_rates import TAIL, FalseRates, fit_false_rates
from motionary.models.library.storage import ClassLibrary

Indices = NDArray[np.intp]

# Below the first scores that the rates of false labels are fitted to.
_FITTED_FROM = TAIL - 1.0
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


def find_candidates(sequence: FeatureSequence, library: ClassLibrary) -> Candidates:
    """Scored matches of all prototypes in one recording.

    Raises
    ------
    InvalidInput
        If the library has no priors.
    """
    check_has_scores(library)
    places: list[PrototypePlace] = []
    patterns: list[Pattern] = []
    ratios: list[CellRatios] = []
    for i, one in enumerate(library):
        places += [PrototypePlace(i, j) for j in range(len(one.prototypes))]
        patterns += [pattern for _, pattern in one.patterns]
        ratios += one.ratios
    every = bool(sequence.known_features.all())
    known = None if every else sequence.known
    paths = score_patterns(patterns, ratios, sequence.packed, known)
    return Candidates(paths, tuple(places))


def choose_candidates(
    candidates: Candidates, library: ClassLibrary, *, threshold: float
) -> Indices:
    """Indices of the matches that become labels, by end."""
    scoring = library.scoring
    look_ahead_s = scoring.look_ahead_s if scoring else 0.0
    chosen = choose_causally(
        as_intervals(candidates, library, threshold=threshold),
        look_ahead=look_ahead_s * SEQUENCE_HZ,
    )
    return np.asarray(chosen, dtype=np.intp)


def as_intervals(candidates: Candidates, library: ClassLibrary, *, threshold: float) -> Intervals:
    """Matches as intervals that compete, of what they score above the threshold."""
    masks = np.array([one.parts_mask for one in library], dtype=np.int64)
    paths = candidates.paths
    return intervals(paths.starts, paths.stops, paths.scores - threshold, masks[candidates.classes])


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

    Parameters
    ----------
    library : with scores
    others : recordings without any of its classes
    """
    check_has_scores(library)
    scores: list[list[float]] = [[] for _ in library]
    for sequence in others:
        found = find_candidates(sequence, library)
        for i in choose_candidates(found, library, threshold=_FITTED_FROM).tolist():
            scores[found.place_of(i).class_index].append(float(found.paths.scores[i]))
    minutes = sum(map(len, others)) / _FRAMES_A_MINUTE
    rates = fit_false_rates(scores, minutes)
    levels = [round(float(level), 4) for level in rates.levels]
    classes = tuple(
        replace(one, false_level=level) for one, level in zip(library, levels, strict=True)
    )
    scoring = library.scoring and replace(library.scoring, false_slope=round(rates.slope, 4))
    return replace(library, classes=classes, scoring=scoring)


def false_rates_of(library: ClassLibrary) -> FalseRates | None:
    """Rates of false labels of all classes; None unless all are known."""
    levels = [one.false_level for one in library if one.false_level is not None]
    slope = library.scoring.false_slope if library.scoring else None
    if slope is None or len(levels) < len(library):
        return None
    return FalseRates(np.array(levels), slope)


def threshold_for(library: ClassLibrary, at_most_false_per_min: float | None) -> float:
    """The threshold of scores: the library's, or that of so many false labels a minute.

    Raises
    ------
    InvalidInput
        If rates of false labels are asked for and not known.
    """
    check_has_scores(library)
    if at_most_false_per_min is None:
        return library.scoring.threshold if library.scoring else 0.0
    rates = false_rates_of(library)
    if rates is None:
        raise InvalidInput(
            "the library does not know how many false labels to expect; learn it with other "
            "recordings, without its classes (learn --calibrate --negatives PATH)"
        )
    return rates.threshold(at_most_false_per_min)
