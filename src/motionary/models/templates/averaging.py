"""How do aligned examples become one, in real time again?

Warping, averaging and unwarping after Müller and Röder (2006), section 4.1. All three
move weighted columns and lose none: total weight and the weighted sum of every relation
are the same before and after.

The paper does not say how far columns are contracted; that they are merged until they
weigh 0.75, and expanded before and after, is what the authors' published code does.

Conventions: a *stack* holds the columns of all examples below one another; example `i` is
rows `offsets[i]` to `offsets[i + 1]`.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from motionary.models.templates.alignment import Alignment, Floats, Indices


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


def average(stack: Stack, alignment: Alignment) -> Stack:
    """Average of all examples, once for each of them as the reference.

    A column that met `n` columns of the reference gives `1 / n` of its weight to each. (The
    authors' code divides what a column of the reference has collected. With ties going to
    the diagonal no path turns a corner, so both come to the same.)
    """
    # Late, as in `alignment`.
    from scipy.sparse import csr_array

    n_columns = len(stack.weights)
    own = np.arange(n_columns)
    reference = np.concatenate([own, alignment.reference])
    warped = np.concatenate([own, alignment.warped])
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
