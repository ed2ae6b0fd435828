"""Search part by part: each part of a collection ranks for itself, and the best are merged.

Parts are done one after the other, by several processes, or by the workers of a cluster, which
open shards where they lie. As soon as there are as many hits as asked for, the last of them is
the bound of the parts to come: what costs more is not handed over, and a part that cannot win
is not read. The merged hits are those of all recordings ranked at once, to the bit.
"""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from motionary.batch import Failure, Workers, map_ordered
from motionary.matching import distance, load_twin
from motionary.models.keyframes import search as keyframe_search
from motionary.retrieval.index import LARGE_COLLECTION, Collection, Part, Shard, StoredShard
from motionary.retrieval.search.ranking import ROUNDING, Hit, SearchPattern, match

Found = TypeVar("Found")

# Kernels that many parts are worth loading a compiler for, however small each part is.
_KERNELS = (distance.COMPILED, keyframe_search.COMPILED)
# What is found costs at least that.
_LEAST = 0.0


class PartTask(NamedTuple):
    """A part to search, wherever that is done.

    Attributes
    ----------
    shard : of the part, or where it lies
    ranks : array, the place of each of its sequences among those of the part
    most : largest cost that still counts
    """

    shard: Shard | StoredShard
    ranks: NDArray[np.int64]
    most: float

    def open(self) -> Collection:
        """The part as a collection of its own, its recordings in the order of the whole."""
        return Collection.of_part(Part(self.shard.open(), self.ranks))


class Row(NamedTuple, Generic[Found]):
    """Something found in a part; sorts as hits are ranked."""

    cost: float
    number: int
    start: int
    found: Found


class PartRows(NamedTuple, Generic[Found]):
    """What was found in a part, best first, and how many frames were matched for it."""

    rows: Sequence[Row[Found]]
    n_matched: int = 0


class Merged(NamedTuple, Generic[Found]):
    """The best of all parts, numbered as in the collection, and frames that were matched."""

    rows: list[Row[Found]]
    n_matched: int


def merge_parts(
    work: Callable[[PartTask], PartRows[Found]],
    collection: Collection,
    *,
    threshold: float,
    limit: int | None,
    jobs: Workers = 1,
) -> Merged[Found]:
    """The best that a search of each part finds; those that cannot win are left out.

    Parameters
    ----------
    work : rows of a part up to the cost of its task, at most `limit` of them; a function of a
        module, or `functools.partial` of one
    collection : at least one recording
    threshold, limit : largest cost, and most rows; None for all
    jobs : who does it
    """
    merging = _Merging[Found](collection, threshold, limit)
    n_matched = 0
    for done in map_ordered(partial(_attempt_part, work=work), merging.tasks(jobs), jobs=jobs):
        if isinstance(done, Failure):
            raise done.error
        number, found = done
        # Of several processes one may have begun what could not win any more.
        if merging.may_win(number):
            merging.add(number, found.rows)
            n_matched += found.n_matched
    return Merged(merging.best, n_matched)


class _Merging(Generic[Found]):
    """Rows so far, and what they say of parts that are not searched yet."""

    def __init__(self, collection: Collection, threshold: float, limit: int | None) -> None:
        self._parts, self._threshold, self._limit = collection.parts, threshold, limit
        self._first = [int(part.numbers.min()) for part in self._parts]
        self.best: list[Row[Found]] = []

    def tasks(self, jobs: Workers) -> Iterator[tuple[int, PartTask]]:
        """Parts to search, those of the first recordings first; each as it is asked for."""
        for i in np.argsort(self._first, kind="stable").tolist():
            if self.may_win(i):
                shard = self._parts[i].shard
                ranks = np.argsort(np.argsort(self._parts[i].numbers))
                yield i, PartTask(shard if jobs == 1 else shard.handle(), ranks, self._most)

    def may_win(self, number: int) -> bool:
        """Whether anything that a part may hold comes before what was found."""
        return not self._is_full or (_LEAST, self._first[number]) < self.best[-1][:2]

    def add(self, number: int, rows: Sequence[Row[Found]]) -> None:
        """Merge the rows of a part."""
        numbers = np.sort(self._parts[number].numbers)
        self.best += [row._replace(number=int(numbers[row.number])) for row in rows]
        self.best = sorted(self.best, key=lambda row: row[:3])[: self._limit]

    @property
    def _is_full(self) -> bool:
        return self._limit is not None and len(self.best) >= self._limit

    @property
    def _most(self) -> float:
        if not self._is_full:
            return self._threshold
        return min(self._threshold, self.best[-1].cost * (1 + ROUNDING) + ROUNDING)


def _attempt_part(
    task: tuple[int, PartTask], *, work: Callable[[PartTask], PartRows[Found]]
) -> tuple[int, PartRows[Found]]:
    number, part = task
    return number, work(part)


class Ranking(NamedTuple):
    """Hits of templates, best first, and the fraction of the frames that was matched."""

    hits: list[Hit]
    fraction: float


def rank_patterns(
    patterns: Sequence[SearchPattern],
    collection: Collection,
    *,
    threshold: float,
    limit: int | None,
    jobs: Workers = 1,
) -> Ranking:
    """Hits of templates over all recordings; of equal ones the earlier recording's first."""
    is_large = collection.n_frames > LARGE_COLLECTION
    work = partial(_rank_part, patterns=tuple(patterns), limit=limit, is_large=is_large)
    merged = merge_parts(work, collection, threshold=threshold, limit=limit, jobs=jobs)
    n_frames = max(len(patterns) * collection.n_frames, 1)
    return Ranking([row.found for row in merged.rows], merged.n_matched / n_frames)


def _rank_part(
    task: PartTask, *, patterns: Sequence[SearchPattern], limit: int | None, is_large: bool
) -> PartRows[Hit]:
    for kernels in _KERNELS if is_large else ():
        load_twin(kernels, "auto", pays=True)
    matches = match(patterns, task.open())
    rows = [Row(*one) for one in matches.rank_numbered(threshold=task.most, limit=limit)]
    return PartRows(rows, matches.n_matched)
