"""How does one example become a template?

The example's words are the first template; one learned from the example and its nearest hits
shows what may vary. It grows in steps, one hit, then two, four, ..., each time found anew:
what a few sure hits free, brings the next ones nearer. Where a person has said which hits are
right, the template is learned from those; what the wrong ones show at the same moments tells
little.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.features import FeatureSequence
from motionary.matching import Pattern, align, distance_function
from motionary.models.templates import MotionTemplate, learn_template, pattern_of, quantise
from motionary.packing import unpack
from motionary.retrieval.index import Collection
from motionary.retrieval.search.ranking import Sought, rank
from motionary.retrieval.search.results import Hit

Floats = NDArray[np.float64]

#: A hit of this cost is near, however near the nearest was.
_NEAR = 0.02


@dataclass(frozen=True, slots=True)
class QueryExpansion:
    """How an example becomes a template; defaults: docs/evidence/growing_choice.md.

    Attributes
    ----------
    hits : nearest hits that the template is learned from in the end, beside the example; 0
        searches the example's words as they are
    most_cost : if the nearest hit costs more, nothing is near enough to learn from
    reach : from the second step on, a hit may cost so many times what the nearest one did at
        first
    tolerance : a cell is fixed if at most this share of example and hits differs
    by_surprise : whether what is rare in the collection weighs more
    prior : how many frames of the collection at large stand beside those of wrong hits when
        it is counted what they show
    """

    hits: int = 3
    most_cost: float = 0.35
    reach: float = 0.6
    tolerance: float = 0.1
    by_self_information: bool = True
    prior: float = 10.0


@dataclass(frozen=True, slots=True, eq=False)
class RelevanceFeedback:
    """An example, and what a person says of hits that it had.

    Attributes
    ----------
    example : words of what is sought
    good, bad : hits, or their words
    """

    example: FeatureSequence
    good: tuple[Hit | FeatureSequence, ...] = ()
    bad: tuple[Hit | FeatureSequence, ...] = ()


#: Says where in a collection something of a template is matched.
Narrower = Callable[[Sought, MotionTemplate, Collection], Sought]


def grow(
    feedback: RelevanceFeedback,
    collection: Collection,
    expansion: QueryExpansion,
    *,
    narrow: Narrower,
) -> tuple[MotionTemplate, Sought]:
    """Template of an example and its nearest or its good hits, and how it is sought.

    Parameters
    ----------
    judged : words of what is sought
    collection : where the nearest hits are found
    growing : settings
    narrow : says where to look for them

    Raises
    ------
    InvalidInput
        If the example is over other features, or nothing of it is fixed.
    """
    example = feedback.example
    _check_features(feedback, collection)
    ones = collection.feature_prior if expansion.by_self_information else None
    if feedback.good or feedback.bad:
        good = [hit for hit in feedback.good if not _is_example(hit, example)]
        template = _learn(example, [_words_of(hit) for hit in good])
        sought = _seek(example, template, expansion, ones)
        bad = [_words_of(hit) for hit in feedback.bad]
        return template, _doubt(sought, bad, ones, expansion.prior)
    template, most, is_first = _learn(example, []), expansion.most_cost, True
    for n_hits in _steps(expansion.hits):
        sought = narrow(_seek(example, template, expansion, ones), template, collection)
        nearest = rank([sought], collection, threshold=most, limit=n_hits + 1)
        others = [hit for hit in nearest if not _is_example(hit, example)][:n_hits]
        if not others:
            break
        if is_first:
            most, is_first = max(expansion.reach * others[0].cost, _NEAR), False
        template = _learn(example, [_words_of(hit) for hit in others])
    return template, _seek(example, template, expansion, ones)


def _steps(hits: int) -> Iterator[int]:
    """1, 2, 4, ... and at last all."""
    n = 1
    while n < hits:
        yield n
        n *= 2
    if hits:
        yield hits


def _check_features(feedback: RelevanceFeedback, collection: Collection) -> None:
    packed = [feedback.example, *(_words_of(hit) for hit in (*feedback.good, *feedback.bad))]
    for sequence in packed:
        if sequence.feature_set.name != collection.feature_set.name:
            raise InvalidInput(
                f"the example has words of {sequence.feature_set.name!r}, the collection of "
                f"{collection.feature_set.name!r}"
            )


def _seek(
    example: FeatureSequence,
    template: MotionTemplate,
    expansion: QueryExpansion,
    ones: Floats | None,
) -> Sought:
    quantised = quantise(template, tolerance=expansion.tolerance)
    if quantised.n_fixed == 0:
        raise InvalidInput(
            f"{example.source}: nothing of the example is known and common to its hits; "
            "give a longer stretch or an example in which more joints are seen"
        )
    name = f"like {example.source}" if example.source else "like the example"
    return Sought(name, quantised, pattern_of(quantised, ones=ones))


def _doubt(
    sought: Sought, bad: Sequence[FeatureSequence], ones: Floats | None, prior: float
) -> Sought:
    """Entries weigh by their surprise among what was wrong at the same moment."""
    if not bad:
        return sought
    template = sought.template
    at_large = np.full(template.n_features, 0.5) if ones is None else ones
    shown, seen = _count_shown(sought.pattern, bad, template.n_features)
    fractions = (shown + prior * at_large) / (seen + prior)
    return Sought(sought.name, template, pattern_of(template, ones=fractions))


def _count_shown(
    pattern: Pattern, bad: Sequence[FeatureSequence], n_features: int
) -> tuple[Floats, Floats]:
    """How often each relation holds, and is known, where a column meets hits."""
    shown, seen = np.zeros((len(pattern), n_features)), np.zeros((len(pattern), n_features))
    for sequence in bad:
        distance = distance_function(pattern, sequence.packed, sequence.known)
        end = int(np.argmin(distance))
        if not np.isfinite(distance[end]):
            continue
        columns, frames = align(pattern, sequence.packed, sequence.known, [end])[0].path.T
        np.add.at(shown, columns, unpack(sequence.packed & sequence.known, n_features)[frames])
        np.add.at(seen, columns, unpack(sequence.known, n_features)[frames])
    return shown, seen


def _learn(example: FeatureSequence, hits: Sequence[FeatureSequence]) -> MotionTemplate:
    parts = [example, *hits]
    every = all(bool(p.known_features.all()) for p in parts)
    return learn_template(
        [p.features for p in parts],
        known=None if every else [p.known_features.astype(np.bool_) for p in parts],
        feature_names=example.feature_set.ids,
        feature_set=example.feature_set.name,
        provenance=f"grown from {example.source or 'an example'} and {_count(hits)}",
    )


def _count(hits: Sequence[FeatureSequence]) -> str:
    return "1 hit" if len(hits) == 1 else f"{len(hits)} hits"


def _words_of(hit: Hit | FeatureSequence) -> FeatureSequence:
    if isinstance(hit, FeatureSequence):
        return hit
    found = hit.evidence
    return found.sequence.part(found.alignment.start, found.alignment.end + 1)


def _is_example(hit: Hit | FeatureSequence, example: FeatureSequence) -> bool:
    """Whether a hit is the example itself, found in the collection: it teaches nothing."""
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
