"""Which relations keep their value for a while, and which may be meant as either?

Another person does the same motion a little differently: a relation turns on a few frames
sooner or later. An example that must be found is read strictly, a relation counts where it
holds for some frames around; what must not be found is read loosely, a relation counts
where it holds at any of them.

Conventions: shapes are (frames, n_words); unknown relations are never steady and count as
neither value.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from motionary.features import FeatureSequence
from motionary.models.keyframes.word_index import PostingIndex, index_packed
from motionary.packing import PackedFeatures, unpack


def steady_mask(packed: PackedFeatures, known: PackedFeatures, frames: int) -> PackedFeatures:
    """Which relations are known and the same for so many frames before and after.

    The ends of a document count as if it went on as it begins and ends.
    """
    steady = known.copy()
    for shift in range(1, min(frames, len(packed) - 1) + 1):
        differs = (packed[shift:] ^ packed[:-shift]) | ~(known[shift:] & known[:-shift])
        steady[shift:] &= ~differs
        steady[:-shift] &= ~differs
    return steady


def count_steady(
    sequence: FeatureSequence, frames: NDArray[np.intp], most: int
) -> NDArray[np.intp]:
    """For how many frames around each of some frames every relation keeps its value.

    Parameters
    ----------
    sequence : words of a document
    frames : array, shape (n,)
    most : largest count

    Returns
    -------
    array, shape (n, features); 0 where a relation is unknown or differs beside the frame
    """
    n_features = len(sequence.feature_set)
    total = np.zeros((len(frames), n_features), dtype=np.intp)
    for around in range(1, most + 1):
        mask = steady_mask(sequence.packed, sequence.known, around)[frames]
        if not mask.any():
            break
        total += unpack(mask, n_features)
    return total


def strict_index(documents: Sequence[FeatureSequence], frames: int) -> PostingIndex:
    """Index in which a relation is known only where it is steady for so many frames."""
    masks = [steady_mask(d.packed, d.known, frames) for d in documents]
    feature_set = documents[0].feature_set
    return index_packed(
        [d.packed for d in documents], masks,
        feature_set=feature_set.name, feature_ids=feature_set.ids,
    )  # fmt: skip


def loose_index(documents: Sequence[FeatureSequence], frames: int) -> PostingIndex:
    """Index in which a relation holds where it does at any of so many frames around.

    The same goes for its opposite, so that near a change both are found.
    """
    feature_set = documents[0].feature_set
    on = [_spread(d.packed & d.known, frames) for d in documents]
    off = [_spread(~d.packed & d.known, frames) for d in documents]
    nowhere = [np.zeros_like(mask) for mask in off]
    name, ids = feature_set.name, feature_set.ids
    holds = index_packed(on, on, feature_set=name, feature_ids=ids)
    fails = index_packed(nowhere, off, feature_set=name, feature_ids=ids)
    return PostingIndex(holds.planes | fails.planes, holds.lengths, name, ids)


def _spread(mask: PackedFeatures, frames: int) -> PackedFeatures:
    spread = mask.copy()
    for shift in range(1, min(frames, len(mask) - 1) + 1):
        spread[shift:] |= mask[:-shift]
        spread[:-shift] |= mask[shift:]
    return spread
