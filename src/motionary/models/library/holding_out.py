"""Which examples are held out of learning, and in what stream are they sought?

Thresholds are chosen on examples that the templates have not seen. A recording is more
than examples: held-out ones stand in a stream between each other and between pieces of
other recordings, since every minute of other motion gives chances for false hits.

Conventions: frames are words at 30 Hz; seeded.
"""

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from motionary.errors import InvalidInput
from motionary.evaluation import Segment
from motionary.features import FeatureSequence
from motionary.models.library.examples import Examples
from motionary.packing import PackedFeatures

#: Groups, or examples without groups, are dealt into so many parts at most.
N_FOLDS = 5
#: Pieces of other recordings, in frames: 2 to 5 s.
_PIECE = (60, 150)


class Fold(NamedTuple):
    """Examples to learn from, and others, by class, to try what was learned."""

    learned: Examples
    held_out: Sequence[tuple[str, FeatureSequence]]


class Stream(NamedTuple):
    """Words of pieces, one after the other.

    Attributes
    ----------
    words, known : arrays, shape (frames, n_words)
    truth : where which class is
    other_frames : frames of recordings that are no examples
    """

    packed: PackedFeatures
    known: PackedFeatures
    truth: Sequence[Segment]
    other_frames: int


def make_folds(examples: Examples, *, groups: str | None, seed: int) -> list[Fold]:
    """Folds in which every example is held out once.

    Parameters
    ----------
    examples : class -> subclass -> words
    groups : regular expression; examples whose names have the same match (its first
        parentheses, if it has any) are held out together
    seed : of the order in which they are dealt

    Returns
    -------
    list of Fold; of one fold nothing can be learned, so there are at least two, or none

    Raises
    ------
    InvalidInput
        If the expression is none, matches some example nowhere, or puts all into one group.
    """
    items = [
        (name, prototype, item)
        for name, prototypes in examples.items()
        for prototype, of_prototype in prototypes.items()
        for item in of_prototype
    ]
    rng = np.random.default_rng(seed)
    part_of = _deal_groups(items, groups, rng) if groups else _deal(items, rng)
    folds = []
    for part in range(max(part_of, default=-1) + 1):
        learned: dict[str, dict[str, list[FeatureSequence]]] = {}
        held_out = []
        for (name, prototype, item), own in zip(items, part_of, strict=True):
            if own == part:
                held_out.append((name, item))
            else:
                learned.setdefault(name, {}).setdefault(prototype, []).append(item)
        # What was not learned is not to be found.
        folds.append(Fold(learned, [held for held in held_out if held[0] in learned]))
    return [fold for fold in folds if fold.held_out]


def make_stream(
    held_out: Sequence[tuple[str, FeatureSequence]],
    others: Sequence[FeatureSequence],
    *,
    other_per_frame: float,
    rng: np.random.Generator,
) -> Stream:
    """Stream of examples in any order, pieces of other recordings spread between them.

    Parameters
    ----------
    held_out : class and words
    others : recordings without any of the classes
    other_per_frame : most frames of them for each frame of the examples
    rng : source of the order
    """
    n_frames = sum(len(item) for _, item in held_out)
    pieces = _cut(others, int(other_per_frame * n_frames), rng)
    between = np.sort(rng.integers(0, len(held_out) + 1, size=len(pieces)))
    parts: list[tuple[PackedFeatures, PackedFeatures]] = []
    truth = []
    end = taken = 0
    for place, index in enumerate([*rng.permutation(len(held_out)), -1]):
        while taken < len(pieces) and between[taken] <= place:
            parts.append((pieces[taken].packed, pieces[taken].known))
            end += len(pieces[taken])
            taken += 1
        if index >= 0:
            name, item = held_out[index]
            parts.append((item.packed, item.known))
            truth.append(Segment(name, end, end + len(item)))
            end += len(item)
    packed, known = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    return Stream(packed, known, truth, len(packed) - n_frames)


def _deal_groups(
    items: Sequence[tuple[str, str, FeatureSequence]], groups: str, rng: np.random.Generator
) -> list[int]:
    try:
        pattern = re.compile(groups)
    except re.error as error:
        raise InvalidInput(f"groups {groups!r} is no regular expression: {error}") from error
    keys = []
    for _, _, item in items:
        found = pattern.search(item.source)
        if found is None:
            raise InvalidInput(
                f"groups {groups!r} matches nothing in {item.source!r}; each example needs a group"
            )
        keys.append(str(found[1 if pattern.groups else 0]))
    names = sorted(set(keys))
    order = rng.permutation(len(names))
    parts = {names[k]: place % N_FOLDS for place, k in enumerate(order)}
    if len(names) == 1:
        raise InvalidInput(
            f"groups {groups!r} puts all examples into one group, {names[0]!r}, and none can be "
            "held out; write an expression that tells them apart, or leave it out"
        )
    return [parts[key] for key in keys]


def _deal(items: Sequence[tuple[str, str, FeatureSequence]], rng: np.random.Generator) -> list[int]:
    """Parts of examples, those of each subclass spread evenly; a lone one is never held out."""
    places: dict[tuple[str, str], list[int]] = {}
    for i, (name, prototype, _) in enumerate(items):
        places.setdefault((name, prototype), []).append(i)
    part_of = [N_FOLDS] * len(items)
    next_part = 0
    for own in places.values():
        if len(own) > 1:
            for i in rng.permutation(own):
                part_of[i] = next_part % N_FOLDS
                next_part += 1
    return part_of


def _cut(
    others: Sequence[FeatureSequence], most_frames: int, rng: np.random.Generator
) -> list[FeatureSequence]:
    """Pieces of recordings, in any order, together no longer than asked."""
    pieces = []
    for other in others:
        start = 0
        while start < len(other):
            stop = min(start + int(rng.integers(*_PIECE, endpoint=True)), len(other))
            pieces.append(other.part(start, stop))
            start = stop
    chosen = []
    for i in rng.permutation(len(pieces)):
        if len(pieces[i]) <= most_frames:
            chosen.append(pieces[i])
            most_frames -= len(pieces[i])
    return chosen
