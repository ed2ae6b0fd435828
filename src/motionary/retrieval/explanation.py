"""Explanations of labels and hits: what held, what failed, and what made their score.

Every match is a path through a template; each fixed cell on it asks for a feature to hold
or not to hold. Of a scored match each feature has its part of the score; of a hit found by
ranked quantities each tells how alike it is.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput, WrongKind
from motionary.features import FULL_BODY, FeatureSequence
from motionary.features.everyday import QUANTILES, list_quantities
from motionary.labels import Label
from motionary.matching import Alignment, CellRatios, Paths, Pattern, explain_scores
from motionary.models.templates import QuantisedTemplate
from motionary.packing import unpack
from motionary.recording import Segment, find_runs

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]

#: Where less of what is asked for was seen, a match is not assessed.
ASSESSED_FROM = 0.5

_MOST_PHRASES = 4

#: Ranks this far apart are worth a word.
_NOTABLE = 0.15
_LEVELS = ("lowest", "low", "middle", "high", "highest")
_MOMENTS = 20


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

    def label(self, segment: Segment, **scores: Any) -> Label:
        """The label of a segment for which this is the evidence."""
        recording = self.sequence.recording
        return Label(
            self.name, segment.start_s, segment.end_s,
            cost=self.alignment.cost,
            known=self.known,
            start_frame=recording.frame_at(segment.start_s),
            end_frame=recording.last_frame_before(segment.end_s),
            evidence=self,
            **scores,
        )  # fmt: skip


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


class Gain(NamedTuple):
    """What one feature tells for a class, or against it.

    Attributes
    ----------
    feature : id ("F20")
    name : of the feature, in words
    nats : logarithm of how much more likely the class makes its frames, in sum
    part : its part of the score; parts of all features sum to it
    """

    feature: str
    name: str
    nats: float
    part: float

    def __str__(self) -> str:
        return f"{self.name} {self.part:+.1f}"


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
    """What held and what failed of a label, a hit, or the evidence of one.

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

    `what` is the class or recording that it is of, and the threshold the cost that it did not
    reach, None where nothing was worth a score.
    """
    why = explain(evidence)
    aim = "that scores" if threshold is None else f"below {threshold:g}"
    text = f"nothing {aim}; nearest: {what} {why.cost:.3f} at {why.start_s:.1f} s"
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


# -- scores and quantities ---------------------------------------------------------------


def find_gains(
    ratios: CellRatios, alignment: Alignment, sequence: FeatureSequence
) -> tuple[Gain, ...]:
    """Part of each feature in the score of a match, in the order of the features."""
    columns, met = alignment.path.T
    frames = np.full((1, len(ratios.if_one)), -1, dtype=np.int32)
    frames[0, columns] = met
    paths = Paths(frames, np.array([alignment.cost], dtype=np.float32))
    parts = explain_scores(ratios, paths, sequence.packed, sequence.known)[0]
    return tuple(
        Gain(feature.id, feature.name, float(part * ratios.scale), float(part))
        for feature, part in zip(sequence.feature_set.features, parts, strict=True)
    )


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """An example and what it found, over the everyday set.

    Attributes
    ----------
    windows, published : cost by windows of ranked quantities, and by the published features
    """

    example: FeatureSequence
    found: FeatureSequence
    windows: float
    published: float


class QuantityMatch(NamedTuple):
    """One quantity in an example and in what it found.

    Attributes
    ----------
    name : of the quantity, in words
    example, found : mean rank in everyday motion, in [0, 1]
    differs : how far the ranks lie apart, moment by moment, in [0, 1]
    """

    name: str
    example: float
    found: float
    differs: float

    def __str__(self) -> str:
        here, there = (_LEVELS[round(rank * (len(_LEVELS) - 1))] for rank in self[1:3])
        if here != there:
            return f"{self.name} ({here}, here {there})"
        return f"{self.name} ({here}{', at other moments' if self.differs > _NOTABLE else ''})"


def compare_quantities(comparison: Comparison) -> tuple[QuantityMatch, ...]:
    """Quantities of an example and of what it found, the most alike first.

    Both are laid over each other evenly. Quantities that stay in the middle of everyday motion
    say nothing of the example: of equal ones, what is further from the middle comes first.
    """
    example, found = _ranks(comparison.example), _ranks(comparison.found)
    differ = np.abs(example - found)
    seen = np.asarray(np.isfinite(differ).any(axis=0))
    with np.errstate(invalid="ignore"):
        means = [np.nanmean(np.where(seen, ranks, 0.0), axis=0) for ranks in (example, found)]
        apart = np.nanmean(np.where(seen, differ, 0.0), axis=0)
    order = np.lexsort((-np.abs(means[0] - 0.5), apart.round(1)))
    names = [quantity.name for quantity in list_quantities()]
    return tuple(
        QuantityMatch(names[i], float(means[0][i]), float(means[1][i]), float(apart[i]))
        for i in order
        if seen[i]
    )


def describe_comparison(comparison: Comparison, *, most: int = 3) -> list[str]:
    """In which quantities an example and what it found are most alike, and least; a line each."""
    quantities = compare_quantities(comparison)
    differing = [one for one in quantities[::-1] if one.differs > _NOTABLE]
    return [
        f"{what}: {', '.join(map(str, which[:most]))}"
        for what, which in (("alike", quantities), ("differs", differing))
        if which
    ]


def _ranks(sequence: FeatureSequence) -> Floats:
    """Rank of each quantity at evenly spread moments, (moments, quantities), NaN = unknown."""
    at = np.linspace(0, len(sequence) - 1, _MOMENTS).round().astype(np.intp)
    quantities, first = list_quantities(), len(FULL_BODY)
    shape = (_MOMENTS, len(quantities), len(QUANTILES))
    bits = sequence.features[at, first:].reshape(shape).astype(np.float64)
    known = sequence.known_features[at, first:].reshape(shape).all(axis=2)
    half = len(QUANTILES) // 2
    signed = np.array([quantity.is_signed for quantity in quantities])
    below = np.where(signed, half - bits[..., :half].sum(axis=2), bits[..., :half].sum(axis=2))
    ranks = (below + bits[..., half:].sum(axis=2)) / len(QUANTILES)
    return np.where(known, ranks, np.nan)
