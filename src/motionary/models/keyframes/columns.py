"""Columns of a motion template as keyframes: given, by a rule of thumb, with examples.

The rule of thumb, after Müller and Röder (2006), section 5.4, and the authors' programs:
columns in which much is fixed, ones counting double, within a group of features; not at the
ends of the template, not beside each other.

Examples are aligned with their template: a column is a moment that all of them pass, and
`AlignedColumns` holds which features they share there.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.features import FULL_BODY, FeatureSequence, FeatureSet
from motionary.models.keyframes.index import count_steady
from motionary.models.keyframes.query import Gap, KeyframeQuery, gaps_of, group_members
from motionary.models.templates import MotionTemplate, PairCost, QuantisedTemplate, align_batched
from motionary.packing import pack

Bits = NDArray[np.bool_]
Floats = NDArray[np.float64]

#: Fraction of the columns over which the window of the rule of thumb rises and falls.
_RAMP = 0.2

#: Features that are steady for longer, half a second around, are not told apart.
MOST_STEADY = 15


def from_template(
    template: QuantisedTemplate,
    positions: Sequence[int],
    *,
    stiffness: float | Sequence[float],
    groups: Sequence[str | None] | None = None,
    feature_set: FeatureSet = FULL_BODY,
) -> KeyframeQuery:
    """Query of columns of a template.

    Parameters
    ----------
    template : fixed cells are the fixed features of the keyframes
    positions : columns, ascending, from 0; a column may come twice, with another group
    stiffness : of all gaps, or one for each; distances are those of the columns
    groups : per keyframe, the group of features that it keeps (others become free), or
        None for all
    feature_set : says which feature belongs to which group; that of the template

    Raises
    ------
    InvalidInput
        If a position lies outside the template, or a group is unknown.
    """
    if not positions or min(positions) < 0 or max(positions) >= template.n_columns:
        raise InvalidInput(
            f"positions must be columns of the template, 0 to {template.n_columns - 1}, "
            f"got {list(positions)}"
        )
    chosen = list(positions)
    fixed = template.fixed[chosen].copy()
    if groups is not None:
        _check_features(template, feature_set)
        if len(groups) != len(chosen):
            raise InvalidInput(f"{len(chosen)} keyframes need as many groups, got {len(groups)}")
        for row, group in zip(fixed, groups, strict=True):
            if group is not None:
                row &= group_members(group, feature_set)
    gaps = gaps_of([b - a for a, b in itertools.pairwise(chosen)], stiffness)
    return KeyframeQuery(
        pack(template.values[chosen]), pack(fixed), gaps,
        template.feature_set, template.feature_names, tuple(chosen),
    )  # fmt: skip


class Choice(NamedTuple):
    """A column of a template as a keyframe.

    Attributes
    ----------
    position : column, from 0
    group : features that the keyframe keeps
    score : by the rule of thumb
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
    _check_features(template, feature_set)
    groups = list(dict.fromkeys(feature.group for feature in feature_set.features))
    scores = np.stack(
        [_group_scores(template, group_members(g, feature_set), zero_weight) for g in groups]
    )
    choices: list[Choice] = []
    while len(choices) < count and scores.max() > 0.0:
        best, position = np.unravel_index(np.argmax(scores), scores.shape)
        choices.append(Choice(int(position), groups[best], float(scores[best, position])))
        low, high = _neighbourhood(scores[best], int(position), min_distance)
        scores[:, low:high] = 0.0
    return sorted(choices)


def _group_scores(template: QuantisedTemplate, members: Bits, zero_weight: float) -> Floats:
    """Score of every column by the features of one group, shape (columns,)."""
    fixed, values = template.fixed[:, members], template.values[:, members]
    ones = np.count_nonzero(fixed & values, axis=1)
    zeros = np.count_nonzero(fixed & ~values, axis=1)
    score: Floats = (2.0 * ones + zero_weight * zeros) / np.count_nonzero(members)
    # Halves of a Hann window over the first and last fifth, 1 between.
    ramp = int(_RAMP * template.n_columns)
    rise = 0.5 - 0.5 * np.cos(np.pi * np.arange(1, ramp + 1) / (ramp + 1))
    score[:ramp] *= rise
    score[template.n_columns - ramp :] *= rise[::-1]
    return score


