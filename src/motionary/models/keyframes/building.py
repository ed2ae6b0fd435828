"""How does a keyframe query come about?

From relations by name, from columns of a template, from the authors' patterns; and from
other queries: mirrored, or one after the other.
"""

import difflib
import itertools
from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.features import FULL_BODY, SEQUENCE_HZ, FeatureSet
from motionary.models.keyframes.query import (
    Gap,
    KeyframeQuery,
    check_features,
    gap_of,
    gap_of_seconds,
)
from motionary.models.templates import QuantisedTemplate
from motionary.packing import pack, permute

_ENTRIES = {"0": (False, True), "1": (True, True), "*": (False, False)}


class Vocabulary(Protocol):
    """What yes/no features are called; a `FeatureSet` is one."""

    @property
    def name(self) -> str:
        """Name of the set."""

    @property
    def ids(self) -> tuple[str, ...]:
        """Short names, in the order of the bits."""

    @property
    def names(self) -> tuple[str, ...]:
        """Phrases, in the order of the bits."""


def from_features(
    keyframes: Sequence[Mapping[str, bool]],
    gaps: Sequence[Gap],
    *,
    vocabulary: Vocabulary = FULL_BODY,
    positions: Sequence[int] | None = None,
) -> KeyframeQuery:
    """Query of keyframes that say which relations hold and which do not.

    Parameters
    ----------
    keyframes : per keyframe, True or False by id or name of a relation; others are free
    gaps : between neighbouring keyframes
    vocabulary : the features
    positions : template columns of the keyframes

    Raises
    ------
    InvalidInput
        If there is no keyframe, a relation is unknown, or a gap contradicts itself.
    """
    shape = (len(keyframes), len(vocabulary.ids))
    values, fixed = np.zeros(shape, dtype=np.bool_), np.zeros(shape, dtype=np.bool_)
    for k, features in enumerate(keyframes):
        for feature, holds in features.items():
            i = find_feature(feature, vocabulary)
            if fixed[k, i] and values[k, i] != holds:
                raise InvalidInput(f"keyframe {k + 1} wants {feature!r} to hold and not to hold")
            values[k, i], fixed[k, i] = holds, True
    return _query(values, fixed, gaps, vocabulary.name, vocabulary.ids, positions)


def find_feature(name: str, vocabulary: Vocabulary) -> int:
    """Number of a feature by its id or name, in any case.

    Raises
    ------
    InvalidInput
        If there is none of that name; says which is nearest.
    """
    wanted = " ".join(name.split()).casefold()
    for known in (vocabulary.ids, vocabulary.names):
        folded = [word.casefold() for word in known]
        if wanted in folded:
            return folded.index(wanted)
    all_names = [*vocabulary.names, *vocabulary.ids]
    near = difflib.get_close_matches(wanted, all_names, n=1, cutoff=0.5)
    hint = f"; did you mean {near[0]!r}?" if near else f"; there are {', '.join(all_names)}"
    raise InvalidInput(f"no relation {name!r} in {vocabulary.name!r}{hint}")


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
    template : fixed cells are the fixed relations of the keyframes
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
        check_template_features(template, feature_set)
        if len(groups) != len(chosen):
            raise InvalidInput(f"{len(chosen)} keyframes need as many groups, got {len(groups)}")
        for row, group in zip(fixed, groups, strict=True):
            if group is not None:
                row &= group_members(group, feature_set)
    gaps = _gaps([b - a for a, b in itertools.pairwise(chosen)], stiffness)
    return _query(
        template.values[chosen], fixed, gaps, template.feature_set, template.feature_names, chosen
    )


