"""Examples of one class brought to one side before they are averaged.

Examples of a motion that people do on either side, such as a lunge, share little as they
are. Each is taken as it is or mirrored, as it fits the others best: starting from no
change, sides are exchanged one at a time until none gains.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from motionary.features import FeatureSequence
from motionary.matching import Pattern, distance_function
from motionary.packing import pack, unpack

_MOST_ROUNDS = 10
#: An end of a match counts as that of the whole in this last part of a sequence.
_LAST_PART = 4


def fold_sides(examples: Sequence[FeatureSequence]) -> list[FeatureSequence]:
    """The examples, each as it is or as its mirror image; most stay as they are."""
    flipped = [mirror_sequence(example) for example in examples]
    n = len(examples)
    gain = np.zeros((n, n))
    for i in range(n):
        for j in range(i):
            same = _difference(examples[i], examples[j])
            gain[i, j] = gain[j, i] = _difference(examples[i], flipped[j]) - same
    side = np.ones(n)
    for _ in range(_MOST_ROUNDS):
        before = side.copy()
        for i in range(n):
            vote = float((gain[i] * side).sum())
            if vote:
                side[i] = np.sign(vote)
        if np.array_equal(side, before):
            break
    if side.sum() < 0:
        side = -side
    return [one if s > 0 else other for one, other, s in zip(examples, flipped, side, strict=True)]


def mirror_sequence(sequence: FeatureSequence) -> FeatureSequence:
    """Features of the mirror image of a recording."""
    feature_set = sequence.feature_set
    packed, known = (
        pack(unpack(integers, len(feature_set))[:, feature_set.mirror_order])
        for integers in (sequence.packed, sequence.known)
    )
    return replace(sequence, packed=packed, known=known)


def _difference(first: FeatureSequence, second: FeatureSequence) -> float:
    """Mean cost of matching each sequence as a whole in the other."""
    return (_cost(first, second) + _cost(second, first)) / 2


def _cost(pattern: FeatureSequence, target: FeatureSequence) -> float:
    asked = Pattern(pattern.packed & pattern.known, pattern.known, np.ones(len(pattern)))
    distance = distance_function(asked, target.packed, target.known)
    last = distance[-max(1, len(target) // _LAST_PART) :]
    # Where none fits, by its length, all that is asked for fails.
    return min(float(last.min()), 1.0)