def _neighbourhood(scores: Floats, position: int, min_distance: int) -> tuple[int, int]:
    """Columns around a chosen one, half-open: a minimum, then while the score falls."""
    low = max(position - min_distance, 0)
    while low > 0 and scores[low - 1] < scores[low]:
        low -= 1
    high = min(position + min_distance + 1, len(scores))
    while high < len(scores) and scores[high] < scores[high - 1]:
        high += 1
    return low, high


@dataclass(frozen=True, slots=True, eq=False)
class AlignedColumns:
    """Columns of a template with what the aligned examples share there.

    Attributes
    ----------
    frames : array, shape (examples, columns): the frame of each column
    values : array, shape (columns, features): what most examples show
    fraction : array of that shape: fraction of the examples that show it steadily
    tolerance : array of that shape: for how many frames around, in the least steady of the
        examples that show it
    disagreement : array, shape (features,): the fraction of the columns at which one example
        breaks what all others agree on, summed over the examples
    """

    frames: NDArray[np.intp]
    values: Bits
    fraction: Floats
    tolerance: NDArray[np.intp]
    disagreement: Floats

    @property
    def n_columns(self) -> int:
        """Number of columns."""
        return int(self.frames.shape[1])

    def gap(self, first: int, second: int, stiffness: float) -> Gap:
        """Frames between two columns: as in the examples, and looser by a stiffness."""
        distance = self.frames[:, second] - self.frames[:, first]
        least, most = float(distance.min()), float(distance.max())
        return Gap(int(np.floor(stiffness * least)), int(np.ceil(most / stiffness)))


def align_columns(
    template: MotionTemplate, examples: Sequence[FeatureSequence], *, tolerance: int
) -> AlignedColumns:
    """Columns of a template aligned with examples.

    Parameters
    ----------
    template : learned from the examples
    examples : features of each
    tolerance : frames around for which a value must be kept to count as shown
    """
    frames = _align_whole(template, examples)
    pairs = list(zip(examples, frames, strict=True))
    shown = np.array([e.features[at] for e, at in pairs], dtype=np.bool_)
    known = np.array([e.known_features[at] for e, at in pairs], dtype=np.bool_)
    kept = np.array([count_steady(e, at, MOST_STEADY) for e, at in pairs])
    counts = known & (kept >= tolerance)
    on, off = (shown & counts).mean(axis=0), (~shown & counts).mean(axis=0)
    values = on >= off
    least = np.where(shown == values, kept, MOST_STEADY).min(axis=0)
    return AlignedColumns(frames, values, np.maximum(on, off), least, _disagreement(shown))


def _align_whole(template: MotionTemplate, examples: Sequence[FeatureSequence]) -> NDArray[np.intp]:
    """Frame of each column, shape (examples, columns): the middle of those that it meets.

    As in learning, an example begins and ends with the template, and what is unknown is
    half a disagreement with either value.
    """
    n_columns, offset = template.n_columns, template.n_columns
    pairs = []
    for example in examples:
        seen = np.where(example.known_features, example.features, 0.5)
        cost = np.abs(template.values[:, np.newaxis] - seen).sum(axis=2)
        pairs.append(PairCost(cost, 0, offset))
        offset += len(example)
    met = align_batched(iter(pairs))
    of_template = met.reference < n_columns
    columns, rows = met.reference[of_template], met.warped[of_template]
    starts = np.array([pair.second for pair in pairs])
    which = np.searchsorted(starts, rows, side="right") - 1
    total, count = np.zeros((2, len(examples), n_columns))
    np.add.at(total, (which, columns), rows - starts[which])
    np.add.at(count, (which, columns), 1.0)
    return np.floor(total / count + 0.5).astype(np.intp)


def _disagreement(shown: Bits) -> Floats:
    """Per feature: of the columns at which all but one example agree, how many has that one."""
    n, ones = len(shown), shown.sum(axis=0)
    total = np.zeros(shown.shape[2])
    for example in shown if n > 1 else ():
        others = ones - example
        agreed = (others == 0) | (others == n - 1)
        broken = agreed & (example != (others > 0))
        total += broken.sum(axis=0) / np.maximum(agreed.sum(axis=0), 1)
    return total


def _check_features(template: QuantisedTemplate, feature_set: FeatureSet) -> None:
    """Refuse a feature set that is not the template's."""
    if template.feature_names != feature_set.ids:
        raise InvalidInput(
            f"the template is over {template.feature_set!r}, the groups over "
            f"{feature_set.name!r}; pass feature_set=... of the template"
        )
