"""How is a template sought?

A quantised template becomes the pattern that the matcher looks for, with all entries equal
or each weighed by its surprise.
"""

import numpy as np
from numpy.typing import NDArray

from motionary.matching import Pattern, self_information
from motionary.models.templates.template import QuantisedTemplate


def pattern_of(template: QuantisedTemplate, *, ones: NDArray[np.float64] | None = None) -> Pattern:
    """Pattern of a quantised template.

    Parameters
    ----------
    template : QuantisedTemplate
    ones : array, shape (features,), optional
        Share of frames in which each relation holds in the searched recordings. With it,
        entries weigh their surprise, and columns the sum of theirs over the mean.
    """
    if ones is None:
        return Pattern(template.packed_values, template.packed_fixed, template.weights)
    entries = self_information(template.values, ones)
    totals = (entries * template.fixed).sum(axis=1)
    mean = totals.mean()
    # A column that tells nothing still takes time: its weight stays above zero.
    weights = np.maximum(totals / mean, 1e-6) if mean > 0 else np.ones(len(totals))
    return Pattern(template.packed_values, template.packed_fixed, weights, entries)
