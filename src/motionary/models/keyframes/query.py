"""Keyframe queries: poses with elastic gaps; mirrored, joined, of templates and as templates.

A query is a sequence of keyframes, each a pose of which some features are fixed and the
others free, and of gaps: how many frames may lie between neighbours. After Baak, Müller and
Seidel (2008), section 3.2; gaps as in Baak (2012), eq. 4.3.

Conventions: a gap counts frames from one keyframe to the next and includes both its ends;
0 means the same frame. Template positions count columns from 0.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.features import FULL_BODY, SEQUENCE_HZ, FeatureSet
from motionary.models.templates import QuantisedTemplate
from motionary.packing import PackedFeatures, count_integers, full_mask, pack, permute, unpack

#: A product such as 0.7 * 10 may come out beside the whole number that it means.
_SLACK = 1e-9

#: Seconds are written with few digits; so many frames beside a frame still mean that frame.
_SNAP = 0.05

#: Longer than any recording: gaps beyond are a mistake for "no bound".
_LONGEST = 1 << 40


class Gap(NamedTuple):
    """How many frames may lie between two neighbouring keyframes.

    Attributes
    ----------
    least, most : frames, both included; most is None where there is no bound
    """

    least: int
    most: int | None


class Spring(NamedTuple):
    """A gap as distance and stiffness: from `stiffness * distance` to `distance / stiffness`."""

    distance: float
    stiffness: float


@dataclass(frozen=True, slots=True, eq=False)
class KeyframeQuery:
    """Keyframes in their order, and the gaps between them.

    Attributes
    ----------
    values, fixed : arrays, shape (K, n_integers), uint64
        Packed features of each keyframe and which of them are fixed; read-only.
    gaps : K - 1 gaps
    feature_set : name of the set of the features
    feature_ids : its ids, in the order of the bits
    positions : columns of the template that the keyframes come from, or None
    """

    values: PackedFeatures
    fixed: PackedFeatures
    gaps: tuple[Gap, ...]
    feature_set: str
    feature_ids: tuple[str, ...]
    positions: tuple[int, ...] | None = None

    def __post_init__(self) -> None:
        values, fixed = _check_packed(self.values, self.fixed, n_features=len(self.feature_ids))
        n_keyframes = len(values)
        object.__setattr__(self, "values", values)
        object.__setattr__(self, "fixed", fixed)
        object.__setattr__(self, "feature_ids", tuple(self.feature_ids))
        object.__setattr__(self, "gaps", _check_gaps(self.gaps, n_keyframes=n_keyframes))
        if self.positions is not None:
            positions = _check_positions(self.positions, n_keyframes=n_keyframes)
            object.__setattr__(self, "positions", positions)

    def __len__(self) -> int:
        return len(self.values)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, KeyframeQuery):
            return NotImplemented
        return self._key() == other._key()

    def __hash__(self) -> int:
        return hash(self._key())

    def _key(self) -> tuple[object, ...]:
        packed = self.values.shape, self.values.tobytes(), self.fixed.tobytes()
        return (*packed, self.gaps, self.feature_set, self.feature_ids, self.positions)

    @property
    def springs(self) -> tuple[Spring, ...]:
        """The gaps as distance and stiffness (Baak 2012, eqs 4.7 and 4.8)."""
        return tuple(spring_of(gap) for gap in self.gaps)


def spring_of(gap: Gap) -> Spring:
    """Distance and stiffness of a gap; `gap_of` gives the gap back.

    A gap of 0 to `most` frames is no spring: its view is that of 0 to infinity, unless
    `most` is 0 too (distance 0, stiffness 1).
    """
    if gap.most is None:
        # Any stiffness above 0 bounds a gap, so this view does not hold `least`.
        return Spring(math.inf, 0.0)
    if gap.most == 0:
        return Spring(0.0, 1.0)
    return Spring(math.sqrt(gap.least * gap.most), math.sqrt(gap.least / gap.most))


def gap_of(distance: float, stiffness: float) -> Gap:
    """Gap of a spring: from `ceil(stiffness * distance)` to `floor(distance / stiffness)`.

    Parameters
    ----------
    distance : frames between the keyframes, at least 0
    stiffness : in [0, 1]; 0 leaves the gap without an upper bound

    Raises
    ------
    InvalidInput
        If distance or stiffness lie outside these ranges.
    """
    if not 0.0 <= stiffness <= 1.0:
        raise InvalidInput(f"stiffness must lie between 0 and 1, got {stiffness}")
    if not distance >= 0.0:
        raise InvalidInput(f"distance must be at least 0 frames, got {distance}")
    if stiffness == 0.0:
        return Gap(0, None)
    if math.isinf(distance):
        raise InvalidInput("an infinite distance needs a stiffness of 0")
    least = math.ceil(stiffness * distance - _SLACK)
    return Gap(least, math.floor(distance / stiffness + _SLACK))


def gaps_of(distances: Sequence[float], stiffness: float | Sequence[float]) -> tuple[Gap, ...]:
    """Gaps of several springs, of one stiffness or one each."""
    each = stiffness if isinstance(stiffness, Sequence) else [stiffness] * len(distances)
    if len(each) != len(distances):
        raise InvalidInput(f"{len(distances)} gaps need as many stiffness values, got {len(each)}")
    return tuple(itertools.starmap(gap_of, zip(distances, each, strict=True)))


def gap_of_seconds(least_s: float, most_s: float, *, rate_hz: float) -> Gap:
    """Gap of at least and at most so many seconds; infinity means no upper bound.

    Raises
    ------
    InvalidInput
        If the bounds contradict each other, or no frame lies between them.
    """
    if not 0.0 <= least_s < math.inf or not least_s <= most_s:
        raise InvalidInput(f"a gap needs 0 <= least <= most, got {least_s} to {most_s} s")
    least = math.ceil(least_s * rate_hz - _SNAP)
    if math.isinf(most_s):
        return Gap(least, None)
    most = math.floor(most_s * rate_hz + _SNAP)
    if most < least:
        raise InvalidInput(
            f"no frame of {rate_hz:g} Hz lies between {least_s:g} and {most_s:g} s; "
            f"frames are {1.0 / rate_hz:.3f} s apart"
        )
    return Gap(least, most)


def from_template(
    template: QuantisedTemplate,
    positions: Sequence[int],
    *,
    stiffness: float | Sequence[float],
    groups: Sequence[str | None] | None = None,
    feature_set: FeatureSet = FULL_BODY,
) -> KeyframeQuery:
    """Query of columns of a template; fixed cells are the fixed features of the keyframes.

    Parameters
    ----------
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
        check_groups(template, feature_set)
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


