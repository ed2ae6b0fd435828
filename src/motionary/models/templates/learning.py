"""Motion templates learned from the examples of a class.

After Müller and Röder (2006), section 4.1: every example in turn is the reference to which
all others are warped; the averages, brought back to real time, are the examples of the next
pass, until they agree. The template is what the first example has become. Warping, averaging
and unwarping move weighted columns and lose none: total weight and the weighted sum of every
feature are the same before and after.

Where the paper is silent (ties, contraction, stop rule), the authors' published code decides:
columns are merged until they weigh 0.75, and expanded before and after.

Conventions: a *stack* holds the columns of all examples below one another; example `i` is
rows `offsets[i]` to `offsets[i + 1]`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motionary.errors import InvalidInput
from motionary.features import FeatureSequence
from motionary.models.templates.alignment import (
    Engine,
    EngineName,
    Floats,
    Indices,
    MatchedColumns,
    align_all,
    align_batched,
    choose_engine,
)
from motionary.models.templates.template import MotionTemplate, check_same_features, check_values

#: Two templates are averaged as up to so many copies, in the ratio of their examples.
_MOST_COPIES = 20


@dataclass(frozen=True, slots=True)
class Learning:
    """Settings of learning; defaults of the authors' published code.

    Attributes
    ----------
    stop : learning ends after a pass whose highest-cost alignment costs at most this much per
        column, in features
    max_passes : it ends after so many passes in any case
    contract_at : columns are merged until they weigh this much
    """

    stop: float = 0.005
    max_passes: int = 10
    contract_at: float = 0.75

    def __post_init__(self) -> None:
        if not self.stop >= 0.0:
            raise InvalidInput(f"stop needs to be at least 0, got {self.stop}")
        if self.max_passes < 1:
            raise InvalidInput(f"max_passes needs to be at least 1, got {self.max_passes}")
        if not 0.0 < self.contract_at <= 1.0:
            raise InvalidInput(f"contract_at needs to lie in (0, 1], got {self.contract_at}")


class Stack(NamedTuple):
    """Columns of several examples: `columns` (n, width), `weights` (n,), `offsets`."""

    columns: Floats
    weights: Floats
    offsets: Indices

    @property
    def n_examples(self) -> int:
        """Number of examples."""
        return len(self.offsets) - 1

    @property
    def mean_weight(self) -> float:
        """Mean of the examples' total weights: their mean length, in columns of 30 Hz."""
        return float(self.weights.sum()) / self.n_examples


def learn_template(
    matrices: Sequence[ArrayLike],
    *,
    feature_names: Sequence[str],
    feature_set: str,
    provenance: str = "",
    known: Sequence[ArrayLike] | None = None,
    learning: Learning | None = None,
    engine: EngineName = "auto",
) -> MotionTemplate:
    """Template of a class of motion from its examples.

    A single example is its own template.

    Parameters
    ----------
    matrices : sequence of arrays, shape (frames, features), in [0, 1], at 30 Hz
        One per example; the first one's timing is where the template starts from.
    feature_names, feature_set, provenance : as in `MotionTemplate`
    known : sequence of bool arrays of the same shapes, optional
        False where an entry was not seen. Such entries leave the averages; when examples
        are aligned they count as 0.5, half a disagreement with either value. A cell that no
        example knows becomes 0.5, which quantising leaves free.
    learning : Learning, optional
    engine : "auto", "numpy" or "compiled"
        The compiled engine needs the extra `fast`; results are equal to the bit. "auto"
        takes it where it is installed and the work outweighs the time to load it.

    Raises
    ------
    InvalidInput
        If there is no example, if examples disagree in their features or with `known`, or
        if values lie outside [0, 1].
    """
    settings = learning or Learning()
    examples = _check_examples(matrices)
    n_features = examples[0].shape[1]
    columns = examples
    unmeasured: tuple[str, ...] = ()
    if known is not None:
        columns = _with_fractions(examples, known)
        never = ~np.concatenate(columns)[:, n_features:].any(axis=0)
        unmeasured = tuple(np.array(feature_names)[never].tolist())
    stack = _stack(columns, [np.ones(len(example)) for example in examples])
    stack = repeat_passes(stack, n_features, settings, choose_engine(engine, stack.offsets))
    end = stack.offsets[1]
    return MotionTemplate(
        values=_values(stack.columns[:end], n_features),
        weights=stack.weights[:end],
        feature_names=tuple(feature_names),
        feature_set=feature_set,
        provenance=provenance,
        n_examples=len(examples),
        unmeasured=unmeasured,
    )


