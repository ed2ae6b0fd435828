"""Keyframes chosen: by a rule of thumb, or by what they keep of examples and leave of others.

The rule of thumb, after Müller and Röder (2006), section 5.4, and the authors' programs:
columns of a template in which much is fixed, ones counting double, within a group of
features; not at the ends of the template, not beside each other.

With examples, which are aligned with the template, columns are added one by one, each the one
that leaves least of the counter-examples; then the query frees whatever it does not need, the
least reliable features first. Examples are read with a strict index and counter-examples with
a loose one: a person who does the same a little differently is found, something else is not.

Deterministic: of equal choices the earlier column is taken.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.features import FULL_BODY, FeatureSequence, FeatureSet
from motionary.models.keyframes.index import PostingIndex, count_steady, loose_index, strict_index
from motionary.models.keyframes.query import Gap, KeyframeQuery, check_groups, group_members
from motionary.models.keyframes.search import search_query, select_in_index
from motionary.models.templates import MotionTemplate, PairCost, QuantisedTemplate, align_batched
from motionary.packing import pack

Bits = NDArray[np.bool_]
Floats = NDArray[np.float64]

#: Fraction of the columns over which the window of the rule of thumb rises and falls.
_RAMP = 0.2

#: Features that are steady for longer, half a second around, are not told apart.
MOST_STEADY = 15


class Choice(NamedTuple):
    """A column of a template as a keyframe of a group of features, with its score."""

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
    count : at most so many, at least 1; fewer if no column with fixed cells is left
    min_distance : columns around a chosen one that are not chosen
    zero_weight : worth of a fixed zero, a fixed one being worth 2; 1.2 in a variant
    feature_set : says which feature belongs to which group; that of the template
    """
    if count < 1:
        raise InvalidInput(f"count must be at least 1, got {count}")
    check_groups(template, feature_set)
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
    # Values of free cells are False.
    ones = np.count_nonzero(values, axis=1)
    zeros = np.count_nonzero(fixed, axis=1) - ones
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


@dataclass(frozen=True, slots=True)
class ChoiceSettings:
    """Settings of `choose_query`; defaults as measured in docs/evidence/keyframe_choice.md.

    Attributes
    ----------
    frames_left : fraction of the counter-examples' frames that a query may leave
    least, most : number of keyframes
    tolerance : frames around by which examples are read strictly, counter-examples loosely
    exceptions : fraction of the examples that may lack a feature of a keyframe; half of it
        and none are tried too
    stiffness : of the gaps, on top of the shortest and longest distance in the examples
    step, min_distance : columns between candidates, and at least between keyframes
    edge : columns at either end of the template that are no candidates
    gain : one keyframe more must leave less than this fraction of what is left
    disagreement_weight : frames of tolerance that a feature would lose if in every column a
        single example broke what all others agree on
    """

    frames_left: float = 0.02
    least: int = 2
    most: int = 5
    tolerance: int = 2
    exceptions: float = 0.2
    stiffness: float = 0.6
    step: int = 2
    min_distance: int = 6
    edge: int = 3
    gain: float = 0.9
    disagreement_weight: float = 30.0

    def __post_init__(self) -> None:
        if not 1 <= self.least <= self.most:
            raise InvalidInput(f"keyframes need 1 <= least <= most, got {self.least}, {self.most}")
        for name, fits, wanted in (
            ("frames_left", 0.0 <= self.frames_left < 1.0, "lie in [0, 1)"),
            ("stiffness", 0.0 < self.stiffness <= 1.0, "lie in (0, 1]"),
            ("exceptions", 0.0 <= self.exceptions < 0.5, "lie in [0, 0.5)"),
            ("gain", 0.0 <= self.gain <= 1.0, "lie in [0, 1]"),
            ("tolerance", self.tolerance >= 0, "be at least 0"),
            ("edge", self.edge >= 0, "be at least 0"),
            ("disagreement_weight", self.disagreement_weight >= 0, "be at least 0"),
            ("step", self.step >= 1, "be at least 1"),
            ("min_distance", self.min_distance >= 1, "be at least 1"),
        ):
            if not fits:
                raise InvalidInput(f"{name} must {wanted}, got {getattr(self, name)}")


