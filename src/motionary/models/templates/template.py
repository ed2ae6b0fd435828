"""Motion templates, their fixed cells, and the patterns that the matcher gets.

A class of motion as a matrix of features over time, after Müller and Röder (2006),
section 4: a cell near 0 or 1 is a feature that all examples share at that moment, a cell
between is one in which they differ.

Conventions: time first, (columns, features); columns at 30 Hz; a tolerance counts
inclusively: at most `tolerance` is 0, at least `1 - tolerance` is 1, the rest is free.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motionary.errors import InvalidInput
from motionary.features import FeatureSet, known_sets
from motionary.matching import Pattern, self_information
from motionary.packing import PackedFeatures, pack

Scalar = TypeVar("Scalar", bound=np.generic)

RATE_HZ = 30.0
#: Longer templates are slips of the pen: ten minutes.
MOST_S = 600.0

#: Averages carry rounding noise: a mean of ten values with a single one may come out as
#: 0.1 + 2e-17 and still is 0.1. Far above such noise, far below what one example can move.
ROUNDING_SLACK = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class MotionTemplate:
    """What the examples of one class of motion have in common.

    Attributes
    ----------
    values : array, shape (columns, features), float64, in [0, 1]
        Fraction of the examples in which the feature holds; read-only.
    weights : array, shape (columns,), float64, positive
        Time a column stands for, in columns of 30 Hz; read-only.
    feature_names : names of the features, in the order of `values`
    feature_set : name of the set that they belong to
    provenance : where the template comes from, in words
    n_examples : number of examples it was learned from
    unmeasured : names of the features that no example shows; free for want of knowledge, not
        because examples differ
    """

    values: NDArray[np.float64]
    weights: NDArray[np.float64]
    feature_names: tuple[str, ...]
    feature_set: str
    provenance: str = ""
    n_examples: int = 1
    unmeasured: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        values = check_values(self.values)
        names = _check_names(self.feature_names, n_features=values.shape[1])
        if not self.feature_set:
            raise InvalidInput("a template needs the name of its feature set, got an empty one")
        if self.n_examples < 1:
            raise InvalidInput(
                f"a template needs n_examples of at least 1, got {self.n_examples}", key="examples"
            )
        if not set(self.unmeasured) <= set(names):
            strange = sorted(set(self.unmeasured) - set(names))
            raise InvalidInput(
                f"unmeasured must name features of the template, got {strange}", key="unmeasured"
            )
        # What is fixed by hand afterwards, or known of other examples, is no longer unknown.
        unknown = dict(zip(names, (values == 0.5).all(axis=0).tolist(), strict=True))
        object.__setattr__(self, "unmeasured", tuple(n for n in self.unmeasured if unknown[n]))
        object.__setattr__(self, "values", values)
        object.__setattr__(self, "weights", _check_weights(self.weights, n_columns=len(values)))
        object.__setattr__(self, "feature_names", names)

    def __repr__(self) -> str:
        return (
            f"MotionTemplate({self.n_columns} columns, {self.duration_s:.2f} s, "
            f"{self.n_features} features of {self.feature_set!r}, {self.n_examples} examples)"
        )

    @property
    def n_columns(self) -> int:
        """Number of columns."""
        return len(self.values)

    @property
    def n_features(self) -> int:
        """Number of features."""
        return len(self.feature_names)

    @property
    def rate_hz(self) -> float:
        """Columns per second: 30."""
        return RATE_HZ

    @property
    def duration_s(self) -> float:
        """Time that the columns stand for: the mean length of the examples, in seconds."""
        return float(self.weights.sum()) / RATE_HZ


@dataclass(frozen=True, slots=True, eq=False)
class QuantisedTemplate:
    """A template whose cells are 0, 1 or free.

    An all-free template is legal; `n_fixed` tells.

    Attributes
    ----------
    values : array, shape (columns, features), bool
        Value of the fixed cells, False in free ones; read-only.
    fixed : array, shape (columns, features), bool
        Which cells are fixed; read-only.
    weights : array, shape (columns,), float64, positive
    feature_names, feature_set : as in `MotionTemplate`
    packed_values, packed_fixed : array, shape (columns, n_words), uint64
        `values` and `fixed`, packed.
    """

    values: NDArray[np.bool_]
    fixed: NDArray[np.bool_]
    weights: NDArray[np.float64]
    feature_names: tuple[str, ...]
    feature_set: str
    packed_values: PackedFeatures = field(init=False, repr=False)
    packed_fixed: PackedFeatures = field(init=False, repr=False)

    def __post_init__(self) -> None:
        fixed = np.array(self.fixed, dtype=np.bool_)
        values = np.array(self.values, dtype=np.bool_)
        if values.ndim != 2 or 0 in values.shape or values.shape != fixed.shape:
            raise InvalidInput(
                "values and fixed need the same shape (columns, features), each at least 1, "
                f"got {values.shape} and {fixed.shape}"
            )
        values &= fixed
        names = _check_names(self.feature_names, n_features=values.shape[1])
        object.__setattr__(self, "values", _read_only(values))
        object.__setattr__(self, "fixed", _read_only(fixed))
        object.__setattr__(self, "weights", _check_weights(self.weights, n_columns=len(values)))
        object.__setattr__(self, "feature_names", names)
        object.__setattr__(self, "packed_values", _read_only(pack(values)))
        object.__setattr__(self, "packed_fixed", _read_only(pack(fixed)))

    @property
    def n_columns(self) -> int:
        """Number of columns."""
        return len(self.values)

    @property
    def n_features(self) -> int:
        """Number of features."""
        return len(self.feature_names)

    @property
    def n_fixed(self) -> int:
        """Number of fixed cells; 0 for a template that matches everything."""
        return int(np.count_nonzero(self.fixed))

    @property
    def fraction_fixed(self) -> float:
        """Fraction of the cells that are fixed."""
        return self.n_fixed / self.fixed.size


def quantise(template: MotionTemplate, *, tolerance: float) -> QuantisedTemplate:
    """Template of fixed and free cells.

    Parameters
    ----------
    tolerance : float, in [0, 0.5)
        A cell of at most `tolerance` becomes 0, of at least `1 - tolerance` becomes 1, both
        inclusive and with a slack of 1e-9 for the rounding of averages; others become free.
        0.1 in Müller and Röder (2006), 0.05 in Müller, Baak and Seidel (2009).

    Raises
    ------
    InvalidInput
        If the tolerance lies outside [0, 0.5).
    """
    if not 0.0 <= tolerance < 0.5:
        raise InvalidInput(
            f"tolerance needs to be at least 0 and below 0.5, got {tolerance}; "
            "at 0.5 a cell would be 0 and 1 at once"
        )
    ones = template.values >= 1.0 - tolerance - ROUNDING_SLACK
    zeros = template.values <= tolerance + ROUNDING_SLACK
    return QuantisedTemplate(
        values=ones,
        fixed=ones ^ zeros,
        weights=template.weights,
        feature_names=template.feature_names,
        feature_set=template.feature_set,
    )


def pattern_of(template: QuantisedTemplate, *, ones: NDArray[np.float64] | None = None) -> Pattern:
    """Pattern of a quantised template.

    Parameters
    ----------
    ones : array, shape (features,), optional
        Fraction of frames in which each feature holds in the searched recordings. With it,
        entries weigh their self-information, and columns the sum of theirs over the mean.
    """
    if ones is None:
        return Pattern(template.packed_values, template.packed_fixed, template.weights)
    entries = self_information(template.values, ones)
    totals = (entries * template.fixed).sum(axis=1)
    mean = totals.mean()
    # A column that tells nothing still takes time: its weight stays above zero.
    weights = np.maximum(totals / mean, 1e-6) if mean > 0 else np.ones(len(totals))
    return Pattern(template.packed_values, template.packed_fixed, weights, entries)


def mirror(template: MotionTemplate, order: ArrayLike) -> MotionTemplate:
    """Template of the mirrored motion; names of features stay where they are.

    Parameters
    ----------
    order : array, shape (features,), of int
        Feature that takes the place of each: the partner of the other side, or the feature
        itself; must be a swap of pairs
    """
    partners = np.asarray(order)
    identity = np.arange(template.n_features)
    is_order = partners.shape == identity.shape and np.issubdtype(partners.dtype, np.integer)
    if not is_order or not np.array_equal(np.sort(partners), identity):
        raise InvalidInput(
            f"order needs to name each of the template's {template.n_features} features once, "
            f"got {order!r}"
        )
    if not np.array_equal(partners[partners], identity):
        raise InvalidInput(
            "order needs to swap pairs, so that mirroring twice gives the template back, "
            f"got {order!r}"
        )
    origin = template.provenance or "a template of unknown origin"
    return replace(
        template,
        values=template.values[:, partners],
        provenance=f"mirror image of {origin}",
        unmeasured=tuple(
            name
            for name, partner in zip(template.feature_names, partners, strict=True)
            if template.feature_names[partner] in template.unmeasured
        ),
    )


def count_columns(seconds: float, *, least: int = 1) -> int:
    """Columns of a segment of so many seconds, at least `least` of them and ten minutes at most."""
    if not 0.0 <= seconds <= MOST_S:
        raise InvalidInput(f"a template needs times from 0 to {MOST_S:g} s, got {seconds:g}")
    columns = math.floor(seconds * RATE_HZ + 0.5)
    if columns < least:
        raise InvalidInput(
            f"a segment needs at least {least / RATE_HZ:.2f} s ({least} column), got {seconds:g}"
        )
    return columns


def fit_columns(least_s: float, most_s: float) -> int:
    """Columns of a segment that matches any length of a range, and as little more as can be.

    Matching takes from half to double of a segment (steps (1, 1), (1, 2), (2, 1)): the length
    whose half and double cover the range; one that is too wide is refused.
    """
    if not 0.0 < least_s <= most_s:
        raise InvalidInput(
            f"a range of lengths needs 0 < least <= most, got {least_s:g} to {most_s:g} s"
        )
    least, most = count_columns(least_s), count_columns(most_s)
    # K columns match 1 + ceil((K - 1) / 2) to 2 K - 1 frames.
    fewest, greatest = math.ceil((most + 1) / 2), 2 * least - 1
    if fewest > greatest:
        raise InvalidInput(
            f"{least_s:g} to {most_s:g} s is too wide: a segment matches from half to double of "
            "its length, so the longest may be nearly four times the shortest; "
            "for wider gaps make a keyframe query"
        )
    return min(max(math.floor(math.sqrt(least * most) + 0.5), fewest), greatest)


def show_seconds(columns: int) -> str:
    """Seconds of so many columns, as short as finds the columns again."""
    # Two digits do: a column is 0.033 s long.
    text = f"{columns / RATE_HZ:.2f}"
    return text.rstrip("0").rstrip(".")


def find_set(template: MotionTemplate, *, feature_set: FeatureSet | None = None) -> FeatureSet:
    """The set of a template's features: the given one if it is, or the known one of its name."""
    features = feature_set or known_sets().get(template.feature_set)
    if features is None:
        raise InvalidInput(
            f"the feature set {template.feature_set!r} is not known; pass feature_set=..."
        )
    if features.ids != template.feature_names:
        raise InvalidInput(
            f"the template has the features of {template.feature_set!r}, not those of "
            f"{features.name!r}; pass feature_set=... of the template"
        )
    return features


