"""Keyframes chosen by what they keep of examples and leave of counter-examples.

Columns of the class's template are added one by one, each the one that leaves least of the
counter-examples; then the query frees whatever it does not need, the least reliable features
first. Examples are read with a strict index and counter-examples with a loose one, so that a
person who does the same a little differently is still found and something else still is not.

Deterministic: of equal choices the earlier column is taken.
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.features import FeatureSequence, FeatureSet
from motionary.models.keyframes.columns import AlignedColumns, align_columns
from motionary.models.keyframes.index import PostingIndex, loose_index, strict_index
from motionary.models.keyframes.query import KeyframeQuery
from motionary.models.keyframes.search import search_query, select_in_index
from motionary.models.templates import MotionTemplate
from motionary.packing import pack

Bits = NDArray[np.bool_]


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
        if not 0.0 <= self.frames_left < 1.0:
            raise InvalidInput(f"frames_left must lie in [0, 1), got {self.frames_left}")
        if not 1 <= self.least <= self.most:
            raise InvalidInput(f"keyframes need 1 <= least <= most, got {self.least}, {self.most}")
        if not 0.0 < self.stiffness <= 1.0:
            raise InvalidInput(f"stiffness must lie in (0, 1], got {self.stiffness}")
        if not 0.0 <= self.exceptions < 0.5:
            raise InvalidInput(f"exceptions must lie in [0, 0.5), got {self.exceptions}")
        if not 0.0 <= self.gain <= 1.0:
            raise InvalidInput(f"gain must lie in [0, 1], got {self.gain}")
        for name, least in dict(
            tolerance=0, edge=0, disagreement_weight=0, step=1, min_distance=1
        ).items():
            if getattr(self, name) < least:
                raise InvalidInput(f"{name} must be at least {least}, got {getattr(self, name)}")


class ChosenQuery(NamedTuple):
    """A query, with what it leaves of the counter-examples and misses of the examples.

    Attributes
    ----------
    query : with the template's columns as positions
    left : fraction of the counter-examples' frames around its hits, read loosely
    missed : examples without a hit, read strictly
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
    examples : features of motions of the class
    counterexamples : features of anything else, such as the examples of other classes
    settings : the default ones if left out

    Raises
    ------
    InvalidInput
        If there are no examples or no counter-examples, they are over different features,
        the examples have nothing in common, or they are too short for the least number of
        keyframes.
    """
    settings = settings or ChoiceSettings()
    _check(template, examples, counterexamples)
    trial = _Trial(
        align_columns(template, examples, tolerance=settings.tolerance),
        settings,
        examples[0].feature_set,
        strict_index(examples, settings.tolerance),
        loose_index(counterexamples, settings.tolerance),
    )
    draft = _free_entries(trial, _add_columns(trial))
    query = trial.query(draft)
    hit = search_query(query, trial.examples).hit_sequences
    missed = sorted(set(range(len(examples))) - set(hit.tolist()))
    return ChosenQuery(query, draft.left, tuple(missed))


@dataclass(frozen=True, slots=True, eq=False)
class _Draft:
    """Columns, the fixed entries of each, and what they do.

    `left` is the fraction of the counter-examples' frames around hits, `lost` the fraction of
    the examples without one.
    """

    columns: list[int] = field(default_factory=list)
    fixed: list[Bits] = field(default_factory=list)
    left: float = 1.0
    lost: float = 0.0

    @property
    def loss(self) -> float:
        """An example lost is as bad as its fraction of all frames left."""
        return self.left + self.lost


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

    def measure(self, columns: list[int], fixed: list[Bits]) -> _Draft:
        query = self.query(_Draft(columns, fixed))
        around = select_in_index([query], self.aligned.n_columns, self.counterexamples)
        left = around.n_frames / self.counterexamples.n_frames
        found = len(search_query(query, self.examples).hit_sequences)
        return _Draft(columns, fixed, left, 1.0 - found / self.examples.n_sequences)


def _add_columns(trial: _Trial) -> _Draft:
    """Columns that leave least together, each with all that is common there."""
    settings, draft = trial.settings, _Draft()
    candidates = _candidates(trial)
    while len(draft.columns) < settings.most:
        more = _one_more(draft, candidates, settings.min_distance)
        drafts = [trial.measure(*columns) for columns in more]
        best = min(drafts, key=lambda d: d.loss, default=None)
        enough = len(draft.columns) >= settings.least
        if best is None or (enough and best.loss > settings.gain * draft.loss):
            break
        draft = best
        if len(draft.columns) >= settings.least and draft.left <= settings.frames_left / 2:
            break
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


def _one_more(
    draft: _Draft, candidates: Sequence[tuple[int, Bits]], min_distance: int
) -> Iterator[tuple[list[int], list[Bits]]]:
    for column, fixed in candidates:
        if all(abs(column - other) >= min_distance for other in draft.columns):
            at = int(np.searchsorted(draft.columns, column))
            columns = [*draft.columns[:at], column, *draft.columns[at:]]
            yield columns, [*draft.fixed[:at], fixed, *draft.fixed[at:]]


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
        if not fixed[keyframe].any():
            continue
        freer = trial.measure(draft.columns, fixed)
        if freer.left <= limit or freer.loss < draft.loss:
            draft = freer
    return draft


def _check(
    template: MotionTemplate,
    examples: Sequence[FeatureSequence],
    counterexamples: Sequence[FeatureSequence],
) -> None:
    for what, sequences in (("example", examples), ("counter-example", counterexamples)):
        if not sequences:
            raise InvalidInput(f"choosing keyframes needs at least one {what}, got none")
        for sequence in sequences:
            if sequence.feature_set.ids != template.feature_names:
                raise InvalidInput(
                    f"{what} {sequence.source!r} has features of {sequence.feature_set.name!r}, "
                    f"the template is over {template.feature_set!r}"
                )
