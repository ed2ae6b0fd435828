"""Explanations of labels and hits: what held, what failed, and when.

Every match is a path through a template; each fixed cell on it asks for a feature to hold
or not to hold.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.features import FeatureSequence
from motionary.matching import Alignment, Pattern
from motionary.models.templates import QuantisedTemplate
from motionary.packing import unpack
from motionary.recording import find_runs

Bools = NDArray[np.bool_]

#: Where less of what is asked for was seen, a match is not assessed.
ASSESSED_FROM = 0.5

_MOST_PHRASES = 4


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """The match behind a label or hit.

    Attributes
    ----------
    name : of the class
    template, pattern : of the class, cell by cell and as the matcher takes it
    sequence : features of the recording
    alignment : path through both
    """

    name: str
    template: QuantisedTemplate
    pattern: Pattern
    sequence: FeatureSequence
    alignment: Alignment

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
    name, recording, start_s, end_s, cost : of the match
    held, failed : what the class asks for and the recording shows, or does not
    unknown : phrases of features that the class asks for and that were not seen
    fraction_held : fraction of the seen cells that held
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
    evidence = match if isinstance(match, Evidence) else match.evidence
    if evidence is None:
        raise InvalidInput(
            "a label that was read from a table cannot be explained; "
            "annotate the recording again and explain those labels"
        )
    asked, seen, agrees = _cells(evidence)
    frames = evidence.alignment.path[:, 1]
    phrases = np.array(evidence.sequence.feature_set.names)
    n_seen = int((asked & seen).sum())
    return Explanation(
        name=evidence.name,
        recording=evidence.sequence.source,
        start_s=evidence.sequence.seconds(evidence.alignment.start),
        end_s=evidence.sequence.seconds(evidence.alignment.end + 1),
        cost=evidence.alignment.cost,
        held=tuple(_findings(evidence, asked & seen & agrees, frames)),
        failed=tuple(_findings(evidence, asked & seen & ~agrees, frames)),
        unknown=tuple(phrases[(asked & ~seen).any(axis=0)]),
        fraction_held=float((asked & seen & agrees).sum() / n_seen) if n_seen else 0.0,
    )


def describe_nearest(evidence: Evidence, *, what: str, threshold: float) -> str:
    """What came closest where nothing matched, and what it lacked, in a sentence.

    Parameters
    ----------
    evidence : of the cheapest match
    what : class or recording that came closest
    threshold : cost that it did not reach
    """
    why = explain(evidence)
    nearest = f"{what} {why.cost:.3f} at {why.start_s:.1f} s"
    text = f"nothing below {threshold:g}; nearest: {nearest}"
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
