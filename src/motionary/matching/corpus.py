"""Sequences searched as one, and how much each feature tells among them.

Sequences stand one behind the other with two empty frames between them: no step of the
matcher is longer than two frames, so no path crosses a border.

What is rare in the searched sequences tells more: an entry weighs its self-information,
minus the logarithm of the fraction of frames that show its value.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motionary.errors import InvalidInput
from motionary.packing import PackedFeatures, unpack

Floats = NDArray[np.float64]

PADDING = 2


@dataclass(frozen=True, slots=True, eq=False)
class Corpus:
    """Packed features of sequences, padded.

    Attributes
    ----------
    packed, known : arrays, shape (frames with padding, n_integers), uint64
    starts, lengths : arrays, shape (sequences,)
        Where each sequence begins, and its number of frames.
    blocked : array of the padding frames
    """

    packed: PackedFeatures
    known: PackedFeatures
    starts: NDArray[np.intp]
    lengths: NDArray[np.intp]
    blocked: NDArray[np.intp]

    def sequence(self, index: int) -> tuple[PackedFeatures, PackedFeatures]:
        """Features and mask of one sequence."""
        part = slice(self.starts[index], self.starts[index] + self.lengths[index])
        return self.packed[part], self.known[part]

    def split(self, per_frame: NDArray[np.float32]) -> list[NDArray[np.float32]]:
        """Parts of an array (padded frames,), one per sequence."""
        pairs = zip(self.starts, self.lengths, strict=True)
        return [per_frame[start : start + length] for start, length in pairs]


def concatenate(
    packed: Sequence[PackedFeatures], known: Sequence[PackedFeatures], *, full: PackedFeatures
) -> Corpus:
    """Corpus of sequences.

    Parameters
    ----------
    packed, known : one array (frames, n_integers) per sequence
    full : array, shape (n_integers,), the mask in which every feature is known

    Raises
    ------
    InvalidInput
        If there is no sequence, or features and masks are not of one form.
    """
    if not packed or len(packed) != len(known):
        raise InvalidInput(
            "a corpus needs at least one sequence, and a mask for each, got "
            f"{len(packed)} and {len(known)}"
        )
    for i, (a, b) in enumerate(zip(packed, known, strict=True)):
        if a.shape != b.shape or a.ndim != 2 or a.shape[1] != len(full):
            raise InvalidInput(
                f"sequence {i}: packed and known need shape (frames, {len(full)}), "
                f"got {a.shape} and {b.shape}"
            )
    lengths = np.array([len(a) for a in packed], dtype=np.intp)
    starts = np.concatenate([[0], np.cumsum(lengths[:-1] + PADDING)]).astype(np.intp)
    total = int(starts[-1] + lengths[-1])
    all_packed = np.zeros((total, len(full)), dtype=np.uint64)
    all_known = np.tile(full, (total, 1))
    inside = np.zeros(total, dtype=np.bool_)
    for a, b, start in zip(packed, known, starts, strict=True):
        part = slice(start, start + len(a))
        all_packed[part], all_known[part], inside[part] = a, b, True
    return Corpus(all_packed, all_known, starts, lengths, np.flatnonzero(~inside))


def feature_prior(corpus: Corpus, n_features: int) -> Floats:
    """Fraction of known frames in which each feature holds, shape (n_features,).

    One frame of either value is added (Laplace), so that what never happens is rare and
    not impossible.
    """
    inside = np.ones(len(corpus.packed), dtype=np.bool_)
    inside[corpus.blocked] = False
    packed, known = corpus.packed[inside], corpus.known[inside]
    ones = unpack(packed & known, n_features).sum(axis=0, dtype=np.int64)
    seen = unpack(known, n_features).sum(axis=0, dtype=np.int64)
    return prior_of_counts(ones, seen)


def prior_of_counts(ones: ArrayLike, seen: ArrayLike) -> Floats:
    """The same from counts that are known already.

    Parameters
    ----------
    ones, seen : shape (n_features,): frames in which a feature holds, and is known
    """
    return np.asarray((np.asarray(ones) + 1) / (np.asarray(seen) + 2), dtype=np.float64)


def self_information(values: NDArray[np.bool_], ones: Floats) -> Floats:
    """Self-information of entries: -log of the fraction that shows their value, >= 0.

    Parameters
    ----------
    values : array, shape (columns, features)
    ones : array, shape (features,), from `feature_prior`
    """
    return np.where(values, -np.log(ones), -np.log1p(-ones))
