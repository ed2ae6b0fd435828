"""Which keyframes find all examples of a class and little else?

The rule of thumb of 2006 (see `choosing`) looks at a template alone. Here moments are added
one by one, each the one that leaves least of the counter-examples; then the query forgets
whatever it does not need, the least reliable relations first. Examples are read strictly and
counter-examples loosely (see `steadiness`), so that a person who does the same a little
differently is still found and something else still is not.

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
from motionary.models.keyframes.moments import Moments, find_moments
from motionary.models.keyframes.query import KeyframeQuery
from motionary.models.keyframes.search import search_query
from motionary.models.keyframes.selecting import select_in_index
from motionary.models.keyframes.steadiness import loose_index, strict_index
from motionary.models.keyframes.word_index import PostingIndex
from motionary.models.templates import MotionTemplate
from motionary.packing import pack

Bits = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class ChoiceSettings:
    """How a query is chosen; defaults as measured in docs/evidence/keyframe_choice.md.

    Attributes
    ----------
    frames_left : share of the counter-examples' frames that a query may leave
    least, most : number of keyframes
    tolerance : frames around by which examples are read strictly, counter-examples loosely
    exceptions : share of the examples that may lack a relation of a keyframe; half of it and
        none are tried too
    stiffness : of the gaps, on top of the shortest and longest distance in the examples
    step, min_distance : columns between candidates, and at least between keyframes
    edge : columns at either end of the template that are no candidates
    gain : one keyframe more must leave less than this share of what is left
    disagreement_weight : frames of tolerance that a relation would lose if at every moment a single
        example broke what all others agree on
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
        if (
            min(self.tolerance, self.edge, self.disagreement_weight) < 0
            or min(self.step, self.min_distance) < 1
        ):
            raise InvalidInput(
                "tolerance, edge and disagreement_weight must be at least 0, step and "
                "min_distance at least 1"
            )


class ChosenQuery(NamedTuple):
    """A query and what it does to what it was chosen from.

    Attributes
    ----------
    query : with the template's columns as positions
    left : share of the counter-examples' frames around its hits, read loosely
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
    examples : words of the class
    counterexamples : words of anything else, such as the examples of other classes
    settings : settings

    Raises
    ------
    InvalidInput
        If there are no examples or no counter-examples, they are over different features,
        the examples have nothing in common, or they are too short for the least number of
        keyframes.
    """
    settings = settings or ChoiceSettings()
    _check(template, examples, counterexamples)
    moments = find_moments(template, examples, steady=settings.tolerance)
    trial = _Trial(
        moments, settings, examples[0].feature_set,
        strict_index(examples, settings.tolerance),
        loose_index(counterexamples, settings.tolerance),
    )  # fmt: skip
    draft = _free_entries(trial, _add_moments(trial))
    query = trial.query(draft)
    hit = search_query(query, trial.examples).hit_documents
    missed = sorted(set(range(len(examples))) - set(hit.tolist()))
    return ChosenQuery(query, draft.left, tuple(missed))


@dataclass(frozen=True, slots=True, eq=False)
class _Draft:
    """Columns, the fixed entries of each, and what they do.

    `left` is the share of the counter-examples' frames around hits, `lost` the share of the
    examples without one.
    """

    columns: list[int] = field(default_factory=list)
    fixed: list[Bits] = field(default_factory=list)
    left: float = 1.0
    lost: float = 0.0

    @property
    def loss(self) -> float:
        """An example lost is as bad as its share of all frames left."""
        return self.left + self.lost