class ChosenQuery(NamedTuple):
    """A query, with what it leaves of the counter-examples and misses of the examples.

    `left` is the fraction of the counter-examples' frames around hits, read loosely; the missed
    examples are read strictly. Positions of the query are columns of the template.
    """

    query: KeyframeQuery
    left: float
    missed: tuple[int, ...]


def choose_query(
    template: MotionTemplate,
    examples: Sequence[FeatureSequence],
    counterexamples: Sequence[FeatureSequence],
    *,
    settings: ChoiceSettings | None = None,
) -> ChosenQuery:
    """Query that finds the examples of a class and leaves little of everything else.

    Parameters
    ----------
    template : learned from the examples
    counterexamples : anything else, such as the examples of other classes

    Raises
    ------
    InvalidInput
        If there are no examples or counter-examples, they are over different features, have
        nothing in common, or are too short for the least number of keyframes.
    """
    settings = settings or ChoiceSettings()
    for what, sequences in (("example", examples), ("counter-example", counterexamples)):
        if not sequences:
            raise InvalidInput(f"choosing keyframes needs at least one {what}, got none")
        for sequence in sequences:
            if sequence.feature_set.ids != template.feature_names:
                raise InvalidInput(
                    f"{what} {sequence.source!r} has features of {sequence.feature_set.name!r}, "
                    f"the template is over {template.feature_set!r}"
                )
    tolerance = settings.tolerance
    trial = _Trial(
        align_columns(template, examples, tolerance=tolerance), settings, examples[0].feature_set,
        strict_index(examples, tolerance), loose_index(counterexamples, tolerance),
    )  # fmt: skip
    draft = _free_entries(trial, _add_columns(trial))
    query = trial.query(draft)
    hit = search_query(query, trial.examples).hit_sequences
    missed = sorted(set(range(len(examples))) - set(hit.tolist()))
    return ChosenQuery(query, draft.left, tuple(missed))


class _Draft(NamedTuple):
    """Columns, the fixed entries of each, and the frames left and examples lost, as fractions."""

    columns: list[int]
    fixed: list[Bits]
    left: float = 1.0
    lost: float = 0.0

    @property
    def loss(self) -> float:
        """An example lost is as bad as its fraction of all frames left."""
        return self.left + self.lost


