"""A template in words that fit a screen: what it asks for, and what it leaves open.

Times are seconds from the template's beginning, by the time its columns stand for.
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.recording import find_runs

if TYPE_CHECKING:
    from motionary.features import FeatureSet
    from motionary.models.templates import MotionTemplate, QuantisedTemplate

Bools = NDArray[np.bool_]

_MOST_LINES = 8
_MOST_NAMES = 6
# Shorter than a tenth of a second says little.
_SHORTEST_RUN = 3
# Of a feature that is free in fewer columns, only the ends vary.
_VARIES_FROM = 0.25
_MOMENT_S = 0.15


class _Run(NamedTuple):
    start_s: float
    end_s: float
    phrase: str

    @property
    def span(self) -> str:
        return f"{self.start_s:.1f}–{self.end_s:.1f} s"


def describe_template(
    template: "MotionTemplate", *, tolerance: float, feature_set: "FeatureSet"
) -> list[str]:
    """Lines that say what a template fixes and what it leaves open.

    Parameters
    ----------
    template : MotionTemplate
    tolerance : as in `quantise`
    feature_set : the features that the template's columns have
    """
    from motionary.models.templates import quantise

    quantised = quantise(template, tolerance=tolerance)
    fraction = 100 * quantised.n_fixed / quantised.fixed.size
    edges = np.concatenate([[0.0], np.cumsum(template.weights)]) / template.rate_hz
    lines = [
        f"template: {template.provenance}; {template.duration_s:.1f} s, "
        f"{fraction:.0f} % of its cells are fixed"
    ]
    lines += _asked(quantised, edges, feature_set)
    lines += _names("never", _never(quantised, feature_set))
    known = np.array([name not in template.unmeasured for name in template.feature_names])
    lines += _names("varies", _varying(~quantised.fixed & known, edges, feature_set))
    names = [name for name, seen in zip(feature_set.names, known, strict=True) if not seen]
    lines += _names("unknown", _phrases(names), " (measured in no example)")
    return lines


def _asked(
    template: "QuantisedTemplate", edges: NDArray[np.float64], feature_set: "FeatureSet"
) -> list[str]:
    """The longest segments in which features must hold, in the order of time."""
    wanted = template.values & template.fixed
    runs = [
        _Run(float(edges[first]), float(edges[stop]), name)
        for name, column in zip(feature_set.names, wanted.T, strict=True)
        for first, stop in find_runs(column)
        if stop - first >= _SHORTEST_RUN
    ]
    joined = _join_sides(runs)
    longest = sorted(joined, key=lambda r: r.start_s - r.end_s)[:_MOST_LINES]
    lines = [f"{run.span}  {run.phrase}" for run in sorted(longest)]
    if len(joined) > len(longest):
        lines.append(f"and {len(joined) - len(longest)} shorter segments")
    return _column("holds", lines)


def _never(template: "QuantisedTemplate", feature_set: "FeatureSet") -> list[str]:
    """Features that must not hold nearly all the time."""
    off = (template.fixed & ~template.values).mean(axis=0) >= 1 - _VARIES_FROM
    on = (template.fixed & template.values).any(axis=0)
    return _phrases(
        [name for name, never in zip(feature_set.names, off & ~on, strict=True) if never]
    )


def _varying(free: Bools, edges: NDArray[np.float64], feature_set: "FeatureSet") -> list[str]:
    """Features that are left open, longest first."""
    runs = []
    for name, column in zip(feature_set.names, free.T, strict=True):
        if column.mean() >= _VARIES_FROM:
            first, stop = max(find_runs(column), key=lambda r: r[1] - r[0])
            runs.append(_Run(float(edges[first]), float(edges[stop]), name))
    ranked = sorted(_join_sides(runs), key=lambda r: r.start_s - r.end_s)
    return [f"{run.phrase} ({run.span})" for run in ranked]


def _phrases(names: list[str]) -> list[str]:
    """Names of features; what is said of both sides is said once."""
    return [run.phrase for run in _join_sides([_Run(0.0, 0.0, name) for name in names])]


def _join_sides(runs: list[_Run]) -> list[_Run]:
    """Runs in which what holds of the right and of the left at one time is said once."""
    lefts = {run: run.phrase.removeprefix("left ") for run in runs
             if run.phrase.startswith("left ")}  # fmt: skip
    joined, used = [], set()
    for run in runs:
        side, _, rest = run.phrase.partition(" ")
        twin = None
        if side == "right":
            twin = next(
                (left for left, name in lefts.items() if name == rest and _together(run, left)),
                None,
            )
        if twin:
            used.add(twin)
            start_s, end_s = max(run.start_s, twin.start_s), min(run.end_s, twin.end_s)
            run = _Run(start_s, end_s, f"right and left {rest}")
        joined.append(run)
    return [run for run in joined if run not in used]


def _together(a: _Run, b: _Run) -> bool:
    """Whether two runs begin and end within a moment."""
    return abs(a.start_s - b.start_s) < _MOMENT_S and abs(a.end_s - b.end_s) < _MOMENT_S


def _names(head: str, names: list[str], why: str = "") -> list[str]:
    if not names:
        return []
    more = len(names) - _MOST_NAMES
    shown = ", ".join(names[:_MOST_NAMES]) + (f", and {more} more" if more > 0 else "")
    return _column(head, [shown + why])


def _column(head: str, lines: list[str]) -> list[str]:
    heads = [head, *[""] * (len(lines) - 1)]
    return [f"  {h:<7} {line}" for h, line in zip(heads, lines, strict=False)]