def template_of(
    examples: Sequence[FeatureSequence], *, provenance: str = "", learning: Learning | None = None
) -> MotionTemplate:
    """Template learned from the packed features of examples, of one feature set."""
    feature_set = examples[0].feature_set
    every = all(bool(one.known_features.all()) for one in examples)
    return learn_template(
        [one.features for one in examples],
        known=None if every else [one.known_features.astype(np.bool_) for one in examples],
        feature_names=feature_set.ids,
        feature_set=feature_set.name,
        provenance=provenance,
        learning=learning,
    )


def join(
    first: MotionTemplate, second: MotionTemplate, *, learning: Learning | None = None
) -> MotionTemplate:
    """One template for two classes: what separates them becomes free.

    Learned from the two templates as if they were examples, each with the weight of the
    examples that it stands for, rounded to twentieths. Where the examples are at hand,
    learn from all of them instead: `learn_template`.

    Raises
    ------
    InvalidInput
        If the templates are over different features.
    """
    check_same_features([first, second])
    n_examples = first.n_examples + second.n_examples
    fraction = Fraction(first.n_examples, n_examples).limit_denominator(_MOST_COPIES)
    fraction = min(max(fraction, Fraction(1, _MOST_COPIES)), 1 - Fraction(1, _MOST_COPIES))
    copies = [first] * fraction.numerator + [second] * (fraction.denominator - fraction.numerator)
    stack = _stack([t.values for t in copies], [t.weights for t in copies])
    stack = repeat_passes(stack, first.n_features, learning or Learning(), align_batched)
    end = stack.offsets[1]
    names = [t.provenance or "a template" for t in (first, second)]
    return replace(
        first,
        values=stack.columns[:end],
        weights=stack.weights[:end],
        provenance=f"joined from: {names[0]}; {names[1]}",
        n_examples=n_examples,
        unmeasured=tuple(name for name in first.unmeasured if name in second.unmeasured),
    )


def _stack(columns: Sequence[Floats], weights: Sequence[Floats]) -> Stack:
    offsets = np.cumsum([0, *map(len, columns)]).astype(np.intp)
    return Stack(np.concatenate(columns), np.concatenate(weights), offsets)


def repeat_passes(stack: Stack, n_features: int, settings: Learning, engine: Engine) -> Stack:
    """Stack after passes until they agree, cost the same twice, or are `max_passes`."""
    mean_weight = stack.mean_weight
    cost_before = np.inf
    for _ in range(settings.max_passes):
        stack, cost = learn_pass(
            stack, n_features=n_features, contract_at=settings.contract_at, engine=engine
        )
        if cost / mean_weight <= settings.stop or cost == cost_before:
            break
        cost_before = cost
    return stack


def learn_pass(
    stack: Stack, *, n_features: int, contract_at: float, engine: Engine
) -> tuple[Stack, float]:
    """Stack of the next pass, and the highest cost of an alignment.

    Every example is the reference of all others, averaged and unwarped. Columns hold the
    values, shape (n, features); or, where entries are unknown, values times the known fraction
    and next to them that fraction, (n, 2 * features).
    """
    values = _values(stack.columns, n_features)
    matched = align_all(values, stack.weights, stack.offsets, engine=engine)
    averaged = average(stack, matched)
    return unwarp(averaged, contract_at=contract_at), matched.largest_cost


def _values(columns: Floats, n_features: int) -> Floats:
    """Values of columns that may carry the known fraction beside them."""
    if columns.shape[1] == n_features:
        return columns
    weighted, fraction = columns[:, :n_features], columns[:, n_features:]
    values = np.full(weighted.shape, 0.5)
    np.divide(weighted, fraction, out=values, where=fraction > 0.0)
    return values


