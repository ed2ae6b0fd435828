"""Advice on examples: what may be wrong with them, before anything is learned.

Too few examples, all of one person, one that is much shorter or longer, one that does not fit,
two motions under one name, nothing in common. The limits were set on the HDM05 classes and on
such with planted faults; they alarm for about one set of examples in twenty that is sound.

Conventions: distances are costs of matching, in [0, 1]; lengths in frames of 30 Hz.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.features import SEQUENCE_HZ, FeatureSequence
from motionary.matching import Pattern, concatenate, corpus_distance
from motionary.models.library.classes import TOLERANCE
from motionary.models.library.training import Examples
from motionary.models.templates import (
    Learning,
    MotionTemplate,
    pattern_of,
    quantise,
    template_of,
)
from motionary.packing import full_mask
from motionary.tables import enumerate_names

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

#: Fewer cannot show what may vary.
FEWEST = 3
#: Shorter ones are over before most features have changed.
SHORTEST_S = 0.25
#: An example costs more than this with the template of the others, and so much more than
#: the highest cost of one of them.
ODD_COST, ODD_GAP = 0.11, 0.05
#: Two motions: each half costs more than this with the template of the other, and two
#: templates fix a larger fraction of cells; few examples gain by any split.
APART_COST, APART_GAIN, GAIN_OF_ONE = 0.08, 0.04, 0.6
#: A template that fixes a smaller fraction of its cells matches much.
LEAST_FIXED = 0.2

#: Odd ones are reported up to this fraction of the examples: beyond, none of them is the rule.
_MOST_ODD = 0.25
_MOST_NAMES = 6
_FEWEST_COMPARED = 4
#: Distances of examples that do not fit into each other.
_NO_MATCH = 0.5
_TOLERANCE = 0.1
_LEARNING = Learning(max_passes=2)


class Advice(NamedTuple):
    """Something to look at before a class is used.

    Attributes
    ----------
    name : of the class
    kind : "few", "people", "short", "length", "odd", "two" or "loose"
    text : a sentence
    examples : names of the examples that it is about
    """

    name: str
    kind: str
    text: str
    examples: tuple[str, ...] = ()

    def __str__(self) -> str:
        return f"class {self.name!r}: {self.text}"


def advise(examples: Examples, *, tolerance: float = TOLERANCE) -> list[Advice]:
    """Advice on examples, class by class.

    Each prototype is looked at by itself, as it gets a template of its own.

    Parameters
    ----------
    examples : class -> prototype -> packed features
    tolerance : with which the classes are to be matched
    """
    found: list[Advice] = []
    for name, prototypes in examples.items():
        for prototype, items in prototypes.items():
            called = name if prototype == name else f"{name} / {prototype}"
            found += (Advice(called, *one) for one in _look(list(items), tolerance))
    return found


_Finding = tuple[str, str, tuple[str, ...]]


def _look(items: Sequence[FeatureSequence], tolerance: float) -> Iterator[_Finding]:
    people = {item.recording.person for item in items}
    if len(items) < FEWEST:
        count = "one example" if len(items) == 1 else f"{len(items)} examples"
        text = (
            f"{count}: too few to tell what may vary, so that other people will hardly match; add "
            f"{FEWEST - len(items)} or more, of other people if you can"
        )
        yield "few", text, ()
    elif len(people) == 1 and "" not in people:
        text = (
            f"all {len(items)} examples are of {people.pop()}, whose own way is then asked of "
            "everybody; add some of another person"
        )
        yield "people", text, ()
    short = [item for item in items if len(item) < SHORTEST_S * SEQUENCE_HZ]
    if short:
        yield "short", f"shorter than {SHORTEST_S} s: {_list(short)}; cut it anew", _names(short)
    usual, unusual, median = _by_length(items)
    for item in unusual:
        text = (
            f"{_name(item)} lasts {len(item) / SEQUENCE_HZ:.1f} s, the usual example "
            f"{median / SEQUENCE_HZ:.1f} s: one template matches from half to double; cut it "
            "anew, or make it a folder of its own"
        )
        yield "length", text, _names([item])
    if len(usual) >= _FEWEST_COMPARED:
        distances = _pairwise(usual)
        halves = _find_halves(usual, distances)
        yield from [halves] if halves else _find_odd(usual, distances)
    if len(items) >= FEWEST:
        fraction = quantise(_learn(items), tolerance=tolerance).fraction_fixed
        if fraction < LEAST_FIXED:
            text = (
                f"its examples have little in common: {100 * fraction:.0f} % of the template's "
                "cells are fixed, so that it will match much else"
            )
            yield "loose", text, ()


def _by_length(
    items: Sequence[FeatureSequence],
) -> tuple[list[FeatureSequence], list[FeatureSequence], float]:
    """Examples that one template can match, others, and the usual length."""
    lengths = np.array([len(item) for item in items])
    median = float(np.median(lengths)) if len(items) >= FEWEST else 0.0
    usual = (lengths >= median / 2) & (lengths <= 2 * median) | (median == 0.0)
    kept = [item for item, fits in zip(items, usual, strict=True) if fits]
    return kept, [item for item, fits in zip(items, usual, strict=True) if not fits], median


def _find_odd(items: list[FeatureSequence], distances: Floats) -> Iterator[_Finding]:
    """Examples that do not fit the template of all others, the oddest first."""
    left = np.arange(len(items))
    most = int(_MOST_ODD * len(items))
    for _ in range(most):
        if len(left) < _FEWEST_COMPARED:
            return
        among = distances[np.ix_(left, left)]
        oddest = int(np.argmax(np.nanmedian(among, axis=1)))
        others = [items[i] for i in np.delete(left, oddest)]
        item = items[left[oddest]]
        template = _learn(others)
        cost, highest_cost = _costs(template, [item])[0], _costs(template, others).max()
        if cost <= ODD_COST or cost - highest_cost <= ODD_GAP:
            return
        text = (
            f"{_name(item)} does not fit: with the template of the others it costs {cost:.2f}, "
            f"they at most {highest_cost:.2f}; is it in the wrong folder?"
        )
        yield "odd", text, _names([item])
        left = np.delete(left, oddest)


def _find_halves(items: list[FeatureSequence], distances: Floats) -> _Finding | None:
    """The two motions that examples show, if they clearly show two."""
    first, second = _split(items, distances)
    if len(first) < 2:
        return None
    templates = [_learn(part) for part in (first, second, items)]
    across = [np.median(_costs(templates[0], second)), np.median(_costs(templates[1], first))]
    *fractions, together = (quantise(x, tolerance=_TOLERANCE).fraction_fixed for x in templates)
    apart = float(np.average(fractions, weights=[len(first), len(second)]))
    if min(across) <= APART_COST or apart - together <= APART_GAIN + GAIN_OF_ONE / len(items):
        return None
    text = (
        f"looks like two motions, {_list(first)} against {_list(second)}: two templates would fix "
        f"{100 * apart:.0f} % of their cells, one {100 * together:.0f} %; make a folder of each"
    )
    return "two", text, _names(first)


def _split(
    items: list[FeatureSequence], distances: Floats
) -> tuple[list[FeatureSequence], list[FeatureSequence]]:
    """Examples in two parts by average linkage, the smaller one first."""
    # Late: clustering takes longer to load than most classes to learn.
    from scipy.cluster.hierarchy import fcluster, linkage
    from scipy.spatial.distance import squareform

    condensed = squareform(np.nan_to_num(distances), checks=False)
    groups = fcluster(linkage(condensed, "average"), 2, "maxclust")
    parts = [[item for item, g in zip(items, groups, strict=True) if g == k] for k in (1, 2)]
    first, second = sorted(parts, key=len)
    return first, second


# -- distances --------------------------------------------------------------------------


def _pairwise(items: Sequence[FeatureSequence]) -> Floats:
    """How well each example is found in each other, shape (n, n); NaN on the diagonal."""
    distances = np.array(
        [_least(Pattern(i.packed, i.known, np.ones(len(i))), items) for i in items]
    )
    nearest: Floats = np.minimum(distances, distances.T)
    np.fill_diagonal(nearest, np.nan)
    return nearest


def _costs(template: MotionTemplate, items: Sequence[FeatureSequence]) -> Floats:
    return _least(pattern_of(quantise(template, tolerance=_TOLERANCE)), items)


def _least(pattern: Pattern, items: Sequence[FeatureSequence]) -> Floats:
    """Smallest cost within each example."""
    full = full_mask(1, len(items[0].feature_set))[0]
    corpus = concatenate([i.packed for i in items], [i.known for i in items], full=full)
    parts = corpus.split(corpus_distance(pattern, corpus))
    return np.array([min(float(part.min()), _NO_MATCH) for part in parts])


def _learn(items: Sequence[FeatureSequence]) -> MotionTemplate:
    return template_of(items, learning=_LEARNING)


def _list(items: Sequence[FeatureSequence]) -> str:
    return enumerate_names([_name(item) for item in items], most=_MOST_NAMES)


def _names(items: Sequence[FeatureSequence]) -> tuple[str, ...]:
    return tuple(_name(item) for item in items)


def _name(item: FeatureSequence) -> str:
    return item.source or "an example without a name"
