"""How well does a clip as a whole fit a template?

Classical DTW with boundary conditions: first column meets first frame, last column meets
last frame, steps (1, 0), (0, 1), (1, 1); the cost of a cell is the masked one of matching.
The sum along the cheapest path is divided by columns plus frames, so that templates and
clips of different lengths can be compared.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.features import FeatureSequence
from motionary.matching import Pattern
from motionary.packing import unpack

Floats = NDArray[np.float64]


def whole_costs(patterns: Mapping[str, Pattern], clips: Sequence[FeatureSequence]) -> Floats:
    """Cost of each clip against each pattern, shape (clips, patterns).

    Raises
    ------
    InvalidInput
        If some relation of a clip is unknown.
    """
    unseen = [clip.source for clip in clips if not clip.known_features.all()]
    if unseen:
        raise InvalidInput(f"{unseen[0]}: every relation must be known, some are not")
    lengths = np.array([len(clip) for clip in clips])
    frames = np.zeros((len(clips), int(lengths.max()), len(clips[0].feature_set)))
    for i, clip in enumerate(clips):
        frames[i, : len(clip)] = clip.features
    columns = [_accumulate(_cell_costs(p, frames), lengths) for p in patterns.values()]
    return np.array(columns).T


def _cell_costs(pattern: Pattern, frames: Floats) -> Floats:
    """Masked cost of each column in each frame, shape (columns, clips, frames)."""
    n_features = frames.shape[-1]
    fixed = unpack(pattern.fixed, n_features)
    value = unpack(pattern.values, n_features)
    entries = fixed if pattern.entry_weights is None else fixed * pattern.entry_weights
    total = entries.sum(axis=1)
    entries = entries * (pattern.column_weights / np.where(total > 0, total, 1.0))[:, np.newaxis]
    # Wrong is a 1 that is not there, or one that should not be.
    costs = frames @ np.where(value, -entries, entries).T + (entries * value).sum(axis=1)
    return np.moveaxis(costs, -1, 0)


def _accumulate(costs: Floats, lengths: NDArray[np.intp]) -> Floats:
    """Cost of one pattern against all clips: a column over all frames at a time.

    Within a row, D(j) = min over i <= j of entering at i and paying on to j, which is a
    running minimum once the sum of costs is taken off.
    """
    row = np.full(costs.shape[1:], np.inf)
    for k, cost in enumerate(costs):
        total = np.cumsum(cost, axis=1)
        enter = row.copy()
        enter[:, 1:] = np.minimum(enter[:, 1:], row[:, :-1])
        if k == 0:
            enter[:, 0] = 0.0
        row = total + np.minimum.accumulate(enter - (total - cost), axis=1)
    ends = row[np.arange(len(lengths)), lengths - 1]
    return np.asarray(ends / (len(costs) + lengths), dtype=np.float64)