def _check_examples(matrices: Sequence[ArrayLike]) -> list[Floats]:
    if len(matrices) == 0:
        raise InvalidInput("learning needs at least one example, got none")
    examples = [check_values(matrix) for matrix in matrices]
    widths = sorted({example.shape[1] for example in examples})
    if len(widths) > 1:
        raise InvalidInput(
            f"examples need the same features, got examples of {widths} features; "
            "compute all of them with one feature set"
        )
    return examples


def _with_fractions(examples: list[Floats], known: Sequence[ArrayLike]) -> list[Floats]:
    masks: list[NDArray[np.bool_]] = [np.asarray(mask, dtype=np.bool_) for mask in known]
    shapes = [example.shape for example in examples]
    if [mask.shape for mask in masks] != shapes:
        raise InvalidInput(
            f"known needs one mask per example, of shapes {shapes}, "
            f"got {[mask.shape for mask in masks]}"
        )
    return [
        np.concatenate([example * mask, mask], axis=1)
        for example, mask in zip(examples, masks, strict=True)
    ]


# -- warping and averaging ----------------------------------------------------------------


def average(stack: Stack, matched: MatchedColumns) -> Stack:
    """Average of all examples, once for each of them as the reference.

    A column that met `n` columns of the reference gives `1 / n` of its weight to each. (The
    authors' code divides what a column of the reference has collected. With ties going to
    the diagonal no path turns a corner, so both come to the same.)
    """
    # Late: a quarter of a second that who only uses templates need not wait.
    from scipy.sparse import csr_array

    n_columns = len(stack.weights)
    own = np.arange(n_columns)
    reference = np.concatenate([own, matched.reference])
    warped = np.concatenate([own, matched.warped])
    example = np.searchsorted(stack.offsets, reference, side="right") - 1
    meeting = example * n_columns + warped
    shared_by = np.bincount(meeting, minlength=stack.n_examples * n_columns)[meeting]
    given = csr_array(
        (stack.weights[warped] / shared_by, (reference, warped)), shape=(n_columns, n_columns)
    )
    collected = given @ np.ones(n_columns)
    columns = (given @ stack.columns) / collected[:, None]
    return Stack(columns, collected / stack.n_examples, stack.offsets)


def unwarp(stack: Stack, *, contract_at: float) -> Stack:
    """The same motions with columns that each stand for about one frame of 30 Hz."""
    return expand(contract(expand(stack), contract_at=contract_at))


def expand(stack: Stack) -> Stack:
    """Columns repeated as often as they weigh, halves up, at least once; weight shared."""
    repeats = np.maximum(np.floor(stack.weights + 0.5), 1.0).astype(np.intp)
    ends = np.concatenate([np.zeros(1, dtype=np.intp), np.cumsum(repeats)])
    return Stack(
        np.repeat(stack.columns, repeats, axis=0),
        np.repeat(stack.weights / repeats, repeats),
        ends[stack.offsets],
    )


def contract(stack: Stack, *, contract_at: float) -> Stack:
    """Columns merged from the left until they weigh `contract_at`.

    A remainder at the end of an example joins the column before it.
    """
    starts: list[int] = []
    weights = stack.weights.tolist()
    for begin, end in pairwise(stack.offsets.tolist()):
        merged = _starts(weights[begin:end], contract_at)
        starts.extend(begin + start for start in merged)
    totals = np.add.reduceat(stack.weights, starts)
    sums = np.add.reduceat(stack.columns * stack.weights[:, None], starts, axis=0)
    return Stack(sums / totals[:, None], totals, np.searchsorted(starts, stack.offsets))


def _starts(weights: list[float], contract_at: float) -> list[int]:
    """First of each group of columns that are merged into one."""
    starts = []
    gathered = 0.0
    for column, weight in enumerate(weights):
        if gathered == 0.0:
            starts.append(column)
        gathered += weight
        if gathered >= contract_at:
            gathered = 0.0
    if gathered > 0.0 and len(starts) > 1:
        starts.pop()
    return starts
