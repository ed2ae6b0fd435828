"""Which columns of a template tell most?

Two to five keyframes by a rule of thumb, after Müller and Röder (2006), section 5.4, and
the authors' programs: columns in which much is fixed, ones counting double, within a group
of features; not at the ends of the template, not beside each other.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.features import FULL_BODY, FeatureSet
from motionary.models.keyframes.building import check_template_features, group_members
from motionary.models.templates import QuantisedTemplate

Floats = NDArray[np.float64]

#: Share of the columns over which the window rises and falls.
_RAMP = 0.2


class Choice(NamedTuple):
    """A column of a template as a keyframe.

    Attributes
    ----------
    position : column, from 0
    group : features that the keyframe keeps
    score : what the rule of thumb gives it
    """

    position: int
    group: str
    score: float


def choose_keyframes(
    template: QuantisedTemplate,
    *,
    count: int = 3,
    min_distance: int = 5,
    zero_weight: float = 1.0,
    feature_set: FeatureSet = FULL_BODY,
) -> list[Choice]:
    """Columns of a template that characterise it, in the order of time.

    Parameters
    ----------
    template : QuantisedTemplate
    count : at most so many; fewer if no column with fixed cells is left
    min_distance : columns around a chosen one that are not chosen
    zero_weight : worth of a fixed zero, a fixed one being worth 2; 1.2 in a variant
    feature_set : says which feature belongs to which group; that of the template

    Raises
    ------
    InvalidInput
        If count is below 1 or the template is over other features.
    """
    if count < 1:
        raise InvalidInput(f"count must be at least 1, got {count}")
    check_template_features(template, feature_set)
    groups = list(dict.fromkeys(feature.group for feature in feature_set.features))
    scores = np.stack(
        [group_scores(template, group_members(g, feature_set), zero_weight) for g in groups]
    )
    choices: list[Choice] = []
    while len(choices) < count and scores.max() > 0.0:
        best, position = np.unravel_index(np.argmax(scores), scores.shape)
        choices.append(Choice(int(position), groups[best], float(scores[best, position])))
        low, high = _neighbourhood(scores[best], int(position), min_distance)
        scores[:, low:high] = 0.0
    return sorted(choices)


def group_scores(
    template: QuantisedTemplate, members: NDArray[np.bool_], zero_weight: float
) -> Floats:
    """Score of every column by the features of one group, shape (columns,)."""
    fixed, values = template.fixed[:, members], template.values[:, members]
    ones = np.count_nonzero(fixed & values, axis=1)
    zeros = np.count_nonzero(fixed & ~values, axis=1)
    score: Floats = (2.0 * ones + zero_weight * zeros) / np.count_nonzero(members)
    return score * _window(template.n_columns)


def _window(n_columns: int) -> Floats:
    """Halves of a Hann window over the first and last fifth, 1 between."""
    ramp = int(_RAMP * n_columns)
    window = np.ones(n_columns)
    rise = 0.5 - 0.5 * np.cos(np.pi * np.arange(1, ramp + 1) / (ramp + 1))
    window[:ramp] = rise
    window[n_columns - ramp :] = rise[::-1]
    return window


def _neighbourhood(scores: Floats, position: int, min_distance: int) -> tuple[int, int]:
    """Columns around a chosen one, half-open: a minimum, then while the score falls."""
    low = max(position - min_distance, 0)
    while low > 0 and scores[low - 1] < scores[low]:
        low -= 1
    high = min(position + min_distance + 1, len(scores))
    while high < len(scores) and scores[high] < scores[high - 1]:
        high += 1
    return low, high
