"""What each feature tells for a scored match, or against it."""

from typing import NamedTuple

import numpy as np

from motionary.features import FeatureSequence
from motionary.matching import Alignment, CellRatios, Paths, explain_scores


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
