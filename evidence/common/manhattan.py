"""The distance function without masks: Manhattan distance of template and frame.

What Müller and Röder (2006) compare with in figure 7 (a template that is not quantised) and
table 4 (the relations of a single example). Steps and weights are those of matching.
"""

import numpy as np
from numpy.typing import NDArray

from evidence.baselines import match_costs
from motionary.matching import SKIP_WEIGHT, Corpus
from motionary.models.templates import MotionTemplate
from motionary.packing import unpack

Floats = NDArray[np.float64]


def manhattan_distance(
    template: MotionTemplate, corpus: Corpus, *, skip_weight: float = SKIP_WEIGHT
) -> Floats:
    """Cost of the best path that ends at each frame, shape (padded frames,).

    A cell costs the mean difference of the relations times the mean of the column's weight
    and 1, so that the scale is that of the masked cost.
    """
    frames = unpack(corpus.packed, template.n_features).astype(np.float64)
    # Of a relation that is 0 or 1, |x - y| is x (1 - 2 y) + y.
    costs = (1 - 2 * template.values) @ frames.T + template.values.sum(axis=1, keepdims=True)
    costs *= ((template.weights + 1) / 2 / template.n_features)[:, np.newaxis]
    costs = np.maximum(costs, 0.0)
    costs[:, corpus.blocked] = np.inf
    return match_costs(costs, skip_weight=skip_weight).distance
