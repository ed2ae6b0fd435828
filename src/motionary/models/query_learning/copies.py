"""What else would the examples have looked like?

Copies of a clip as another person might have done it: slower or faster, each relation a
little earlier or later than the others. What tells the class from varied others, too, does
not rest on coincidences of the few examples.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.features import FeatureSequence
from motionary.packing import pack

Bits = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Augmentation:
    """Settings of varied copies.

    Attributes
    ----------
    copies, negative_copies : of each positive and each negative
    shift : frames by which a relation may come early or late
    tempo : a copy may be so many times slower or faster; 1 keeps the speed
    """

    copies: int = 0
    negative_copies: int = 2
    shift: int = 3
    tempo: float = 1.25

    def __post_init__(self) -> None:
        least = min(self.copies, self.negative_copies, self.shift)
        if least < 0 or not 1.0 <= self.tempo <= 10.0:
            raise InvalidInput(
                "copies need numbers and a shift of at least 0 and a tempo of 1 to 10, "
                f"got {self.copies}, {self.negative_copies}, {self.shift} and {self.tempo}"
            )


def vary_clip(
    clip: FeatureSequence, augmentation: Augmentation, rng: np.random.Generator
) -> FeatureSequence:
    """A copy of a clip at another tempo, its relations shifted against each other."""
    features, known = clip.features.view(np.bool_), clip.known_features.view(np.bool_)
    features, known = vary(features, known, augmentation, rng)
    return FeatureSequence(pack(features), pack(known), clip.feature_set, clip.source)


def vary(
    features: Bits, known: Bits, augmentation: Augmentation, rng: np.random.Generator
) -> tuple[Bits, Bits]:
    """A copy at another tempo, relations shifted against each other.

    Parameters
    ----------
    relations, known : arrays, shape (frames, features)
    augmentation : how much varies
    rng : source of the variation

    Returns
    -------
    relations, known : arrays, shape (other frames, features); the ends are held
    """
    n_frames, n_features = features.shape
    speed = augmentation.tempo ** rng.uniform(-1.0, 1.0)
    n_copied = max(1, round(n_frames / speed))
    times = np.minimum((np.arange(n_copied) * speed).astype(np.intp), n_frames - 1)
    shifts = rng.integers(-augmentation.shift, augmentation.shift, size=n_features, endpoint=True)
    at = np.clip(times[:, None] + shifts, 0, n_frames - 1)
    columns = np.arange(n_features)
    return features[at, columns], known[at, columns]
