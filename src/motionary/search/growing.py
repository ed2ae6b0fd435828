"""How does one example become a template?

The example's words are the first template; one learned from the example and its nearest
hits shows what may vary.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.features import FeatureSequence
from motionary.index import Collection
from motionary.search.ranking import Sought, rank
from motionary.search.results import Hit
from motionary.templates import MotionTemplate, learn_template, pattern_of, quantise


@dataclass(frozen=True, slots=True)
class Growing:
    """How an example becomes a template.

    Attributes
    ----------
    hits : nearest hits that the template is learned from, beside the example; 0 searches
        the example's words as they are
    rounds : how often the nearest hits are found anew
    most_cost : a nearest hit that costs more is too far to learn from
    tolerance : a cell is fixed if at most this share of example and hits differs; by
        default one of the five hits may, as one of them may be wrong
    by_surprise : whether what is rare in the collection weighs more
    """

    hits: int = 5
    rounds: int = 1
    most_cost: float = 0.3
    tolerance: float = 0.26
    by_surprise: bool = True


#: Says where in a collection something of a template is matched.
Narrower = Callable[[Sought, MotionTemplate, Collection], Sought]


def grow(
    example: FeatureSequence, collection: Collection, growing: Growing, *, narrow: Narrower
) -> tuple[MotionTemplate, Sought]:
    """Template of an example and its nearest hits, and how it is sought.

    Parameters
    ----------
    example : words of what is sought
    collection : where the nearest hits are found
    growing : settings
    narrow : says where to look for them

    Raises
    ------
    InvalidInput
        If the example is over other features, or nothing of it is fixed.
    """
    if example.feature_set.name != collection.feature_set.name:
        raise InvalidInput(
            f"the example has words of {example.feature_set.name!r}, the collection of "
            f"{collection.feature_set.name!r}"
        )
    ones = collection.share_of_ones if growing.by_surprise else None
    template = _learn(example, [])
    for _ in range(growing.rounds if growing.hits else 0):
        sought = _seek(example, template, growing, ones)
        nearest = rank(
            [narrow(sought, template, collection)],
            collection,
            threshold=growing.most_cost,
            limit=growing.hits + 1,
        )
        others = [hit for hit in nearest if not _is_example(hit, example)][: growing.hits]
        template = _learn(example, others)
    return template, _seek(example, template, growing, ones)


def _seek(
    example: FeatureSequence,
    template: MotionTemplate,
    growing: Growing,
    ones: NDArray[np.float64] | None,
) -> Sought:
    quantised = quantise(template, tolerance=growing.tolerance)
    if quantised.n_fixed == 0:
        raise InvalidInput(
            f"{example.source}: nothing of the example is known and common to its hits; "
            "give a longer stretch or an example in which more joints are seen"
        )
    name = f"like {example.source}" if example.source else "like the example"
    return Sought(name, quantised, pattern_of(quantised, ones=ones))


def _learn(example: FeatureSequence, hits: Sequence[Hit]) -> MotionTemplate:
    parts = [example]
    for hit in hits:
        found = hit.evidence
        parts.append(found.sequence.part(found.alignment.start, found.alignment.end + 1))
    every = all(bool(p.known_features.all()) for p in parts)
    return learn_template(
        [p.features for p in parts],
        known=None if every else [p.known_features.astype(np.bool_) for p in parts],
        feature_names=example.feature_set.ids,
        feature_set=example.feature_set.name,
        provenance=f"grown from {example.source or 'an example'} and {len(hits)} hits",
    )


def _is_example(hit: Hit, example: FeatureSequence) -> bool:
    """Whether a hit is the example itself, found in the collection: it teaches nothing."""
    words, n = hit.evidence.sequence.words, len(example)
    start, stop = hit.evidence.alignment.start, hit.evidence.alignment.end + 1
    # Where a body stands still, a hit may begin or end beside the example.
    for first in range(max(0, start - n), min(stop, len(words) - n + 1)):
        shared = min(first + n, stop) - max(first, start)
        if 2 * shared > n and bool((words[first : first + n] == example.words).all()):
            return True
    return False
