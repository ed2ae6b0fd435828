"""Weighted interval scheduling: the set of matches that tells most without overlap.

Every match has a value; of matches that overlap and need a part of the body in common,
only one can be right. Where all need the same parts, the set of the largest total is found
by dynamic programming over the ends (Kleinberg and Tardos, Algorithm Design, section 6.1);
otherwise by dynamic programming over the times from which each part is free. Ends of
matches are uncertain by a fraction of their length: intervals are shrunk by it before
overlap is tested.

Conventions: intervals are half-open, in frames or seconds. Parts are bits of an integer.
The same intervals in the same order give the same set, also where totals are equal.
"""

from bisect import insort
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motionary.errors import InvalidInput
from motionary.matching._interval_sets import Item, best_of, fits

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

#: All parts of the body.
WHOLE_BODY = (1 << 63) - 1
# Later intervals overlap none but the last so many that were chosen.
_MOST_KEPT = 256


@dataclass(frozen=True, slots=True)
class SchedulingSettings:
    """Settings of label assignment; chosen on exercises and everyday motion.

    Attributes
    ----------
    threshold : score of a match at which it is as good as no label
    shrink : fraction of its length that a match gives up at either end before overlap is
        tested
    look_ahead_s : how long after its end a match is decided
    most_gap_s : labels of a state at most so far apart are one
    """

    threshold: float = 6.0
    shrink: float = 0.1
    look_ahead_s: float = 4.0
    most_gap_s: float = 0.5


DEFAULTS = SchedulingSettings()


class Intervals(NamedTuple):
    """Matches that compete.

    Attributes
    ----------
    starts, ends : arrays, shape (n,), half-open
    values : array, shape (n,); of a value of 0 or less a match is never chosen
    parts : array, shape (n,), int64: bits of the parts of the body that each needs
    """

    starts: Floats
    ends: Floats
    values: Floats
    parts: NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class ScheduleState:
    """What a causal choice remembers between chunks.

    Attributes
    ----------
    now : time up to which everything has arrived
    n_seen : number of intervals so far
    waiting : intervals that are not decided
    chosen : the last ones that were chosen, by end
    """

    now: float = -np.inf
    n_seen: int = 0
    waiting: tuple[Item, ...] = ()
    chosen: tuple[Item, ...] = ()


def intervals(
    starts: ArrayLike, ends: ArrayLike, values: ArrayLike, parts: ArrayLike = WHOLE_BODY
) -> Intervals:
    """Checked intervals; one mask of parts holds for all.

    Raises
    ------
    InvalidInput
        If the arrays differ in length, an interval ends before it starts, a number is not
        finite, or one needs no part.
    """
    start, end, value = (np.asarray(a, dtype=np.float64) for a in (starts, ends, values))
    if start.ndim != 1 or not start.shape == end.shape == value.shape:
        raise InvalidInput(
            "intervals need starts, ends and values of one length, got shapes "
            f"{start.shape}, {end.shape} and {value.shape}"
        )
    mask = np.asarray(parts, dtype=np.int64)
    if mask.shape not in ((), start.shape):
        raise InvalidInput(f"parts need shape {start.shape} or one number, got {mask.shape}")
    if not all(np.isfinite(a).all() for a in (start, end, value)) or not (start <= end).all():
        raise InvalidInput("intervals need finite numbers, and must not end before they start")
    if (mask <= 0).any():
        raise InvalidInput("each interval needs a part of the body, a mask above 0")
    return Intervals(start, end, value, np.broadcast_to(mask, start.shape))


def choose_intervals(candidates: Intervals, *, shrink: float = DEFAULTS.shrink) -> Indices:
    """Indices of the compatible intervals of the largest total value, by end.

    Parameters
    ----------
    shrink : fraction of their length that intervals may overlap by, at either end

    Raises
    ------
    InvalidInput
        If `shrink` lies outside [0, 0.5).
    """
    return _places(best_of(sorted(_items(candidates, shrink))))


def choose_causally(
    candidates: Intervals, *, look_ahead: float, shrink: float = DEFAULTS.shrink
) -> Indices:
    """Indices of chosen intervals, each decided `look_ahead` after its end; by end.

    With a look-ahead as long as the recording the result is that of `choose_intervals`.

    Parameters
    ----------
    look_ahead : in the unit of the intervals
    shrink : as in `choose_intervals`
    """
    order = np.argsort(candidates.ends, kind="stable")
    starts, ends, values, parts = candidates
    arriving = Intervals(starts[order], ends[order], values[order], parts[order])
    chosen, _ = advance(ScheduleState(), arriving, now=np.inf, look_ahead=look_ahead, shrink=shrink)
    return np.asarray(order[chosen], dtype=np.intp)


