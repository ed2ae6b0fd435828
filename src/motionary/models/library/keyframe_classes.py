"""How does a motion that is known by keyframes alone become a class?

Its template has the keyframes as columns and is free in between, so that within the windows
around their hits it costs nothing where they keep their distances, up to half and twice the
tempo.
"""

import numpy as np

from motionary.models.keyframes import KeyframeQuery, columns_of_query, template_of_query
from motionary.models.library.classes import THRESHOLD, MotionClass, Prototype
from motionary.models.templates import MotionTemplate

_FREE = 0.5


def class_of_query(name: str, query: KeyframeQuery, *, threshold: float = THRESHOLD) -> MotionClass:
    """Class that is shown wherever a query has a hit.

    Parameters
    ----------
    name : of the class
    query : its keyframes
    threshold : largest cost of a match

    Raises
    ------
    InvalidInput
        If keyframes of one frame contradict each other, or the name is empty.
    """
    quantised = template_of_query(query)
    template = MotionTemplate(
        np.where(quantised.fixed, quantised.values, _FREE),
        quantised.weights,
        quantised.feature_names,
        quantised.feature_set,
        provenance="keyframes",
    )
    placed = KeyframeQuery(
        query.values, query.fixed, query.gaps, query.feature_set, query.feature_ids,
        tuple(columns_of_query(query)),
    )  # fmt: skip
    return MotionClass(name, (Prototype(name, template, (placed,)),), threshold)