def template_of_query(query: KeyframeQuery) -> QuantisedTemplate:
    """Template of the keyframe columns, free in between.

    Columns stand at the positions that the keyframes had in their template, or else at the
    distances that their gaps are made for; a gap without upper bound is as short as it may
    be. Keyframes of one frame share a column.

    Raises
    ------
    InvalidInput
        If keyframes of one frame contradict each other.
    """
    columns = columns_of_query(query)
    n_features = len(query.feature_ids)
    values, fixed = np.zeros((2, columns[-1] + 1, n_features), dtype=np.bool_)
    keyframes = zip(unpack(query.values, n_features), unpack(query.fixed, n_features), strict=True)
    for k, (column, (value, is_fixed)) in enumerate(zip(columns, keyframes, strict=True)):
        if (fixed[column] & is_fixed & (values[column] ^ value)).any():
            raise InvalidInput(f"keyframe {k + 1} contradicts the one before it in the same frame")
        values[column] |= value
        fixed[column] |= is_fixed
    weights = np.ones(len(values))
    return QuantisedTemplate(values, fixed, weights, query.feature_ids, query.feature_set)


def columns_of_query(query: KeyframeQuery) -> list[int]:
    """Column of each keyframe in `template_of_query`, the first at 0."""
    if query.positions is not None:
        return [position - query.positions[0] for position in query.positions]
    return list(itertools.accumulate(map(_typical, query.gaps), initial=0))


def mirror_query(query: KeyframeQuery, feature_set: FeatureSet = FULL_BODY) -> KeyframeQuery:
    """Query of the mirrored motion: left and right exchanged.

    Raises
    ------
    InvalidInput
        If the query is over another set of features.
    """
    check_features(query, feature_set.name, feature_set.ids)
    order = feature_set.mirror_order
    values, fixed = permute(query.values, order), permute(query.fixed, order)
    return replace(query, values=values, fixed=fixed)


