"""The best set of intervals of which those that conflict exclude each other.

Intervals conflict that overlap and need a part in common. Where any two that overlap
conflict, the best set is found by dynamic programming over the ends (Kleinberg and Tardos,
Algorithm Design, section 6.1), otherwise by dynamic programming over the times from which
each part is free.
"""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Iterator, Sequence
from functools import reduce
from itertools import combinations
from operator import le, or_
from typing import NamedTuple

#: Sets that differ in when parts are free are followed up to so many at a time, those first
#: that can reach most: exact where no more are worth following, and a bound on time.
MOST_SETS = 256


class Item(NamedTuple):
    """An interval within its margins; sorts by its stop. `place` is its index."""

    stop: float
    begin: float
    place: int
    end: float
    value: float
    parts: int


def fits(item: Item, others: Sequence[Item]) -> bool:
    """Whether an interval can stand beside others, which are sorted by end."""
    for other in reversed(others):
        if other.end <= item.begin:
            return True
        if other.stop > item.begin and item.stop > other.begin and other.parts & item.parts:
            return False
    return True


def best_of(items: Sequence[Item]) -> list[Item]:
    """Compatible intervals of the largest total; items sorted."""
    if len({item.parts for item in items}) <= 1:
        return _solve_alike(items)
    chosen = []
    for cluster in _clusters(items):
        alike = all(a & b for a, b in combinations({i.parts for i in cluster}, 2))
        chosen += _solve_alike(cluster) if alike else _solve_by_parts(cluster)
    return chosen


def _clusters(items: Sequence[Item]) -> Iterator[list[Item]]:
    """Items, sorted, in groups between which nothing conflicts."""
    cluster: list[Item] = []
    last = -math.inf
    for item in sorted(items, key=lambda item: (item.begin, item.stop)):
        if cluster and item.begin >= last:
            yield from _by_common_parts(cluster)
            cluster = []
        cluster.append(item)
        last = max(last, item.stop)
    yield from _by_common_parts(cluster)


def _by_common_parts(cluster: list[Item]) -> Iterator[list[Item]]:
    masks: list[int] = []
    for mask in {item.parts for item in cluster}:
        joined = [m for m in masks if m & mask]
        masks = [m for m in masks if not m & mask]
        masks.append(reduce(or_, joined, mask))
    for mask in sorted(masks):
        yield sorted(item for item in cluster if item.parts & mask)


def _solve_alike(items: Sequence[Item]) -> list[Item]:
    """Best of intervals of which any two that overlap conflict; items sorted.

    Of sets of one total the one is taken that leaves out the interval that ends last.
    """
    stops = [item.stop for item in items]
    best, before = [0.0], []
    for i, item in enumerate(items):
        before.append(min(bisect_right(stops, item.begin), i))
        best.append(max(best[i], item.value + best[before[i]]))
    chosen, i = [], len(items)
    while i > 0:
        if best[i] > best[i - 1]:
            chosen.append(items[i - 1])
            i = before[i - 1]
        else:
            i -= 1
    return chosen[::-1]


class _Set(NamedTuple):
    """Chosen intervals as a linked list, their total, and from when each part is free."""

    total: float
    free: tuple[float, ...]
    chosen: tuple[Item, "_Set"] | None


def _solve_by_parts(items: Sequence[Item]) -> list[Item]:
    """Best of intervals that need different parts.

    Taken in the order of their begins, a choice is known by its total and the time from
    which each part is free; one that cannot reach what another has reached is dropped.
    """
    ordered = _worthwhile(items)
    atoms = _parts_that_differ(ordered)
    uses = [[a for a, mask in enumerate(atoms) if item.parts & mask] for item in ordered]
    bound = _Bound(ordered, uses, len(atoms))
    reached = sum(item.value for item in _solve_alike(items))
    sets = [_Set(0.0, (-math.inf,) * len(atoms), None)]
    for item, used in zip(ordered, uses, strict=True):
        grown: dict[tuple[float, ...], _Set] = {}
        for old in sets:
            free = tuple(max(time, item.begin) for time in old.free)
            _keep(grown, old._replace(free=free))
            if all(free[a] == item.begin for a in used):
                taken = tuple(item.stop if a in used else t for a, t in enumerate(free))
                _keep(grown, _Set(old.total + item.value, taken, (item, old)))
        reached = max(reached, *(s.total for s in grown.values()))
        rated = [(s.total + bound.most_after(s.free), s) for s in grown.values()]
        least = reached - 1e-9 * (1 + reached)
        rated = sorted((pair for pair in rated if pair[0] >= least), key=lambda pair: -pair[0])
        sets = _undominated(s for _, s in rated)
    return _members(max(sets, key=lambda s: s.total))


def _worthwhile(items: Sequence[Item]) -> list[Item]:
    """Intervals that no other can replace in every set, by begin.

    One can that lies within, needs no further part, and has at least the value.
    """
    ordered = sorted(items, key=lambda item: (item.begin, item.stop, item.place))
    kept: list[Item] = []
    # From the last begin: what lies within begins no earlier.
    for item in reversed(ordered):
        begun = kept[bisect_left(kept, -item.stop, key=lambda other: -other.begin) :]
        if not any(
            other.stop <= item.stop and other.value >= item.value and not other.parts & ~item.parts
            for other in begun
        ):
            kept.append(item)
    return kept[::-1]


def _undominated(sets: Iterable[_Set]) -> list[_Set]:
    """Sets, the most promising first, without those that another surpasses throughout."""
    kept: list[_Set] = []
    for new in sets:
        if not any(old.total >= new.total and all(map(le, old.free, new.free)) for old in kept):
            kept.append(new)
            if len(kept) == MOST_SETS:
                break
    return kept


def _parts_that_differ(items: Sequence[Item]) -> list[int]:
    """One bit for each group of parts that all intervals need together or not at all."""
    masks = sorted({item.parts for item in items})
    used = reduce(or_, masks)
    by_users: dict[tuple[bool, ...], int] = {}
    for bit in (1 << b for b in range(used.bit_length())):
        if used & bit:
            by_users.setdefault(tuple(bool(mask & bit) for mask in masks), bit)
    return list(by_users.values())


class _Bound:
    """Most that intervals can add to a choice: each part chooses for itself.

    An interval's value is divided among the parts that it needs.
    """

    def __init__(self, ordered: Sequence[Item], uses: list[list[int]], n_atoms: int) -> None:
        self._begins: list[list[float]] = []
        self._most: list[list[float]] = []
        for a in range(n_atoms):
            own = [(i, len(u)) for i, u in zip(ordered, uses, strict=True) if a in u]
            begins = [item.begin for item, _ in own]
            most = [0.0] * (len(own) + 1)
            for j in range(len(own) - 1, -1, -1):
                item, n_used = own[j]
                after = most[max(bisect_left(begins, item.stop), j + 1)]
                most[j] = max(most[j + 1], item.value / n_used + after)
            self._begins.append(begins)
            self._most.append(most)

    def most_after(self, free: tuple[float, ...]) -> float:
        """Bound on what intervals add that begin when their parts are free."""
        parts = zip(self._begins, self._most, free, strict=True)
        return sum(most[bisect_left(begins, time)] for begins, most, time in parts)


def _keep(sets: dict[tuple[float, ...], _Set], new: _Set) -> None:
    old = sets.get(new.free)
    if old is None or new.total > old.total:
        sets[new.free] = new


def _members(last: _Set) -> list[Item]:
    found = []
    node = last.chosen
    while node is not None:
        found.append(node[0])
        node = node[1].chosen
    return sorted(found)
