"""Query expansion: an example becomes a template that shows what may vary.

The example's features are the first template; one learned from the example and its nearest
hits shows what may vary. It is learned in steps, from one hit, then two, four, ..., each time
found anew: what a few sure hits free, brings the next ones nearer. With relevance feedback the
template is learned from the relevant hits; what the irrelevant ones show at the same moments
has little weight.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.features import FeatureSequence
from motionary.matching import Pattern, align, distance_function
from motionary.models.templates import MotionTemplate, pattern_of, quantise, template_of
from motionary.packing import unpack
from motionary.retrieval.index import Collection
from motionary.retrieval.search.keyframes import Preselection, preselect_by
from motionary.retrieval.search.parts import rank_patterns
from motionary.retrieval.search.ranking import Hit, SearchPattern

Floats = NDArray[np.float64]

#: A hit of this cost is near, however near the nearest was.
_NEAR = 0.02


@dataclass(frozen=True, slots=True)
class QueryExpansion:
    """How an example becomes a template; defaults: docs/evidence/growing_choice.md.

    Attributes
    ----------
    hits : nearest hits that the template is learned from in the end, beside the example; 0
        searches the example's features as they are
    most_cost : if the nearest hit costs more, nothing is near enough to learn from
    reach : from the second step on, a hit may cost so many times what the nearest one did at
        first
    tolerance : a cell is fixed if at most this fraction of example and hits differs
    by_self_information : whether what is rare in the collection weighs more
    prior : how many frames of the collection at large stand beside those of irrelevant hits
        when it is counted what they show
    published : whether the template alone finds, as published, and no windows of the everyday set
    """

    hits: int = 3
    most_cost: float = 0.35
    reach: float = 0.6
    tolerance: float = 0.1
    by_self_information: bool = True
    prior: float = 10.0
    published: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class RelevanceFeedback:
    """An example, and which of its hits a person found relevant.

    Attributes
    ----------
    example : its features
    relevant, irrelevant : hits, or their features
    """

    example: FeatureSequence
    relevant: tuple[Hit | FeatureSequence, ...] = ()
    irrelevant: tuple[Hit | FeatureSequence, ...] = ()


def expand(
    feedback: RelevanceFeedback,
    collection: Collection,
    expansion: QueryExpansion,
    *,
    preselect: Preselection = None,
    prior: Floats | None = None,
) -> tuple[MotionTemplate, SearchPattern]:
    """Template of an example and its nearest or its relevant hits, and its pattern.

    Parameters
    ----------
    feedback : the example, and the hits found relevant or not
    collection : where the nearest hits are found
    expansion : settings
    preselect : where to look for them
    prior : fraction of frames in which each feature holds; by default in the collection

    Raises
    ------
    InvalidInput
        If the example is over other features, or nothing of it is fixed.
    """
    example = feedback.example
    _check_features(feedback, collection)
    ones: Floats | None = None
    if expansion.by_self_information:
        ones = collection.feature_prior if prior is None else prior
    if feedback.relevant or feedback.irrelevant:
        relevant = [_features_of(hit) for hit in feedback.relevant if not _is_example(hit, example)]
        template = _learn(example, relevant)
        pattern = _to_pattern(example, template, expansion, ones)
        irrelevant = [_features_of(hit) for hit in feedback.irrelevant]
        return template, _weigh_against(irrelevant, pattern, ones, expansion.prior)
    template, most, is_first = _learn(example, []), expansion.most_cost, True
    for n_hits in _steps(expansion.hits):
        pattern = _to_pattern(example, template, expansion, ones)
        pattern = preselect_by(preselect, pattern, template, collection.sample)
        # Of a large collection the nearest in an evenly spread part of it.
        nearest = rank_patterns([pattern], collection.sample, threshold=most, limit=n_hits + 1).hits
        others = [hit for hit in nearest if not _is_example(hit, example)][:n_hits]
        if not others:
            break
        if is_first:
            most, is_first = max(expansion.reach * others[0].cost, _NEAR), False
        template = _learn(example, [_features_of(hit) for hit in others])
    return template, _to_pattern(example, template, expansion, ones)


def _steps(hits: int) -> Iterator[int]:
    """1, 2, 4, ... and at last all."""
    n = 1
    while n < hits:
        yield n
        n *= 2
    if hits:
        yield hits


def _check_features(feedback: RelevanceFeedback, collection: Collection) -> None:
    hits = (*feedback.relevant, *feedback.irrelevant)
    for sequence in (feedback.example, *map(_features_of, hits)):
        if sequence.feature_set.name != collection.feature_set.name:
            raise InvalidInput(
                f"the example has features of {sequence.feature_set.name!r}, the collection of "
                f"{collection.feature_set.name!r}"
            )


def _to_pattern(
    example: FeatureSequence,
    template: MotionTemplate,
    expansion: QueryExpansion,
    ones: Floats | None,
) -> SearchPattern:
    quantised = quantise(template, tolerance=expansion.tolerance)
    if quantised.n_fixed == 0:
        raise InvalidInput(
            "nothing of the example is known and common to its hits; "
            "give a longer segment or an example in which more joints are seen",
            file=example.source,
        )
    name = f"like {example.source}" if example.source else "like the example"
    return SearchPattern(name, quantised, pattern_of(quantised, ones=ones))


def _weigh_against(
    irrelevant: Sequence[FeatureSequence], pattern: SearchPattern, ones: Floats | None, prior: float
) -> SearchPattern:
    """Pattern whose entries weigh by their self-information among the irrelevant hits."""
    if not irrelevant:
        return pattern
    template = pattern.template
    at_large = np.full(template.n_features, 0.5) if ones is None else ones
    shown, seen = _count_shown(pattern.pattern, irrelevant, template.n_features)
    fractions = (shown + prior * at_large) / (seen + prior)
    return SearchPattern(pattern.name, template, pattern_of(template, ones=fractions))


def _count_shown(
    pattern: Pattern, hits: Sequence[FeatureSequence], n_features: int
) -> tuple[Floats, Floats]:
    """How often each feature holds, and is known, where a column meets hits."""
    shown, seen = np.zeros((len(pattern), n_features)), np.zeros((len(pattern), n_features))
    for sequence in hits:
        distance = distance_function(pattern, sequence.packed, sequence.known)
        end = int(np.argmin(distance))
        if not np.isfinite(distance[end]):
            continue
        columns, frames = align(pattern, sequence.packed, sequence.known, [end])[0].path.T
        np.add.at(shown, columns, unpack(sequence.packed & sequence.known, n_features)[frames])
        np.add.at(seen, columns, unpack(sequence.known, n_features)[frames])
    return shown, seen


def _learn(example: FeatureSequence, hits: Sequence[FeatureSequence]) -> MotionTemplate:
    n_hits = "1 hit" if len(hits) == 1 else f"{len(hits)} hits"
    provenance = f"expanded from {example.source or 'an example'} and {n_hits}"
    return template_of([example, *hits], provenance=provenance)


def _features_of(hit: Hit | FeatureSequence) -> FeatureSequence:
    if isinstance(hit, FeatureSequence):
        return hit
    if hit.comparison is not None:
        return hit.comparison.found.leading(hit.evidence.sequence.feature_set)
    found = hit.evidence
    return found.sequence.part(found.alignment.start, found.alignment.end + 1)


def _is_example(hit: Hit | FeatureSequence, example: FeatureSequence) -> bool:
    """Whether a hit is the example itself, found in the collection: nothing to learn from."""
    if isinstance(hit, FeatureSequence):
        return hit is example
    packed, n = hit.evidence.sequence.packed, len(example)
    start, stop = hit.evidence.alignment.start, hit.evidence.alignment.end + 1
    # Where a body stands still, a hit may begin or end beside the example.
    for first in range(max(0, start - n), min(stop, len(packed) - n + 1)):
        shared = min(first + n, stop) - max(first, start)
        if 2 * shared > n and bool((packed[first : first + n] == example.packed).all()):
            return True
    return False