def from_patterns(
    patterns: Sequence[str],
    groups: Sequence[str],
    *,
    distances: Sequence[float],
    stiffness: Sequence[float],
    positions: Sequence[int] | None = None,
    feature_set: FeatureSet = FULL_BODY,
) -> KeyframeQuery:
    """Query of patterns over groups of features, as the authors' collections hold them.

    Parameters
    ----------
    patterns : per keyframe, "0", "1" or "*" for the first features of its group; features
        that the pattern is too short for are free
    groups : per keyframe, the group of its features
    distances, stiffness : per gap, frames and stiffness
    positions : template columns, from 0
    feature_set : whose groups and order the patterns follow

    Raises
    ------
    InvalidInput
        If a pattern is malformed or longer than its group, or numbers do not fit.
    """
    if len(patterns) != len(groups):
        raise InvalidInput(f"{len(patterns)} keyframes need as many groups, got {len(groups)}")
    shape = (len(patterns), len(feature_set))
    values, fixed = np.zeros(shape, dtype=np.bool_), np.zeros(shape, dtype=np.bool_)
    for k, (pattern, group) in enumerate(zip(patterns, groups, strict=True)):
        members = np.flatnonzero(group_members(group, feature_set))
        if len(pattern) > len(members) or not set(pattern) <= _ENTRIES.keys():
            raise InvalidInput(
                f"keyframe {k + 1}: a pattern of group {group!r} needs at most {len(members)} "
                f"signs 0, 1 or *, got {pattern!r}"
            )
        for i, sign in zip(members, pattern, strict=False):
            values[k, i], fixed[k, i] = _ENTRIES[sign]
    gaps = _gaps(distances, stiffness)
    return _query(values, fixed, gaps, feature_set.name, feature_set.ids, positions)


def mirror_query(query: KeyframeQuery, feature_set: FeatureSet = FULL_BODY) -> KeyframeQuery:
    """Query of the mirrored motion: left and right exchanged.

    Raises
    ------
    InvalidInput
        If the query is over another set of features.
    """
    check_features(query, feature_set.name, feature_set.ids)
    order = feature_set.mirror_order
    return KeyframeQuery(
        permute(query.values, order), permute(query.fixed, order), query.gaps,
        query.feature_set, query.feature_ids, query.positions,
    )  # fmt: skip


def join_queries(
    first: KeyframeQuery,
    second: KeyframeQuery,
    *,
    least_s: float,
    most_s: float,
    rate_hz: float = SEQUENCE_HZ,
) -> KeyframeQuery:
    """One query after the other, with a bounded pause.

    Parameters
    ----------
    first, second : queries over the same features
    least_s, most_s : seconds from the last keyframe of the first to the first keyframe of
        the second; infinity means no upper bound
    rate_hz : frames per second

    Returns
    -------
    KeyframeQuery without template positions

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
    """Which features belong to a group, shape (features,).

    Raises
    ------
    InvalidInput
        If no feature does.
    """
    members = np.array([feature.group == group for feature in feature_set.features])
    if not members.any():
        known = sorted({feature.group for feature in feature_set.features})
        raise InvalidInput(
            f"no group {group!r} in {feature_set.name!r}; there are {', '.join(known)}"
        )
    return members


def check_template_features(template: QuantisedTemplate, feature_set: FeatureSet) -> None:
    """Refuse a feature set that is not the template's.

    Raises
    ------
    InvalidInput
    """
    if template.feature_names != feature_set.ids:
        raise InvalidInput(
            f"the template is over {template.feature_set!r}, the groups over "
            f"{feature_set.name!r}; pass feature_set=... of the template"
        )


def _gaps(distances: Sequence[float], stiffness: float | Sequence[float]) -> list[Gap]:
    if isinstance(stiffness, Sequence):
        if len(stiffness) != len(distances):
            raise InvalidInput(
                f"{len(distances)} gaps need as many stiffness values, got {len(stiffness)}"
            )
        return [gap_of(d, s) for d, s in zip(distances, stiffness, strict=True)]
    return [gap_of(distance, stiffness) for distance in distances]


def _query(
    values: NDArray[np.bool_],
    fixed: NDArray[np.bool_],
    gaps: Sequence[Gap],
    feature_set: str,
    feature_ids: tuple[str, ...],
    positions: Sequence[int] | None,
) -> KeyframeQuery:
    if len(values) == 0:
        raise InvalidInput("a query needs at least one keyframe, got none")
    columns = None if positions is None else tuple(positions)
    return KeyframeQuery(pack(values), pack(fixed), tuple(gaps), feature_set, feature_ids, columns)
