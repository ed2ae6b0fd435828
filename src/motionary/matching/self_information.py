"""How much does a relation tell?

What is rare in the searched recordings tells more: an entry weighs its surprise, minus the
logarithm of the share of frames that show its value.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motionary.matching.corpus import Corpus
from motionary.packing import unpack

Floats = NDArray[np.float64]


def feature_prior(corpus: Corpus, n_features: int) -> Floats:
    """Share of known frames in which each relation holds, shape (n_relations,).

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
    ones, seen : shape (n_relations,): frames in which a relation holds, and is known
    """
    return np.asarray((np.asarray(ones) + 1) / (np.asarray(seen) + 2), dtype=np.float64)


def self_information(values: NDArray[np.bool_], ones: Floats) -> Floats:
    """Surprise of entries: -log of the share that shows their value, >= 0.

    Parameters
    ----------
    values : array, shape (columns, relations)
    ones : array, shape (relations,), from `share_of_ones`
    """
    return np.where(values, -np.log(ones), -np.log1p(-ones))
