"""Templates edited by hand, and described in a few lines.

Class templates can be restricted to some features, loosened where they ask too much, and
put together, without further examples: Müller and Röder (2006), section 5.4.

Conventions: times in seconds from the template's beginning, by its columns at 30 Hz;
features by name or id; a free cell is 0.5. Templates come back new, never changed.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.features import FeatureSet, find_feature
from motionary.models.templates.template import (
    MotionTemplate,
    QuantisedTemplate,
    check_same_features,
    count_columns,
    find_set,
    fit_columns,
    quantise,
    show_seconds,
)
from motionary.recording import find_runs

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]

_FREE = 0.5
# So many segments and names are described.
_MOST_LINES = 8
_MOST_NAMES = 6
# Shorter than a tenth of a second says little.
_SHORTEST_RUN = 3
# Of a feature that is free in fewer columns, only the ends vary.
_VARIES_FROM = 0.25
_MOMENT_S = 0.15


class Pause(NamedTuple):
    """A segment between templates in which anything may happen.

    Attributes
    ----------
    least_s, most_s : seconds; the longest at most four times the shortest
    """

    least_s: float
    most_s: float


def restrict(
    template: MotionTemplate, features: Collection[str], *, feature_set: FeatureSet | None = None
) -> MotionTemplate:
    """Template that asks for some features only; all others are free.

    Raises
    ------
    InvalidInput
        If a feature is unknown, or none is given.
    """
    kept = _numbers(template, features, feature_set)
    if not kept:
        raise InvalidInput("restricting needs at least one feature to keep, got none")
    values = np.full(template.values.shape, _FREE)
    values[:, kept] = template.values[:, kept]
    return _changed(template, values, f"restricted to {len(kept)} features")


def free(
    template: MotionTemplate,
    features: Collection[str] | None = None,
    *,
    start_s: float = 0.0,
    end_s: float | None = None,
    feature_set: FeatureSet | None = None,
) -> MotionTemplate:
    """Template that leaves features open in a segment; all of them if none are given.

    Raises
    ------
    InvalidInput
        If a feature is unknown, or the segment not in the template.
    """
    values = template.values.copy()
    chosen = slice(None) if features is None else _numbers(template, features, feature_set)
    values[_part(template, start_s, end_s)][:, chosen] = _FREE
    return _changed(template, values, "loosened by hand")


def fix(
    template: MotionTemplate,
    features: Mapping[str, bool],
    *,
    start_s: float = 0.0,
    end_s: float | None = None,
    feature_set: FeatureSet | None = None,
) -> MotionTemplate:
    """Template that asks for features to hold, or not to hold, in a segment.

    Raises
    ------
    InvalidInput
        If a feature is unknown, or the segment not in the template.
    """
    values, part = template.values.copy(), _part(template, start_s, end_s)
    for name, holds in features.items():
        values[part, _numbers(template, [name], feature_set)] = float(holds)
    return _changed(template, values, "fixed by hand")


def cut(
    template: MotionTemplate, *, start_s: float = 0.0, end_s: float | None = None
) -> MotionTemplate:
    """Part of a template.

    Raises
    ------
    InvalidInput
        If the segment is empty or not in the template.
    """
    part = _part(template, start_s, end_s)
    shorter = replace(template, values=template.values[part], weights=template.weights[part].copy())
    return _changed(shorter, shorter.values, "cut by hand")


def concatenate(parts: Sequence[MotionTemplate | Pause]) -> MotionTemplate:
    """One template after the other, with pauses in which anything may happen.

    A pause matches every length of its range, and somewhat beyond: from half to double of
    its geometric mean. It costs nothing, so the cost of the whole, a mean over all
    columns, is smaller than that of its parts; thresholds shrink with it.

    Raises
    ------
    InvalidInput
        If there is no template, templates are over different features, or a pause is empty
        or too wide.
    """
    templates = [part for part in parts if isinstance(part, MotionTemplate)]
    if not templates:
        raise InvalidInput("concatenating needs at least one template, got none")
    check_same_features(templates)
    values, weights = [], []
    for part in parts:
        if isinstance(part, Pause):
            n_columns = fit_columns(part.least_s, part.most_s)
            values.append(np.full((n_columns, templates[0].n_features), _FREE))
            weights.append(np.ones(n_columns))
        else:
            values.append(part.values)
            weights.append(part.weights)
    names = [t.provenance or "a template" for t in templates]
    return replace(
        templates[0],
        values=np.concatenate(values),
        weights=np.concatenate(weights),
        provenance=f"one after the other: {'; '.join(names)}",
        n_examples=min(t.n_examples for t in templates),
    )


def _numbers(
    template: MotionTemplate, features: Collection[str], feature_set: FeatureSet | None
) -> list[int]:
    known = find_set(template, feature_set=feature_set)
    # A string is a collection of letters, and would be taken for as many features.
    names = [features] if isinstance(features, str) else features
    return [find_feature(name, known) for name in names]


def _part(template: MotionTemplate, start_s: float, end_s: float | None) -> slice:
    start = count_columns(start_s, least=0)
    stop = template.n_columns if end_s is None else count_columns(end_s)
    if not start < stop <= template.n_columns:
        ends = f"{start_s:g} s to the end" if end_s is None else f"{start_s:g} to {end_s:g} s"
        raise InvalidInput(
            f"a segment needs to lie in the template, 0 to {show_seconds(template.n_columns)} s, "
            f"got {ends}"
        )
    return slice(start, stop)


def _changed(template: MotionTemplate, values: Floats, how: str) -> MotionTemplate:
    origin = template.provenance or "a template"
    provenance = origin if origin.endswith(how) else f"{origin}, {how}"
    return replace(template, values=values, provenance=provenance)


# -- descriptions -----------------------------------------------------------------------


class _Run(NamedTuple):
    """A phrase that holds from one second of a template to another."""

    start_s: float
    end_s: float
    phrase: str

    @property
    def span(self) -> str:
        return f"{self.start_s:.1f}–{self.end_s:.1f} s"


def describe_template(
    template: MotionTemplate, *, tolerance: float, feature_set: FeatureSet
) -> list[str]:
    """Lines that say what a template fixes and what it leaves open, few enough for a screen.

    Times are seconds from the template's beginning, by the time its columns stand for.

    The tolerance is that of `quantise`.
    """
    quantised = quantise(template, tolerance=tolerance)
    edges = np.concatenate([[0.0], np.cumsum(template.weights)]) / template.rate_hz
    lines = [
        f"template: {template.provenance}; {template.duration_s:.1f} s, "
        f"{100 * quantised.fraction_fixed:.0f} % of its cells are fixed"
    ]
    lines += _asked(quantised, edges, feature_set)
    # What must not hold nearly all the time.
    off = (quantised.fixed & ~quantised.values).mean(axis=0) >= 1 - _VARIES_FROM
    never = zip(feature_set.names, off & ~quantised.values.any(axis=0), strict=True)
    lines += _names("never", _say_once([name for name, is_never in never if is_never]))
    known = np.array([name not in template.unmeasured for name in template.feature_names])
    lines += _names("varies", _varying(~quantised.fixed & known, edges, feature_set))
    names = [name for name, seen in zip(feature_set.names, known, strict=True) if not seen]
    lines += _names("unknown", _say_once(names), " (measured in no example)")
    return lines


def _asked(template: QuantisedTemplate, edges: Floats, feature_set: FeatureSet) -> list[str]:
    """The longest segments in which features must hold, in the order of time."""
    runs = [
        _Run(float(edges[first]), float(edges[stop]), name)
        for name, column in zip(feature_set.names, template.values.T, strict=True)
        for first, stop in find_runs(column)
        if stop - first >= _SHORTEST_RUN
    ]
    joined = _join_sides(runs)
    longest = sorted(joined, key=lambda r: r.start_s - r.end_s)[:_MOST_LINES]
    lines = [f"{run.span}  {run.phrase}" for run in sorted(longest)]
    if len(joined) > len(longest):
        n = len(joined) - len(longest)
        lines.append(f"and {n} shorter segment{'' if n == 1 else 's'}")
    return _column("holds", lines)


def _varying(free: Bools, edges: Floats, feature_set: FeatureSet) -> list[str]:
    """Features that are left open, longest first."""
    runs = []
    for name, column in zip(feature_set.names, free.T, strict=True):
        if column.mean() >= _VARIES_FROM:
            first, stop = max(find_runs(column), key=lambda r: r[1] - r[0])
            runs.append(_Run(float(edges[first]), float(edges[stop]), name))
    ranked = sorted(_join_sides(runs), key=lambda r: r.start_s - r.end_s)
    return [f"{run.phrase} ({run.span})" for run in ranked]


def _say_once(names: list[str]) -> list[str]:
    """Names of features; what is said of both sides is said once."""
    return [run.phrase for run in _join_sides([_Run(0.0, 0.0, name) for name in names])]


def _join_sides(runs: list[_Run]) -> list[_Run]:
    """Runs in which what holds of the right and of the left at one time is said once."""
    joined, used = [], set()
    for run in runs:
        side, _, rest = run.phrase.partition(" ")
        lefts = [
            left
            for left in runs
            if left.phrase == f"left {rest}"
            and abs(run.start_s - left.start_s) < _MOMENT_S
            and abs(run.end_s - left.end_s) < _MOMENT_S
        ]
        if side == "right" and lefts:
            twin = lefts[0]
            used.add(twin)
            start_s, end_s = max(run.start_s, twin.start_s), min(run.end_s, twin.end_s)
            run = _Run(start_s, end_s, f"right and left {rest}")
        joined.append(run)
    return [run for run in joined if run not in used]


def _names(head: str, names: list[str], why: str = "") -> list[str]:
    if not names:
        return []
    more = len(names) - _MOST_NAMES
    shown = ", ".join(names[:_MOST_NAMES]) + (f", and {more} more" if more > 0 else "")
    return _column(head, [shown + why])


def _column(head: str, lines: list[str]) -> list[str]:
    heads = [head, *[""] * (len(lines) - 1)]
    return [f"  {h:<7} {line}" for h, line in zip(heads, lines, strict=False)]
