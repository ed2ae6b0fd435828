"""Explanations of labels, hits and templates: what held, what failed, what is asked for, when.

Every match is a path through a template; each fixed cell on it asks for a feature to hold
or not to hold.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput, WrongKind
from motionary.features import FeatureSequence, FeatureSet
from motionary.matching import Alignment, CellRatios, Pattern
from motionary.models.templates import MotionTemplate, QuantisedTemplate, quantise
from motionary.packing import unpack
from motionary.recording import find_runs
from motionary.retrieval.gains import Gain, describe_comparison, find_gains

Bools = NDArray[np.bool_]

#: Where less of what is asked for was seen, a match is not assessed.
ASSESSED_FROM = 0.5

_MOST_PHRASES = 4

# Of a template: so many segments and names are listed.
_MOST_LINES = 8
_MOST_NAMES = 6
# Shorter than a tenth of a second says little.
_SHORTEST_RUN = 3
# Of a feature that is free in fewer columns, only the ends vary.
_VARIES_FROM = 0.25
_MOMENT_S = 0.15


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """The match behind a label or hit.

    Attributes
    ----------
    name : of the class
    template, pattern : of the class, cell by cell and as the matcher takes it
    sequence : features of the recording
    alignment : path through both
    ratios : of the template, if the match was scored
    """

    name: str
    template: QuantisedTemplate
    pattern: Pattern
    sequence: FeatureSequence
    alignment: Alignment
    ratios: CellRatios | None = None

    @property
    def known(self) -> float:
        """Fraction of the cells asked for that were seen, in [0, 1]."""
        asked, seen, _ = _cells(self)
        n_asked = int(asked.sum())
        return float((asked & seen).sum() / n_asked) if n_asked else 1.0

    @property
    def is_assessed(self) -> bool:
        """Whether enough was seen: what was not seen is no match at any threshold."""
        return self.known >= ASSESSED_FROM


class Explainable(Protocol):
    """A label or a hit."""

    @property
    def evidence(self) -> Evidence | None:
        """The match behind it; None if it was read from a table."""


class Finding(NamedTuple):
    """One feature over one segment.

    Attributes
    ----------
    feature : id ("F20")
    phrase : what the class asks for, in words; see `Feature.phrase`
    start_s, end_s : seconds, half-open
    weight : mean weight of its cells times the root of their number, so that a short rare
        finding comes before a long common one
    """

    feature: str
    phrase: str
    start_s: float
    end_s: float
    weight: float

    def __str__(self) -> str:
        start, end = f"{self.start_s:.1f}", f"{self.end_s:.1f}"
        return f"{self.phrase} ({start if start == end else f'{start}–{end}'} s)"


@dataclass(frozen=True, slots=True)
class Explanation:
    """Which features held and which failed; `str()` puts it into a sentence.

    Attributes
    ----------
    name, recording, start_s, end_s, cost : of the label or hit
    held, failed : what the class asks for and the recording shows, or does not
    unknown : phrases of features that the class asks for and that were not seen
    fraction_held : fraction of the seen cells that held
    score : of the match, if it was scored
    gains : part of each feature in the score, in the order of the features
    compared : of a hit found by ranked quantities, in which it is like the example, and in which
        not
    """

    name: str
    recording: str
    start_s: float
    end_s: float
    cost: float
    held: tuple[Finding, ...]
    failed: tuple[Finding, ...]
    unknown: tuple[str, ...]
    fraction_held: float
    score: float | None = None
    gains: tuple[Gain, ...] = ()
    compared: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return f"Explanation({str(self)!r})"

    def __str__(self) -> str:
        parts = [
            f"{self.name} at {self.start_s:.1f}–{self.end_s:.1f} s, cost {self.cost:.3f}: "
            f"{100 * self.fraction_held:.0f} % of what the class asks for held"
        ]
        if self.held:
            parts.append("held: " + ", ".join(str(f) for f in _telling(self.held)))
        if self.failed:
            parts.append("failed: " + ", ".join(str(f) for f in self.worst()))
        if self.unknown:
            parts.append("not seen: " + ", ".join(self.unknown[:_MOST_PHRASES]))
        if self.score is not None:
            most = sorted(self.gains, key=lambda g: -abs(g.part))[:_MOST_PHRASES]
            parts.append(f"score {self.score:.1f}, of it " + ", ".join(map(str, most)))
        parts.extend(self.compared)
        return "; ".join(parts)

    def worst(self) -> list[Finding]:
        """The failed findings of most weight, the highest first."""
        return sorted(self.failed, key=lambda f: -f.weight)[:_MOST_PHRASES]


def explain(match: Explainable | Evidence) -> Explanation:
    """What of a label or hit held and what failed.

    Parameters
    ----------
    match : Label of `annotate`, Hit of `search`, or their evidence

    Raises
    ------
    InvalidInput
        If the label carries no evidence, because it was read from a table.
    """
    evidence = match if isinstance(match, Evidence) else getattr(match, "evidence", ...)
    if evidence is ...:
        raise WrongKind(
            f"match must be a Label or Hit, got {type(match).__name__}; explain one after the "
            "other: [explain(label) for label in track]"
        )
    if evidence is None:
        raise InvalidInput(
            "a label that was read from a table cannot be explained; "
            "annotate the recording again and explain those labels"
        )
    asked, seen, agrees = _cells(evidence)
    frames = evidence.alignment.path[:, 1]
    phrases = np.array(evidence.sequence.feature_set.names)
    n_seen = int((asked & seen).sum())
    gains: tuple[Gain, ...] = ()
    if evidence.ratios is not None:
        gains = find_gains(evidence.ratios, evidence.alignment, evidence.sequence)
    explanation = Explanation(
        name=evidence.name,
        recording=evidence.sequence.source,
        start_s=evidence.sequence.seconds(evidence.alignment.start),
        end_s=evidence.sequence.seconds(evidence.alignment.end + 1),
        cost=evidence.alignment.cost,
        held=tuple(_findings(evidence, asked & seen & agrees, frames)),
        failed=tuple(_findings(evidence, asked & seen & ~agrees, frames)),
        unknown=tuple(phrases[(asked & ~seen).any(axis=0)]),
        fraction_held=float((asked & seen & agrees).sum() / n_seen) if n_seen else 0.0,
        score=None if evidence.ratios is None else sum(gain.part for gain in gains),
        gains=gains,
    )
    comparison = getattr(match, "comparison", None)
    if comparison is None:
        return explanation
    # The published features may meet a part of what the windows found.
    where = {key: getattr(match, key) for key in ("start_s", "end_s", "cost")}
    return replace(explanation, **where, compared=tuple(describe_comparison(comparison)))


def describe_nearest(evidence: Evidence, *, what: str, threshold: float | None) -> str:
    """What came closest where nothing matched, and what it lacked, in a sentence.

    Parameters
    ----------
    evidence : of the cheapest match
    what : class or recording that came closest
    threshold : cost that it did not reach; None where nothing was worth a score
    """
    why = explain(evidence)
    nearest = f"{what} {why.cost:.3f} at {why.start_s:.1f} s"
    aim = "that scores" if threshold is None else f"below {threshold:g}"
    text = f"nothing {aim}; nearest: {nearest}"
    if why.failed:
        text += ", failed: " + ", ".join(str(f) for f in why.worst())
    if why.unknown:
        text += ", not seen: " + ", ".join(why.unknown[:_MOST_PHRASES])
    return text


def _cells(evidence: Evidence) -> tuple[Bools, Bools, Bools]:
    """What is asked for, seen, and agrees, per cell of the path and feature."""
    columns, frames = evidence.alignment.path.T
    n = len(evidence.sequence.feature_set)
    seen = unpack(evidence.sequence.known[frames], n)
    shown = unpack(evidence.sequence.packed[frames], n)
    asked = evidence.template.fixed[columns]
    return asked, seen, shown == evidence.template.values[columns]


def _findings(evidence: Evidence, where: Bools, frames: NDArray[np.intp]) -> Iterator[Finding]:
    """Runs along the path in which one feature is asked for with one value."""
    columns = evidence.alignment.path[:, 0]
    wanted = evidence.template.values[columns]
    weights = _cell_weights(evidence)[columns]
    seconds = evidence.sequence.seconds
    for i, feature in enumerate(evidence.sequence.feature_set.features):
        for value in (True, False):
            for first, stop in find_runs(where[:, i] & (wanted[:, i] == value)).tolist():
                yield Finding(
                    feature.id,
                    feature.phrase(value),
                    seconds(int(frames[first])),
                    seconds(int(frames[stop - 1]) + 1),
                    float(weights[first:stop, i].sum() / np.sqrt(stop - first)),
                )


def _cell_weights(evidence: Evidence) -> NDArray[np.float64]:
    """Weight of each cell of the template, shape (columns, features)."""
    if evidence.pattern.entry_weights is not None:
        return evidence.pattern.entry_weights
    # What a class does weighs more than what it leaves undone: most features rarely hold.
    return np.where(evidence.template.values, 1.0, 0.25)


def _telling(held: tuple[Finding, ...]) -> list[Finding]:
    """The findings of most weight, one a feature, in the order of time."""
    ranked = sorted(held, key=lambda f: -f.weight)
    first_of_each = {f.feature: f for f in reversed(ranked)}
    best = sorted(first_of_each.values(), key=lambda f: -f.weight)[:_MOST_PHRASES]
    return sorted(best, key=lambda f: f.start_s)


# -- templates --------------------------------------------------------------------------


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

    Parameters
    ----------
    template : MotionTemplate
    tolerance : as in `quantise`
    feature_set : the features that the template's columns have
    """
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
    lines += _names("unknown", _say_once(names), " (measured in no example)")
    return lines


def _asked(
    template: QuantisedTemplate, edges: NDArray[np.float64], feature_set: FeatureSet
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


def _never(template: QuantisedTemplate, feature_set: FeatureSet) -> list[str]:
    """Features that must not hold nearly all the time."""
    off = (template.fixed & ~template.values).mean(axis=0) >= 1 - _VARIES_FROM
    on = (template.fixed & template.values).any(axis=0)
    return _say_once(
        [name for name, never in zip(feature_set.names, off & ~on, strict=True) if never]
    )


def _varying(free: Bools, edges: NDArray[np.float64], feature_set: FeatureSet) -> list[str]:
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