@dataclass(frozen=True, slots=True, eq=False)
class _Trial:
    """What queries are tried on."""

    moments: Moments
    settings: ChoiceSettings
    feature_set: FeatureSet
    examples: PostingIndex
    counterexamples: PostingIndex

    def query(self, draft: _Draft) -> KeyframeQuery:
        columns, fixed = draft.columns, np.array(draft.fixed)
        gaps = [
            self.moments.gap(a, b, self.settings.stiffness) for a, b in itertools.pairwise(columns)
        ]
        return KeyframeQuery(
            pack(self.moments.values[columns] & fixed), pack(fixed), tuple(gaps),
            self.feature_set.name, self.feature_set.ids, tuple(columns),
        )  # fmt: skip

    def measure(self, columns: list[int], fixed: list[Bits]) -> _Draft:
        query = self.query(_Draft(columns, fixed))
        around = select_in_index([query], self.moments.n_columns, self.counterexamples)
        left = around.n_frames / self.counterexamples.n_frames
        found = len(search_query(query, self.examples).hit_documents)
        return _Draft(columns, fixed, left, 1.0 - found / self.examples.n_documents)


def _add_moments(trial: _Trial) -> _Draft:
    """Moments that leave least together, each with all that is common there."""
    settings, draft = trial.settings, _Draft()
    candidates = _candidates(trial)
    while len(draft.columns) < settings.most:
        drafts = [
            trial.measure(*more) for more in _one_more(draft, candidates, settings.min_distance)
        ]
        best = min(drafts, key=lambda d: d.loss, default=None)
        enough = len(draft.columns) >= settings.least
        if best is None or (enough and best.loss > settings.gain * draft.loss):
            break
        draft = best
        if len(draft.columns) >= settings.least and draft.left <= settings.frames_left / 2:
            break
    if not draft.columns:
        raise InvalidInput(
            "the examples share no relation that is steady for "
            f"{settings.tolerance} frames around; lower tolerance, or give examples that are alike"
        )
    if len(draft.columns) < settings.least:
        raise InvalidInput(
            f"the examples show {len(draft.columns)} of {settings.least} keyframes that are "
            f"{settings.min_distance} columns apart in {trial.moments.n_columns}; give "
            "longer examples, or lower min_distance or least"
        )
    return draft


def _candidates(trial: _Trial) -> list[tuple[int, Bits]]:
    """Columns with what all examples share there, and with what most do."""
    settings, moments = trial.settings, trial.moments
    edge = min(settings.edge, moments.n_columns // 4)
    found = []
    for column in range(edge, moments.n_columns - edge, settings.step):
        n_fixed = 0
        for dissenters in (0.0, settings.exceptions / 2, settings.exceptions):
            fixed = moments.fraction[column] >= 1.0 - dissenters - 1e-9
            if np.count_nonzero(fixed) > n_fixed:
                found.append((column, fixed))
                n_fixed = int(np.count_nonzero(fixed))
    return found


def _one_more(
    draft: _Draft, candidates: Sequence[tuple[int, Bits]], apart: int
) -> Iterator[tuple[list[int], list[Bits]]]:
    for column, fixed in candidates:
        if all(abs(column - other) >= apart for other in draft.columns):
            at = int(np.searchsorted(draft.columns, column))
            columns = [*draft.columns[:at], column, *draft.columns[at:]]
            yield columns, [*draft.fixed[:at], fixed, *draft.fixed[at:]]


def _free_entries(trial: _Trial, draft: _Draft) -> _Draft:
    """The draft without the entries that it can do without, unreliable ones first."""
    limit = max(trial.settings.frames_left, draft.left)
    for keyframe, feature in _by_reliability(trial, draft):
        fixed = [row.copy() for row in draft.fixed]
        fixed[keyframe][feature] = False
        if not fixed[keyframe].any():
            continue
        freer = trial.measure(draft.columns, fixed)
        if freer.left <= limit or freer.loss < draft.loss:
            draft = freer
    return draft


def _by_reliability(trial: _Trial, draft: _Draft) -> list[tuple[int, int]]:
    moments = trial.moments
    rows = moments.steadiness[draft.columns] - trial.settings.disagreement_weight * moments.dissent
    entries = np.argwhere(np.array(draft.fixed))
    order = np.argsort(rows[entries[:, 0], entries[:, 1]], kind="stable")
    return [(int(k), int(f)) for k, f in entries[order]]


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
                    f"{what} {sequence.source!r} has words of {sequence.feature_set.name!r}, "
                    f"the template is over {template.feature_set!r}"
                )
