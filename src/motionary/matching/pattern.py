"""What is sought: a quantised template as the matcher sees it.

Conventions: K columns of packed relations with a mask of the fixed ones; free cells cost
nothing. The cost of a cell is the share of the column's fixed and known relations that
disagree (Müller and Röder 2006, eq. 1), each entry with its weight, times the mean of the
column's weight and 1.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.words import Words, count, unpack

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Pattern:
    """Columns to be found in documents.

    Attributes
    ----------
    values, fixed : arrays, shape (K, n_words), uint64
        Relations and which of them are fixed; values of free relations are ignored.
    weights : array, shape (K,)
        Time that a column stands for; the matcher takes its mean with 1.
    entry_weights : array, shape (K, n_relations), or None
        Weights of the single entries, for patterns in which what is rare tells more.
    """

    values: Words
    fixed: Words
    weights: Floats
    entry_weights: Floats | None = None
    n_fixed: NDArray[np.int64] = field(init=False)

    def __post_init__(self) -> None:
        if self.values.ndim != 2 or self.values.shape != self.fixed.shape:
            raise InvalidInput(
                "a pattern needs values and fixed of one shape (columns, words), got "
                f"{self.values.shape} and {self.fixed.shape}"
            )
        n_columns = self.values.shape[0]
        if n_columns == 0:
            raise InvalidInput("a pattern needs at least one column, got none")
        if self.weights.shape != (n_columns,) or not (self.weights > 0).all():
            raise InvalidInput(f"a pattern of {n_columns} columns needs as many positive weights")
        if self.entry_weights is not None and not (
            self.entry_weights.shape[0] == n_columns and (self.entry_weights >= 0).all()
        ):
            raise InvalidInput("entry weights need shape (columns, relations) and no negatives")
        object.__setattr__(self, "values", self.values & self.fixed)
        object.__setattr__(self, "n_fixed", count(self.fixed))

    def __len__(self) -> int:
        return self.values.shape[0]

    @property
    def column_weights(self) -> Floats:
        """Factor of each column's cells, shape (K,)."""
        return (self.weights + 1.0) / 2.0


def cell_costs(pattern: Pattern, column: int, words: Words, known: Words) -> Floats:
    """Costs of one column against frames of any leading shape.

    Parameters
    ----------
    words, known : arrays, shape (..., n_words), uint64

    Returns
    -------
    array, shape (...), float64. Unknown entries leave the share; a column of which fewer
    than half of the fixed entries are known costs its whole weight.
    """
    weight = pattern.column_weights[column]
    fixed = pattern.fixed[column]
    n_fixed = int(pattern.n_fixed[column])
    if n_fixed == 0:
        return np.zeros(words.shape[:-1])
    seen = known & fixed
    n_seen = np.bitwise_count(seen).sum(axis=-1, dtype=np.int64)
    if pattern.entry_weights is None:
        wrong = np.bitwise_count((words ^ pattern.values[column]) & seen)
        share = wrong.sum(axis=-1, dtype=np.int64) / np.maximum(n_seen, 1)
    else:
        entries = pattern.entry_weights[column]
        lead = words.shape[:-1]
        flat = ((words ^ pattern.values[column]) & seen).reshape(-1, words.shape[-1])
        # Row sums, not a matrix product: a frame's cost must not depend on its neighbours.
        wrong_weight = (unpack(flat, len(entries)) * entries).sum(axis=1)
        seen_weight = (unpack(seen.reshape(flat.shape), len(entries)) * entries).sum(axis=1)
        share = (wrong_weight / np.where(seen_weight > 0, seen_weight, 1.0)).reshape(lead)
    return np.where(2 * n_seen < n_fixed, 1.0, share) * weight