def advance(
    state: ScheduleState,
    arrived: Intervals,
    *,
    now: float,
    look_ahead: float,
    shrink: float = DEFAULTS.shrink,
) -> tuple[Indices, ScheduleState]:
    """Indices that are chosen for good by now, and the state; the same for any chunks.

    What ends at one time is decided `look_ahead` later, by the best choice from all that
    has ended by then and is not yet left out; what was chosen before stays.

    Parameters
    ----------
    arrived : intervals that ended since the last call and up to now, by end
    now : time up to which everything has arrived; infinite at the end of a recording

    Returns
    -------
    chosen, state : indices, counted over all calls, by end; and the next call's state

    Raises
    ------
    InvalidInput
        If intervals are not in the order of their ends, or ended outside this chunk.
    """
    ends = arrived.ends
    if not look_ahead >= 0:
        raise InvalidInput(f"look_ahead must be at least 0, got {look_ahead}")
    if len(ends) and not (state.now < ends[0] and ends[-1] <= now and (np.diff(ends) >= 0).all()):
        raise InvalidInput(
            f"intervals must arrive by their ends, after {state.now} and up to {now}, got ends "
            f"from {ends.min()} to {ends.max()}"
        )
    items = _items(arrived, shrink, first=state.n_seen)
    waiting, chosen, final = list(state.waiting), list(state.chosen), list[Item]()
    place = 0
    while waiting or place < len(items):
        earliest = min(item.end for item in (*waiting, *items[place : place + 1]))
        moment = earliest + look_ahead
        while place < len(items) and items[place].end <= moment:
            if fits(items[place], chosen):
                insort(waiting, items[place])
            place += 1
        if moment > now:
            break
        best = [item for item in best_of(waiting) if item.end == earliest]
        final += sorted(best, key=lambda item: item.place)
        chosen = [*chosen, *best][-_MOST_KEPT:]
        waiting = [i for i in waiting if i.end > earliest and fits(i, best)]
    rest = state.n_seen + len(ends)
    indices = np.array([item.place for item in final], dtype=np.intp)
    return indices, ScheduleState(now, rest, tuple(waiting), tuple(chosen))


def foresee(state: ScheduleState, further: Intervals) -> Indices:
    """Indices that would be chosen if nothing more came, by end; nothing is decided.

    Parameters
    ----------
    further : intervals beside those that wait; their indices follow those that were seen
    """
    items = _items(further, DEFAULTS.shrink, first=state.n_seen)
    fitting = [item for item in items if fits(item, state.chosen)]
    return _places(best_of(sorted([*state.waiting, *fitting])))


def _places(chosen: list[Item]) -> Indices:
    by_end = sorted(chosen, key=lambda item: (item.end, item.place))
    return np.array([item.place for item in by_end], dtype=np.intp)


@dataclass(slots=True, eq=False)
class StateJoiner:
    """Joins chosen intervals of one state to labels, as they come by their starts.

    Intervals of one class that is a state are one label where the gap between neighbours
    is at most `most_gap` and no interval of another class that needs one of their parts
    begins between them. Labels are numbered by their first intervals.

    Attributes
    ----------
    most_gap : in the unit of the intervals
    """

    most_gap: float
    _earlier: list[tuple[int, int, int]] = field(default_factory=list)
    _label_ends: dict[int, float] = field(default_factory=dict)
    _n_labels: int = 0

    def add(self, start: float, end: float, kind: int, parts: int, *, is_state: bool) -> int:
        """Number of the label of the next interval, by start and then by end."""
        label = -1
        if is_state:
            for other, needs, number in reversed(self._earlier):
                if other == kind or needs & parts:
                    near = other == kind and start - self._label_ends[number] <= self.most_gap
                    label = number if near else -1
                    break
        if label < 0:
            label, self._n_labels = self._n_labels, self._n_labels + 1
        self._label_ends[label] = max(self._label_ends.get(label, end), end)
        self._earlier.append((kind, parts, label))
        if len(self._earlier) > 2 * _MOST_KEPT:
            self._forget()
        return label

    def copy(self) -> "StateJoiner":
        """A joiner that goes on from here by itself."""
        return StateJoiner(
            self.most_gap, list(self._earlier), dict(self._label_ends), self._n_labels
        )

    def _forget(self) -> None:
        self._earlier = self._earlier[-_MOST_KEPT:]
        kept = {number for _, _, number in self._earlier}
        self._label_ends = {n: end for n, end in self._label_ends.items() if n in kept}


def join_states(
    chosen: Intervals, classes: ArrayLike, is_state: ArrayLike, *, most_gap: float
) -> Indices:
    """Number of the label to which each chosen interval belongs, shape (n,).

    Parameters
    ----------
    chosen : by end
    classes : array, shape (n,): class of each interval
    is_state : array, shape (n,), bool: whether that class is a state
    most_gap : as of `StateJoiner`
    """
    kinds, states = np.asarray(classes), np.asarray(is_state, dtype=np.bool_)
    label = np.full(len(kinds), -1, dtype=np.intp)
    joiner = StateJoiner(most_gap)
    for i in np.lexsort((chosen.ends, chosen.starts)).tolist():
        label[i] = joiner.add(
            float(chosen.starts[i]),
            float(chosen.ends[i]),
            kinds[i],
            int(chosen.parts[i]),
            is_state=bool(states[i]),
        )
    return label


def _items(candidates: Intervals, shrink: float, *, first: int = 0) -> list[Item]:
    """Intervals that may be chosen, within their margins; indices count from `first`."""
    if not 0 <= shrink < 0.5:
        raise InvalidInput(f"shrink must be at least 0 and below 0.5, got {shrink}")
    starts, ends, values, parts = candidates
    margin = shrink * (ends - starts)
    index = np.flatnonzero(values > 0)
    columns = (ends - margin, starts + margin, np.arange(len(ends)) + first, ends, values, parts)
    return [Item(*item) for item in zip(*(c[index].tolist() for c in columns), strict=True)]