@dataclass(frozen=True, slots=True, eq=False)
class AlignedColumns:
    """Columns of a template with what the aligned examples share there.

    Attributes
    ----------
    frames : array, shape (examples, columns): the frame of each column
    values, fraction : arrays, shape (columns, features): what most examples show, and the
        fraction of them that show it steadily
    tolerance : array of that shape: for how many frames, in the least steady of them
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


@dataclass(frozen=True, slots=True, eq=False)
class _Trial:
    """What queries are tried on."""

    aligned: AlignedColumns
    settings: ChoiceSettings
    feature_set: FeatureSet
    examples: PostingIndex
    counterexamples: PostingIndex

    def query(self, draft: _Draft) -> KeyframeQuery:
        columns, fixed = draft.columns, np.array(draft.fixed)
        stiffness = self.settings.stiffness
        gaps = tuple(self.aligned.gap(a, b, stiffness) for a, b in itertools.pairwise(columns))
        return KeyframeQuery(
            pack(self.aligned.values[columns] & fixed), pack(fixed), gaps,
            self.feature_set.name, self.feature_set.ids, tuple(columns),
        )  # fmt: skip

    def add(self, draft: _Draft, column: int, fixed: Bits) -> _Draft:
        at = int(np.searchsorted(draft.columns, column))
        columns = [*draft.columns[:at], column, *draft.columns[at:]]
        return self.measure(columns, [*draft.fixed[:at], fixed, *draft.fixed[at:]])

    def measure(self, columns: list[int], fixed: list[Bits]) -> _Draft:
        query = self.query(_Draft(columns, fixed))
        around = select_in_index([query], self.aligned.n_columns, self.counterexamples)
        left = around.n_frames / self.counterexamples.n_frames
        found = len(search_query(query, self.examples).hit_sequences)
        return _Draft(columns, fixed, left, 1.0 - found / self.examples.n_sequences)


def _add_columns(trial: _Trial) -> _Draft:
    """Columns that leave least together, each with all that is common there."""
    settings, draft = trial.settings, _Draft([], [])
    candidates = _candidates(trial)
    while len(draft.columns) < settings.most:
        enough = len(draft.columns) >= settings.least
        if enough and draft.left <= settings.frames_left / 2:
            break
        drafts = [
            trial.add(draft, *candidate)
            for candidate in candidates
            if all(abs(candidate[0] - other) >= settings.min_distance for other in draft.columns)
        ]
        best = min(drafts, key=lambda d: d.loss, default=None)
        if best is None or (enough and best.loss > settings.gain * draft.loss):
            break
        draft = best
    if not draft.columns:
        raise InvalidInput(
            "the examples share no feature that is steady for "
            f"{settings.tolerance} frames around; lower tolerance, or give examples that are alike"
        )
    if len(draft.columns) < settings.least:
        raise InvalidInput(
            f"the examples show {len(draft.columns)} of {settings.least} keyframes that are "
            f"{settings.min_distance} columns apart in {trial.aligned.n_columns}; give longer "
            "examples, or lower min_distance or least"
        )
    return draft


def _candidates(trial: _Trial) -> list[tuple[int, Bits]]:
    """Columns with what all examples share there, and with what most do."""
    settings, aligned = trial.settings, trial.aligned
    edge = min(settings.edge, aligned.n_columns // 4)
    found = []
    for column in range(edge, aligned.n_columns - edge, settings.step):
        n_fixed = 0
        for exceptions in (0.0, settings.exceptions / 2, settings.exceptions):
            fixed = aligned.fraction[column] >= 1.0 - exceptions - 1e-9
            if np.count_nonzero(fixed) > n_fixed:
                found.append((column, fixed))
                n_fixed = int(np.count_nonzero(fixed))
    return found


def _free_entries(trial: _Trial, draft: _Draft) -> _Draft:
    """The draft without the entries that it can do without, unreliable ones first."""
    aligned = trial.aligned
    limit = max(trial.settings.frames_left, draft.left)
    weight = trial.settings.disagreement_weight
    reliability = aligned.tolerance[draft.columns] - weight * aligned.disagreement
    entries = np.argwhere(np.array(draft.fixed))
    order = np.argsort(reliability[entries[:, 0], entries[:, 1]], kind="stable")
    for keyframe, feature in entries[order].tolist():
        fixed = [row.copy() for row in draft.fixed]
        fixed[keyframe][feature] = False
        if fixed[keyframe].any():
            freer = trial.measure(draft.columns, fixed)
            if freer.left <= limit or freer.loss < draft.loss:
                draft = freer
    return draft


# -- columns aligned with examples -------------------------------------------------------


def align_columns(
    template: MotionTemplate, examples: Sequence[FeatureSequence], *, tolerance: int
) -> AlignedColumns:
    """Columns of a template aligned with the examples that it was learned from.

    A value counts as shown if it is kept for `tolerance` frames around.
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
    # Per feature: of the columns at which all but one example agree, how many has that one.
    n, others = len(shown), shown.sum(axis=0) - shown
    agreed = ((others == 0) | (others == n - 1)) & (n > 1)
    broken = agreed & (shown != (others > 0))
    disagreement = (broken.sum(axis=1) / np.maximum(agreed.sum(axis=1), 1)).sum(axis=0)
    return AlignedColumns(frames, values, np.maximum(on, off), least, disagreement)


def _align_whole(template: MotionTemplate, examples: Sequence[FeatureSequence]) -> NDArray[np.intp]:
    """Frame of each column, shape (examples, columns): the middle of those that it meets."""
    n_columns, offset = template.n_columns, template.n_columns
    pairs = []
    for example in examples:
        # As in learning: half a disagreement with either value.
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
