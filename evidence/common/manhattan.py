"""The distance function without masks: Manhattan distance of template and frame.

What Müller and Röder (2006) compare with in figure 7 (a template that is not quantised) and
table 4 (the relations of a single example). Steps and weights are those of matching.
"""

import numpy as np
from numpy.typing import NDArray

from motionary.matching import SKIP_WEIGHT, Corpus
from motionary.templates import MotionTemplate
from motionary.words import unpack

Floats = NDArray[np.float64]


def manhattan_distance(
    template: MotionTemplate, corpus: Corpus, *, skip_weight: float = SKIP_WEIGHT
) -> Floats:
    """Cost of the best path that ends at each frame, shape (padded frames,).

    A cell costs the mean difference of the relations times the mean of the column's weight
    and 1, so that the scale is that of the masked cost.
    """
    frames = unpack(corpus.words, template.n_features).astype(np.float64)
    before = skipped = np.empty(0)
    for k, (column, weight) in enumerate(zip(template.values, template.weights, strict=True)):
        # Of a relation that is 0 or 1, |x - y| is x (1 - 2 y) + y.
        cost = (frames @ (1 - 2 * column) + column.sum()) / template.n_features
        cost *= (weight + 1) / 2
        cost[corpus.blocked] = np.inf
        row = cost if k == 0 else np.minimum(_later(before, 1), _later(before, 2)) + cost
        if k > 1:
            row = np.minimum(row, _later(skipped, 1) + skip_weight * cost)
        before, skipped = row, before
    return np.asarray(before / template.n_columns)


def _later(row: Floats, frames: int) -> Floats:
    return np.concatenate([np.full(frames, np.inf), row[:-frames]])