def join_queries(
    first: KeyframeQuery,
    second: KeyframeQuery,
    *,
    least_s: float,
    most_s: float,
    rate_hz: float = SEQUENCE_HZ,
) -> KeyframeQuery:
    """One query after the other, with a bounded pause; without template positions.

    Parameters
    ----------
    first, second : queries over the same features
    least_s, most_s : seconds from the last keyframe of the first to the first keyframe of
        the second; infinity means no upper bound

    Raises
    ------
    InvalidInput
        If the features differ, or the pause contradicts itself.
    """
    check_features(second, first.feature_set, first.feature_ids)
    pause = gap_of_seconds(least_s, most_s, rate_hz=rate_hz)
    return KeyframeQuery(
        np.concatenate([first.values, second.values]),
        np.concatenate([first.fixed, second.fixed]),
        (*first.gaps, pause, *second.gaps),
        first.feature_set,
        first.feature_ids,
    )


def group_members(group: str, feature_set: FeatureSet) -> NDArray[np.bool_]:
    """Which features belong to a group, shape (features,); a group without any is refused."""
    members = np.array([feature.group == group for feature in feature_set.features])
    if not members.any():
        known = sorted({feature.group for feature in feature_set.features})
        raise InvalidInput(
            f"no group {group!r} in {feature_set.name!r}; there are {', '.join(known)}"
        )
    return members


def check_groups(template: QuantisedTemplate, feature_set: FeatureSet) -> None:
    """Refuse a feature set for its groups that is not the template's."""
    if template.feature_names != feature_set.ids:
        raise InvalidInput(
            f"the template is over {template.feature_set!r}, the groups over "
            f"{feature_set.name!r}; pass feature_set=... of the template"
        )


def check_features(query: KeyframeQuery, feature_set: str, feature_ids: Sequence[str]) -> None:
    """Refuse a query over other features than those that it is used on."""
    if query.feature_set == feature_set and query.feature_ids == tuple(feature_ids):
        return
    raise InvalidInput(
        f"the query is over {query.feature_set!r} ({len(query.feature_ids)} features), it is "
        f"used on {feature_set!r} ({len(feature_ids)} features); both must be of one set"
    )


def _typical(gap: Gap) -> int:
    """Distance in frames that a gap is made for; keyframes stay apart if they may."""
    if gap.most is None:
        return max(gap.least, 1)
    if gap.most == 0:
        return 0
    # Of a spring the distance; a gap that begins at 0 is none.
    middle = math.sqrt(gap.least * gap.most) if gap.least else gap.most / 2
    return max(round(middle), 1)


def _check_gaps(gaps: Sequence[Gap], *, n_keyframes: int) -> tuple[Gap, ...]:
    """The gaps as whole numbers."""
    if len(gaps) != n_keyframes - 1:
        raise InvalidInput(f"{n_keyframes} keyframes need {n_keyframes - 1} gaps, got {len(gaps)}")
    for number, (least, most) in enumerate(gaps, start=1):
        if least < 0 or (most is not None and most < least):
            raise InvalidInput(
                f"gap {number} contradicts itself: it needs 0 <= least <= most, "
                f"got {least} to {most} frames"
            )
        if max(least, most or 0) > _LONGEST:
            raise InvalidInput(f"gap {number} is longer than any recording; None means no bound")
    return tuple(Gap(int(least), None if most is None else int(most)) for least, most in gaps)


def _check_packed(
    values: PackedFeatures, fixed: PackedFeatures, *, n_features: int
) -> tuple[PackedFeatures, PackedFeatures]:
    fixed, values = np.array(fixed, dtype=np.uint64), np.array(values, dtype=np.uint64)
    if values.ndim != 2 or values.shape != fixed.shape or n_features == 0:
        raise InvalidInput(
            "a query needs features, and values and fixed of one shape (keyframes, integers), "
            f"got {n_features} features, {values.shape} and {fixed.shape}"
        )
    if len(values) == 0:
        raise InvalidInput("a query needs at least one keyframe, got none")
    if values.shape[1] != count_integers(n_features):
        raise InvalidInput(
            f"{n_features} features need {count_integers(n_features)} integers a keyframe, "
            f"got {values.shape[1]}"
        )
    if (fixed & ~full_mask(1, n_features)).any():
        raise InvalidInput(f"the keyframes fix beyond the {n_features} named features")
    values &= fixed
    values.flags.writeable = fixed.flags.writeable = False
    return values, fixed


def _check_positions(positions: Sequence[int], *, n_keyframes: int) -> tuple[int, ...]:
    whole = tuple(int(position) for position in positions)
    if len(whole) != n_keyframes or list(whole) != sorted(whole) or whole[0] < 0:
        raise InvalidInput(
            f"{n_keyframes} keyframes need as many positions, ascending from 0, got {whole}"
        )
    return whole
