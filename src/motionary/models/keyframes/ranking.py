"""How are the hits of a query ranked when there is no template?

A class known by its query alone is a template all the same: the keyframes are its columns,
everything between them is free. Matched against the hits it tells which of them keep the
query's distances.
"""

import math

import numpy as np

from motionary.errors import InvalidInput
from motionary.models.keyframes.query import Gap, KeyframeQuery
from motionary.models.templates import QuantisedTemplate
from motionary.packing import unpack


def template_of_query(query: KeyframeQuery) -> QuantisedTemplate:
    """Template of the keyframe columns, free in between.

    Columns stand at the positions that the keyframes had in their template, or else at the
    distances that their gaps are made for; a gap without upper bound is as short as it may
    be. Keyframes of one frame share a column.

    Raises
    ------
    InvalidInput
        If keyframes of one frame contradict each other.
    """
    columns = columns_of_query(query)
    n_features = len(query.feature_ids)
    values, fixed = unpack(query.values, n_features), unpack(query.fixed, n_features)
    shape = (columns[-1] + 1, n_features)
    all_values, all_fixed = np.zeros(shape, dtype=np.bool_), np.zeros(shape, dtype=np.bool_)
    for k, column in enumerate(columns):
        both = all_fixed[column] & fixed[k]
        if (both & (all_values[column] ^ values[k])).any():
            raise InvalidInput(f"keyframe {k + 1} contradicts the one before it in the same frame")
        all_values[column] |= values[k]
        all_fixed[column] |= fixed[k]
    return QuantisedTemplate(
        values=all_values,
        fixed=all_fixed,
        weights=np.ones(shape[0]),
        feature_names=query.feature_ids,
        feature_set=query.feature_set,
    )


def columns_of_query(query: KeyframeQuery) -> list[int]:
    """Column of each keyframe in `template_of_query`, the first at 0."""
    if query.positions is not None:
        return [position - query.positions[0] for position in query.positions]
    columns = [0]
    for gap in query.gaps:
        columns.append(columns[-1] + _typical(gap))
    return columns


def _typical(gap: Gap) -> int:
    """Distance in frames that a gap is made for; keyframes stay apart if they may."""
    if gap.most is None:
        return max(gap.least, 1)
    if gap.most == 0:
        return 0
    # Of a spring the distance; a gap that begins at 0 is none.
    middle = math.sqrt(gap.least * gap.most) if gap.least else gap.most / 2
    return max(round(middle), 1)
