"""Scores of labels: settings, priors of features, and expected false labels.

A class needs, beside its templates, the fraction of frames of motion in general in which
each feature holds. Examples and a general corpus count half each; where templates are
mirrored, so is the prior.

Scores of the labels in recordings without the classes, all classes competing, fall off
exponentially: the rate of scores above s is exp(level - slope (s - `TAIL`)). Each class has
its level, drawn towards the common one; the slope is common. Below the scores that a
library asks for, rates grow at least by `STEEP`: what is left out there by people who do as
they are asked is little beside what other motion shows.

Conventions: probabilities of path scores are kept off 0 and 1 by their own settings; here
they only stay within (0, 1). Rates a minute of motion that no right label covers: where a
label is right, no other has room, so that rates by the clock would tell how much of a
recording is known.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motionary.errors import InvalidInput
from motionary.features import FULL_BODY, FeatureSequence, FeatureSet
from motionary.matching import SchedulingSettings, concatenate, feature_prior
from motionary.packing import full_mask

Floats = NDArray[np.float64]

_DIGITS = 6
_DEFAULTS = SchedulingSettings()
#: The score at which levels are stated.
TAIL = 5.0
#: How fast rates grow below the least scores, at least: what ACCAD's Male1 and Bandai's normal
#: style showed of the library that ships, on whose own people they grow half as fast.
STEEP = 0.7
# A class counts the common rate as so many labels.
_DRAWN = 2.0
_HALVINGS = 50

#: Fraction of frames in which each feature of the full-body set holds, in 66 recordings of
#: 17 people of the CMU Graphics Lab Motion Capture Database (8.3 minutes of everyday motion,
#: sports and exercises).
CORPUS_OF_CMU = (
    0.1979, 0.1876, 0.2659, 0.2249, 0.1145, 0.1073, 0.2646, 0.2424, 0.0593, 0.1498,
    0.1132, 0.1029, 0.6117, 0.5577, 0.3364, 0.3354, 0.0082, 0.0214, 0.0148, 0.2045,
    0.1722, 0.0155, 0.0556, 0.0667, 0.2731, 0.2686, 0.4326, 0.3774, 0.2538, 0.2506,
    0.1376, 0.0317, 0.0191, 0.0124, 0.0391, 0.0479, 0.0639, 0.0799, 0.5127, 0.1626,
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Scoring:
    """How labels of a library are assigned by scores.

    Attributes
    ----------
    corpus : fraction of frames of a general corpus in which each feature holds
    threshold : score at which a match is as good as no label
    look_ahead_s : how long after its end a match is decided
    false_slope : how fast false labels become rare, a unit of score; None if unknown
    probability : logarithm of the odds that a label of the least score of its class is
        right, and how it grows with each unit above; None if unknown
    """

    corpus: tuple[float, ...]
    threshold: float = _DEFAULTS.threshold
    look_ahead_s: float = _DEFAULTS.look_ahead_s
    false_slope: float | None = None
    probability: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        fractions = tuple(map(float, self.corpus))
        threshold, ahead, slope = self.threshold, self.look_ahead_s, self.false_slope
        odds = None if self.probability is None else tuple(map(float, self.probability))
        for key, fits, problem in (
            ("corpus", fractions and all(0 < x < 1 for x in fractions),
             "corpus needs fractions between 0 and 1"),
            ("threshold", np.isfinite(threshold) and threshold > 0,
             f"threshold of scores must be above 0, got {threshold}"),
            ("look_ahead_s", ahead >= 0, f"look_ahead_s must be at least 0, got {ahead}"),
            ("false_slope", slope is None or slope > 0,
             f"false_slope must be above 0, got {slope}"),
            ("probability", odds is None or (len(odds) == 2 and np.isfinite(odds).all()),
             "probability needs two numbers"),
        ):  # fmt: skip
            if not fits:
                raise InvalidInput(problem, key=key)
        object.__setattr__(self, "corpus", fractions)
        object.__setattr__(self, "probability", odds)

    def probability_of(self, margin: float) -> float | None:
        """That a label is right whose score lies so far above the least of its class."""
        if self.probability is None:
            return None
        at_least, growth = self.probability
        return float(1 / (1 + np.exp(-(at_least + growth * margin))))


def scoring_for(feature_set: FeatureSet, others: Sequence[FeatureSequence] = ()) -> Scoring | None:
    """Scoring with the corpus of other motion, or the one that comes with the package.

    None for a feature set that has no corpus.
    """
    if others:
        return Scoring(as_prior(measure_fractions(others, feature_set), feature_set))
    return Scoring(CORPUS_OF_CMU) if feature_set == FULL_BODY else None


def mix_prior(
    examples: Sequence[FeatureSequence], scoring: Scoring | None, *, mirror: bool
) -> tuple[float, ...]:
    """Prior of each feature, from the examples of all classes and a general corpus.

    Empty without either; `mirror` says whether templates have their mirror images.
    """
    if scoring is None or not examples:
        return ()
    feature_set = examples[0].feature_set
    prior = (measure_fractions(examples, feature_set) + np.array(scoring.corpus)) / 2
    return as_prior(prior, feature_set, mirror=mirror)


def measure_fractions(sequences: Sequence[FeatureSequence], feature_set: FeatureSet) -> Floats:
    """Fraction of the known frames in which each feature holds."""
    packed, known = [s.packed for s in sequences], [s.known for s in sequences]
    corpus = concatenate(packed, known, full=full_mask(1, len(feature_set))[0])
    return feature_prior(corpus, len(feature_set))


def as_prior(
    fractions: Floats, feature_set: FeatureSet, *, mirror: bool = False
) -> tuple[float, ...]:
    """Fractions, if wanted of mirror images too, rounded and kept off 0 and 1."""
    if mirror:
        fractions = (fractions + fractions[feature_set.mirror_order]) / 2
    least = 10.0**-_DIGITS
    return tuple(round(float(x), _DIGITS) for x in np.clip(fractions, least, 1 - least))


# -- rates of false labels ----------------------------------------------------------------


@dataclass(frozen=True, slots=True, eq=False)
class FalseRates:
    """False labels a minute.

    Attributes
    ----------
    levels : array, shape (classes,): logarithm of each class's rate at the score `TAIL`
    slope : how fast all rates fall, a unit of score
    least : array, shape (classes,): scores from which on that holds; below it rates grow
        by `STEEP`, if that is more. None: it holds everywhere
    """

    levels: Floats
    slope: float
    least: Floats | None = None

    def of_class(self, index: int, score: float) -> float:
        """False labels a minute of one class, of this score or a higher one."""
        return float(self._by_class(score)[index])

    def expected(self, thresholds: ArrayLike) -> float:
        """False labels a minute of all classes, with one threshold or one a class."""
        return float(self._by_class(thresholds).sum())

    def shift(self, thresholds: ArrayLike, at_most: float) -> Floats:
        """Thresholds, all so much higher or lower that so many false labels are expected.

        Raises
        ------
        InvalidInput
            If `at_most` is not a number above 0.
        """
        if not (np.isfinite(at_most) and at_most > 0):
            raise InvalidInput(f"false labels a minute must be above 0, got {at_most}")
        given = np.asarray(thresholds, dtype=np.float64)
        nats = float(np.log(self.expected(given) / at_most))
        # Rates fall everywhere by one of the two slopes: the change lies between.
        steepest = self.slope if self.least is None else max(self.slope, STEEP)
        low, high = sorted((nats / steepest, nats / self.slope))
        for _ in range(_HALVINGS):
            middle = (low + high) / 2
            if self.expected(given + middle) > at_most:
                low = middle
            else:
                high = middle
        shifted: Floats = given + high
        return shifted

    def _by_class(self, thresholds: ArrayLike) -> Floats:
        scores = np.broadcast_to(np.asarray(thresholds, dtype=np.float64), self.levels.shape)
        logarithms = self.levels - self.slope * (scores - TAIL)
        if self.least is not None:
            below = np.maximum(self.least - scores, 0.0)
            logarithms = logarithms + max(STEEP - self.slope, 0.0) * below
        rates: Floats = np.exp(logarithms)
        return rates


def fit_false_rates(
    scores: Sequence[ArrayLike],
    minutes: float,
    *,
    lowest: ArrayLike = TAIL,
    least: ArrayLike | None = None,
) -> FalseRates:
    """Rates from the scores of false labels, by class.

    Parameters
    ----------
    scores : one array a class: its labels in motion, so many minutes, that does not show it
    lowest : scores above it are counted; one number, or one a class
    least : scores that are asked for, above which alone the slope is fitted: below them
        rates grow faster. By default `lowest`

    Raises
    ------
    InvalidInput
        If there is no class, or nothing was labelled.
    """
    if not scores or not minutes > 0:
        raise InvalidInput(
            "rates of false labels need a class and recordings without it, got "
            f"{len(scores)} classes and {minutes} minutes"
        )
    every = [np.asarray(own, dtype=np.float64) for own in scores]
    from_, asked = (
        np.broadcast_to(np.asarray(x, dtype=np.float64), len(every))
        for x in (lowest, lowest if least is None else least)
    )
    above = [own[own > x] - x for own, x in zip(every, asked, strict=True)]
    excess = sum(float(own.sum()) for own in above)
    # Maximum likelihood of an exponential tail; one label at the mean of 1 keeps it finite.
    slope = (sum(map(len, above)) + 1.0) / (excess + 1.0)
    counts = np.array([(own > x).sum() for own, x in zip(every, from_, strict=True)], dtype=float)
    common = (counts.sum() + 0.5) / (minutes * len(every))
    rates = (counts + _DRAWN) / (minutes + _DRAWN / common)
    levels = np.log(rates) - max(STEEP, slope) * (asked - from_) + slope * (asked - TAIL)
    return FalseRates(levels, float(slope), None if least is None else asked)


def fit_probability(margins: ArrayLike, is_right: ArrayLike) -> tuple[float, float]:
    """Logistic curve of the probability that labels are right; Platt (1999).

    Parameters
    ----------
    margins : array, shape (labels,): what each scores above the least of its class
    is_right : array, shape (labels,), bool

    Returns
    -------
    logarithm of the odds at a margin of 0, and how it grows with the margin: never falling

    Raises
    ------
    InvalidInput
        If there is no label.
    """
    # Not needed to read or use a library: imported where it is.
    from scipy.optimize import minimize

    margin, right = np.asarray(margins, dtype=np.float64), np.asarray(is_right, dtype=np.bool_)
    if not len(margin) or margin.shape != right.shape:
        raise InvalidInput("a probability needs labels, and of each whether it is right")
    # One label more of either kind keeps the odds finite; targets as Platt has them.
    n_right, n_wrong = right.sum(), (~right).sum()
    target = np.where(right, (n_right + 1) / (n_right + 2), 1 / (n_wrong + 2))

    def loss(odds: Floats) -> float:
        logits = odds[0] + odds[1] * margin
        return float((np.logaddexp(0, logits) - target * logits).sum())

    fitted = minimize(loss, np.array([0.0, 0.5]), bounds=[(None, None), (0.0, None)])
    return float(fitted.x[0]), float(fitted.x[1])
