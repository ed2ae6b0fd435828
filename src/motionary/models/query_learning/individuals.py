"""What is bred?

An individual is a keyframe query in whole numbers (Baak 2012, section 4.1): template
columns, relations as bits of a number, and the fewest and most frames between neighbours.
Individuals are hashable, so that what was evaluated once is not evaluated again.
"""

from typing import NamedTuple

import numpy as np

from motionary.models.keyframes import Gap, KeyframeQuery
from motionary.packing import PackedFeatures, count_integers

Numbers = tuple[int, ...]


class Individual(NamedTuple):
    """A candidate query.

    Attributes
    ----------
    positions : column of the template of each keyframe, ascending, from 0
    values, fixed : per keyframe, relations that hold and that are asked for, as bits
    least, most : per gap, frames between neighbouring keyframes, both included
    """

    positions: Numbers
    values: Numbers
    fixed: Numbers
    least: Numbers
    most: Numbers

    @property
    def n_fixed(self) -> int:
        """Relations asked for in all keyframes."""
        return sum(fixed.bit_count() for fixed in self.fixed)

    @property
    def slack(self) -> int:
        """Frames by which the gaps may vary, in all."""
        return sum(self.most) - sum(self.least)


def to_query(
    individual: Individual, feature_set: str, feature_ids: tuple[str, ...]
) -> KeyframeQuery:
    """The individual as a query over a set of features."""
    n_integers = count_integers(len(feature_ids))
    gaps = tuple(Gap(*gap) for gap in zip(individual.least, individual.most, strict=True))
    return KeyframeQuery(
        _to_words(individual.values, n_integers),
        _to_words(individual.fixed, n_integers),
        gaps,
        feature_set,
        feature_ids,
        individual.positions,
    )


def to_numbers(packed: PackedFeatures) -> Numbers:
    """Words as numbers with a bit per relation, one per row."""
    return tuple(
        int.from_bytes(row.tobytes(), "little") for row in packed.astype("<u8", copy=False)
    )


def free_entry(individual: Individual, k: int, bit: int) -> Individual:
    """Without one entry of keyframe k."""
    return individual._replace(
        values=put(individual.values, k, individual.values[k] & ~bit),
        fixed=put(individual.fixed, k, individual.fixed[k] & ~bit),
    )


def without_keyframe(individual: Individual, k: int) -> Individual:
    """The individual without keyframe k, whose two gaps become their sum."""
    least, most = (_without_gap(bounds, k) for bounds in (individual.least, individual.most))
    positions, values, fixed = ((*numbers[:k], *numbers[k + 1 :]) for numbers in individual[:3])
    return Individual(positions, values, fixed, least, most)


def bits(number: int) -> list[int]:
    """The set bits of a number, each as a number."""
    bits = []
    while number:
        bits.append(number & -number)
        number &= number - 1
    return bits


def put(numbers: Numbers, k: int, number: int) -> Numbers:
    """The numbers with another one at place k."""
    return (*numbers[:k], number, *numbers[k + 1 :])


def _without_gap(bounds: Numbers, k: int) -> Numbers:
    beside = bounds[max(k - 1, 0) : k + 1]
    between = (sum(beside),) if len(beside) == 2 and k > 0 else ()
    return (*bounds[: max(k - 1, 0)], *between, *bounds[k + 1 :])


def _to_words(numbers: Numbers, n_integers: int) -> PackedFeatures:
    raw = b"".join(number.to_bytes(n_integers * 8, "little") for number in numbers)
    return np.frombuffer(raw, dtype="<u8").reshape(-1, n_integers).astype(np.uint64)
