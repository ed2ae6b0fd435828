"""A pattern: a quantised template as the matcher sees it.

Conventions: K columns of packed features with a mask of the fixed ones; free cells cost
nothing. The cost of a cell is the fraction of the column's fixed and known features that
disagree (Müller and Röder 2006, eq. 1), each entry with its weight, times the mean of the
column's weight and 1.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.packing import PackedFeatures, count, count_integers, pack

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Pattern:
    """Columns to be found in sequences.

    Attributes
    ----------
    values, fixed : arrays, shape (K, n_integers), uint64
        Relations and which of them are fixed; values of free features are ignored.
    weights : array, shape (K,)
        Time that a column stands for; the matcher takes its mean with 1.
    entry_weights : array, shape (K, n_features), or None
        Weights of the single entries, for patterns in which what is rare tells more. An
        entry of weight 0 is free.
    n_fixed : array, shape (K,), the number of fixed entries
    """

    values: PackedFeatures
    fixed: PackedFeatures
    weights: Floats
    entry_weights: Floats | None = None
    n_fixed: NDArray[np.int64] = field(init=False)

    def __post_init__(self) -> None:
        fixed = _check_fixed(self.values, self.fixed)
        weights = _check_weights(self.weights, n_columns=len(fixed))
        if self.entry_weights is not None:
            entries = _check_entries(self.entry_weights, fixed)
            fixed = fixed & pack(entries > 0)
            object.__setattr__(self, "entry_weights", entries)
        object.__setattr__(self, "values", self.values & fixed)
        object.__setattr__(self, "fixed", fixed)
        object.__setattr__(self, "weights", weights)
        object.__setattr__(self, "n_fixed", count(fixed))

    def __len__(self) -> int:
        return len(self.values)

    @property
    def column_weights(self) -> Floats:
        """Factor of each column's cells, shape (K,)."""
        return (self.weights + 1.0) / 2.0

    def fully_seen(self, known: PackedFeatures) -> bool:
        """Whether every feature that a column fixes is known in all frames."""
        return not (~known & np.bitwise_or.reduce(self.fixed, axis=0)).any()


def cell_costs(
    pattern: Pattern,
    column: int,
    packed: PackedFeatures,
    known: PackedFeatures,
    *,
    tables: Floats | None = None,
) -> Floats:
    """Costs of one column against frames of any leading shape.

    Parameters
    ----------
    packed, known : arrays, shape (..., n_integers), uint64, that broadcast
    tables : `byte_tables` of the pattern's entry weights, if many columns are asked for

    Returns
    -------
    array, shape (...), float64. Unknown entries leave the fraction; a column of which fewer
    than half of the fixed entries are known costs its whole weight.
    """
    seen = known & pattern.fixed[column]
    wrong = (packed ^ pattern.values[column]) & seen
    n_seen = count(seen)
    if pattern.entry_weights is None:
        fraction = count(wrong) / np.maximum(n_seen, 1)
    else:
        own = slice(column, column + 1)
        table = (byte_tables(pattern.entry_weights[own]) if tables is None else tables[own])[0]
        seen_weight = _weigh(seen, table)
        fraction = _weigh(wrong, table) / np.where(seen_weight > 0, seen_weight, 1.0)
    unseen = 2 * n_seen < pattern.n_fixed[column]
    costs: Floats = np.where(unseen, 1.0, fraction) * pattern.column_weights[column]
    return costs


def byte_tables(weights: Floats) -> Floats:
    """Weight of each value of each byte of features, shape (K, bytes, 256).

    Parameters
    ----------
    weights : array, shape (K, features)
    """
    n_bytes = -(-weights.shape[1] // 8)
    by_byte = np.zeros((len(weights), n_bytes * 8))
    by_byte[:, : weights.shape[1]] = weights
    by_byte = by_byte.reshape(len(weights), n_bytes, 8)
    tables = np.zeros((len(weights), n_bytes, 256))
    for bit in range(8):
        half = 1 << bit
        tables[..., half : 2 * half] = tables[..., :half] + by_byte[..., bit, np.newaxis]
    return tables


def check_sequence(pattern: Pattern, packed: PackedFeatures, known: PackedFeatures | None) -> None:
    """Raise InvalidInput unless features and mask have the pattern's form."""
    if packed.ndim != 2 or packed.shape[1] != pattern.values.shape[1]:
        raise InvalidInput(
            f"the pattern has {pattern.values.shape[1]} integers a frame, the sequence has "
            f"shape {packed.shape}; both must come from one feature set"
        )
    if known is not None and known.shape != packed.shape:
        raise InvalidInput(
            f"known needs the shape {packed.shape} of the features, got {known.shape}"
        )


def check_skip_weight(skip_weight: float) -> None:
    """Raise InvalidInput unless the weight is finite and at least 0."""
    if not 0 <= skip_weight < np.inf:
        raise InvalidInput(f"skip_weight must be finite and at least 0, got {skip_weight}")


def _check_fixed(values: PackedFeatures, fixed: PackedFeatures) -> PackedFeatures:
    if values.ndim != 2 or values.shape != fixed.shape:
        raise InvalidInput(
            "a pattern needs values and fixed of one shape (columns, integers), got "
            f"{values.shape} and {fixed.shape}"
        )
    if values.dtype != np.uint64 or fixed.dtype != np.uint64:
        raise InvalidInput(
            f"a pattern needs packed features (uint64), got {values.dtype} and {fixed.dtype}; "
            "see motionary.packing.pack"
        )
    if 0 in values.shape:
        raise InvalidInput(f"a pattern needs at least one column and integer, got {values.shape}")
    return fixed


def _check_weights(weights: Floats, *, n_columns: int) -> Floats:
    weights = np.asarray(weights, dtype=np.float64)
    if weights.shape != (n_columns,) or not ((weights > 0) & np.isfinite(weights)).all():
        raise InvalidInput(
            f"a pattern of {n_columns} columns needs as many finite, positive weights, got "
            f"shape {weights.shape}"
        )
    return weights


def _check_entries(entries: Floats, fixed: PackedFeatures) -> Floats:
    entries = np.asarray(entries, dtype=np.float64)
    form = (len(fixed), fixed.shape[1])
    if entries.ndim != 2 or (len(entries), count_integers(entries.shape[1])) != form:
        raise InvalidInput(
            f"entry weights need shape (columns, features) for {form[0]} columns of {form[1]} "
            f"integers, got {entries.shape}"
        )
    if not ((entries >= 0) & np.isfinite(entries)).all():
        raise InvalidInput("entry weights must be finite and at least 0")
    return entries


def _weigh(packed: PackedFeatures, tables: Floats) -> Floats:
    """Sum of the weights of what is set, in the order of bytes whatever stands beside."""
    as_bytes = np.ascontiguousarray(packed, dtype="<u8").view(np.uint8)
    total = np.zeros(packed.shape[:-1])
    for i, table in enumerate(tables):
        total += table.take(as_bytes[..., i])
    return total
