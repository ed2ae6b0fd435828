"""What each feature tells for a match: its part of a score, or how alike a quantity is."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.features import FULL_BODY, FeatureSequence
from motionary.features.everyday import QUANTILES, list_quantities
from motionary.matching import Alignment, CellRatios, Paths, explain_scores

Floats = NDArray[np.float64]


class Gain(NamedTuple):
    """What one feature tells for a class, or against it.

    Attributes
    ----------
    feature : id ("F20")
    name : of the feature, in words
    nats : logarithm of how much more likely the class makes its frames, in sum
    part : its part of the score; parts of all features sum to it
    """

    feature: str
    name: str
    nats: float
    part: float

    def __str__(self) -> str:
        return f"{self.name} {self.part:+.1f}"


def find_gains(
    ratios: CellRatios, alignment: Alignment, sequence: FeatureSequence
) -> tuple[Gain, ...]:
    """Part of each feature in the score of a match, in the order of the features."""
    columns, met = alignment.path.T
    frames = np.full((1, len(ratios.if_one)), -1, dtype=np.int32)
    frames[0, columns] = met
    paths = Paths(frames, np.array([alignment.cost], dtype=np.float32))
    parts = explain_scores(ratios, paths, sequence.packed, sequence.known)[0]
    return tuple(
        Gain(feature.id, feature.name, float(part * ratios.scale), float(part))
        for feature, part in zip(sequence.feature_set.features, parts, strict=True)
    )


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """An example and what it found, over the everyday set.

    Attributes
    ----------
    example, found : features of both
    windows, published : cost by windows of ranked quantities, and by the published features
    """

    example: FeatureSequence
    found: FeatureSequence
    windows: float
    published: float


class QuantityMatch(NamedTuple):
    """One quantity in an example and in what it found.

    Attributes
    ----------
    name : of the quantity, in words
    example, found : mean rank in everyday motion, in [0, 1]
    differs : how far the ranks lie apart, moment by moment, in [0, 1]
    """

    name: str
    example: float
    found: float
    differs: float

    def __str__(self) -> str:
        here, there = (_LEVELS[round(rank * (len(_LEVELS) - 1))] for rank in self[1:3])
        if here != there:
            return f"{self.name} ({here}, here {there})"
        return f"{self.name} ({here}{', at other moments' if self.differs > _NOTABLE else ''})"


#: Ranks this far apart are worth a word.
_NOTABLE = 0.15
_LEVELS = ("lowest", "low", "middle", "high", "highest")
_MOMENTS = 20


def compare_quantities(comparison: Comparison) -> tuple[QuantityMatch, ...]:
    """Quantities of an example and of what it found, the most alike first.

    Both are laid over each other evenly. Quantities that stay in the middle of everyday motion
    say nothing of the example: of equal ones, what is further from the middle comes first.
    """
    example, found = _ranks(comparison.example), _ranks(comparison.found)
    differ = np.abs(example - found)
    seen = np.asarray(np.isfinite(differ).any(axis=0))
    with np.errstate(invalid="ignore"):
        means = [np.nanmean(np.where(seen, ranks, 0.0), axis=0) for ranks in (example, found)]
        apart = np.nanmean(np.where(seen, differ, 0.0), axis=0)
    order = np.lexsort((-np.abs(means[0] - 0.5), apart.round(1)))
    names = [quantity.name for quantity in list_quantities()]
    return tuple(
        QuantityMatch(names[i], float(means[0][i]), float(means[1][i]), float(apart[i]))
        for i in order
        if seen[i]
    )


def describe_comparison(comparison: Comparison, *, most: int = 3) -> list[str]:
    """In which quantities an example and what it found are most alike, and least; a line each."""
    quantities = compare_quantities(comparison)
    differing = [one for one in quantities[::-1] if one.differs > _NOTABLE]
    return [
        f"{what}: {', '.join(map(str, which[:most]))}"
        for what, which in (("alike", quantities), ("differs", differing))
        if which
    ]


def _ranks(sequence: FeatureSequence) -> Floats:
    """Rank of each quantity at evenly spread moments, (moments, quantities), NaN = unknown."""
    at = np.linspace(0, len(sequence) - 1, _MOMENTS).round().astype(np.intp)
    quantities, first = list_quantities(), len(FULL_BODY)
    shape = (_MOMENTS, len(quantities), len(QUANTILES))
    bits = sequence.features[at, first:].reshape(shape).astype(np.float64)
    known = sequence.known_features[at, first:].reshape(shape).all(axis=2)
    half = len(QUANTILES) // 2
    signed = np.array([quantity.is_signed for quantity in quantities])
    below = np.where(signed, half - bits[..., :half].sum(axis=2), bits[..., :half].sum(axis=2))
    ranks = (below + bits[..., half:].sum(axis=2)) / len(QUANTILES)
    return np.where(known, ranks, np.nan)