def check_values(values: ArrayLike) -> NDArray[np.float64]:
    """Read-only copy of template values, shape (columns, features), clipped to [0, 1]."""
    matrix = np.array(values, dtype=np.float64)
    if matrix.ndim != 2 or 0 in matrix.shape:
        raise InvalidInput(
            "a template needs values of shape (columns, features), each at least 1, "
            f"got {matrix.shape}"
        )
    in_range = (matrix >= -ROUNDING_SLACK) & (matrix <= 1.0 + ROUNDING_SLACK)
    if not in_range.all():
        raise InvalidInput(
            "template values need to be numbers in [0, 1], "
            f"got {matrix[~in_range][0]} and {np.count_nonzero(~in_range) - 1} more outside"
        )
    return _read_only(np.clip(matrix, 0.0, 1.0))


def check_same_features(templates: Sequence[MotionTemplate]) -> None:
    """Refuse to put templates over different features together."""
    first = templates[0]
    for other in templates[1:]:
        if (other.feature_set, other.feature_names) != (first.feature_set, first.feature_names):
            raise InvalidInput(
                f"templates need the same features to be put together, got "
                f"{first.feature_set!r} ({first.n_features}) and {other.feature_set!r} "
                f"({other.n_features}); learn both with one feature set"
            )


def _check_weights(weights: ArrayLike, *, n_columns: int) -> NDArray[np.float64]:
    array = np.array(weights, dtype=np.float64)
    if array.shape != (n_columns,):
        raise InvalidInput(
            f"a template of {n_columns} columns needs weights of shape ({n_columns},), "
            f"got {array.shape}"
        )
    if not (np.isfinite(array) & (array > 0.0)).all():
        raise InvalidInput("column weights need to be positive and finite, got some that are not")
    return _read_only(array)


def _check_names(names: Sequence[str], *, n_features: int) -> tuple[str, ...]:
    if len(names) != n_features or len(set(names)) != n_features:
        raise InvalidInput(
            f"{n_features} features need as many different names, "
            f"got {len(names)} ({len(set(names))} different)"
        )
    return tuple(names)


def _read_only(array: NDArray[Scalar]) -> NDArray[Scalar]:
    array.flags.writeable = False
    return array
