"""Scored paths in a sequence that is still going on.

All patterns are matched at once, a frame at a time: with steps (1, 1), (1, 2) and (2, 1) no
cell depends on another one of its own frame. What comes out, in all, is what `score_patterns`
gives for the whole sequence, and each path at most `SETTLED` frames after its end.

Conventions: as of `path_scores`; single precision, the same operations in the same order.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motionary.matching._numpy import prepare, prepare_weighed
from motionary.matching.path_scores import (
    DEFAULTS,
    GRAIN,
    SETTLED,
    CellRatios,
    PathScoreSettings,
    check_ratios,
    sum_weights,
)
from motionary.matching.pattern import SKIP_WEIGHT, Pattern
from motionary.packing import PackedFeatures, unpack

Single = NDArray[np.float32]
_AGAIN = np.float32(SKIP_WEIGHT - 1)
_BACK = (1, 2, 1, 1)


@dataclass(frozen=True, slots=True)
class StreamedPath:
    """A scored path of one pattern; frames are half-open and count from the stream's first."""

    stop: int
    pattern: int
    start: int
    score: float
    cost: float


class PathStream:
    """Scored paths of patterns in packed features that arrive a frame at a time.

    Parameters
    ----------
    patterns, ratios : of the same templates, in one order
    settings : as of `score_patterns`

    Raises
    ------
    InvalidInput
        If patterns and ratios do not fit.
    """

    #: What changes as frames arrive.
    REMEMBERED = (
        "_one", "_two", "_steps", "_set", "_known", "_level", "_since", "_fell", "_counts",
        "n_frames",
    )  # fmt: skip

    def __init__(
        self,
        patterns: Sequence[Pattern],
        ratios: Sequence[CellRatios],
        settings: PathScoreSettings = DEFAULTS,
    ) -> None:
        self._n_features = check_ratios(patterns, ratios)
        self._settings = settings
        self._weights = [sum_weights(ratio, settings) for ratio in ratios]
        self._units = [np.float64(GRAIN / ratio.scale) for ratio in ratios]
        lengths = np.array([len(pattern) for pattern in patterns], dtype=np.intp)
        self._lengths, self._lasts = lengths, np.cumsum(lengths) - 1
        self._divisor: Single = lengths.astype(np.float32)
        n_cells = int(lengths.sum())
        column = np.arange(n_cells) - np.repeat(self._lasts - lengths + 1, lengths)
        self._is_first, self._is_early = column == 0, column <= 1
        self._costs = _CellCosts(patterns)
        # Cells of the last two frames, moved on by a column, and by two.
        self._one = np.full(n_cells, np.inf, dtype=np.float32)
        self._two = np.full(n_cells, np.inf, dtype=np.float32)
        # No path is longer than two frames a column, and none waits longer than SETTLED.
        self._n_kept = 2 * int(lengths.max(initial=1)) + SETTLED + 1
        self._steps = np.zeros((self._n_kept, n_cells), dtype=np.uint8)
        self._set = np.zeros((self._n_kept, self._n_features), dtype=np.int64)
        self._known = np.zeros_like(self._set)
        n = len(patterns)
        self._level = np.full(n, np.inf, dtype=np.float32)
        self._since = np.zeros(n, dtype=np.intp)
        self._fell = np.zeros(n, dtype=np.bool_)
        self._counts = np.zeros(n, dtype=np.bool_)
        self.n_frames = 0

    def push(self, packed: PackedFeatures, known: PackedFeatures) -> list[StreamedPath]:
        """Paths that are settled by one more frame, by pattern, then by end.

        Parameters
        ----------
        packed, known : arrays, shape (n_integers,), uint64
        """
        row = self.n_frames % self._n_kept
        self._set[row] = unpack((packed & known)[np.newaxis], self._n_features)[0]
        self._known[row] = unpack(known[np.newaxis], self._n_features)[0]
        cells = self._march(self._costs.of_frame(packed, known), self._steps[row])
        distance: Single = cells[self._lasts] / self._divisor
        settled = self._settle(distance)
        self.n_frames += 1
        return settled

    def finish(self) -> list[StreamedPath]:
        """Paths that are settled by the end of the sequence."""
        return self._settle(np.full(len(self._lengths), np.inf, dtype=np.float32))

    def find_open(self) -> list[StreamedPath]:
        """Paths that no frame has settled: their cost has not risen for a frame or more."""
        now = self.n_frames - 1
        waits = self._fell & ~self._counts & (self._since < now)
        waits &= self._level <= self._settings.most_cost
        found = [self._score(int(i), int(self._since[i])) for i in np.flatnonzero(waits)]
        return [path for path in found if path is not None]

    def _march(self, costs: Single, steps: NDArray[np.uint8]) -> Single:
        """Accumulated costs of all cells of one frame, and the steps into them."""
        np.less(self._two, self._one, out=steps.view(np.bool_))
        cells = np.minimum(self._one, self._two)
        skipped = _move_on(self._one, self._is_early)
        skipped += costs * _AGAIN
        better = skipped < cells
        steps |= better.view(np.uint8) << 1
        np.minimum(cells, skipped, out=cells)
        cells += costs
        np.copyto(cells, costs, where=self._is_first)
        self._two, self._one = self._one, _move_on(cells, self._is_first)
        return cells

    def _settle(self, distance: Single) -> list[StreamedPath]:
        """Paths that end in minima which the distances of a frame show to be such."""
        now = self.n_frames
        changed, rises = distance != self._level, distance > self._level
        lasts = now + 1 - self._since >= SETTLED
        is_low = self._fell & (self._level <= self._settings.most_cost)
        due: list[tuple[int, int]] = []
        for i in np.flatnonzero(is_low & (changed | lasts)).tolist():
            due += [(i, end) for end in self._ends(i, now, bool(changed[i]), bool(rises[i]))]
        found = [self._score(i, end) for i, end in due]
        self._counts = ~changed & is_low & lasts
        self._fell = np.where(changed, distance < self._level, self._fell)
        self._since = np.where(changed, now, self._since)
        self._level = distance
        return [path for path in found if path is not None]

    def _ends(self, pattern: int, now: int, changed: bool, rises: bool) -> list[int]:
        """Ends of paths in the level of a pattern, those that this frame settles."""
        every, first = self._settings.every, int(self._since[pattern])
        # A frame that has the level still belongs to it.
        last = now - 1 if changed else now
        if self._counts[pattern]:
            on_grid = (last - first) % every == 0
            return [last] if on_grid != changed else []
        if changed and not rises:
            return []
        ends = list(range(first, last + 1, every))
        return [*ends, last] if changed and ends[-1] != last else ends

    def _score(self, pattern: int, end: int) -> StreamedPath | None:
        """The path of a pattern to a frame, if it tells enough."""
        weights = self._weights[pattern]
        frames, columns = self._trace(pattern, end)
        rows = frames % self._n_kept
        tells = weights.if_set[columns] * self._set[rows]
        tells += weights.if_known[columns] * self._known[rows]
        total = int(np.maximum(tells.sum(axis=0), weights.floor).sum())
        if total < weights.least:
            return None
        score, cost = float(total * self._units[pattern]), float(self._level[pattern])
        return StreamedPath(end + 1, pattern, int(frames[-1]), score, cost)

    def _trace(self, pattern: int, end: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Frames and columns that a path meets, last first."""
        last = int(self._lasts[pattern])
        column, frame = int(self._lengths[pattern]) - 1, end
        frames, columns = [frame], [column]
        base = last - column
        while column > 0:
            step = int(self._steps[frame % self._n_kept, base + column])
            frame -= _BACK[step]
            column -= 2 if step > 1 else 1
            frames.append(frame)
            columns.append(column)
        return np.array(frames, dtype=np.intp), np.array(columns, dtype=np.intp)


def _move_on(cells: Single, without: NDArray[np.bool_]) -> Single:
    """Cells as the next column sees them; infinite where there is no column before."""
    moved = np.empty_like(cells)
    moved[1:] = cells[:-1]
    moved[without] = np.inf
    return moved


class _CellCosts:
    """Costs of the columns of all patterns against one frame."""

    def __init__(self, patterns: Sequence[Pattern]) -> None:
        plain = [one.entry_weights is None and one.values.shape[1] == 1 for one in patterns]
        self._plain = all(plain)
        n_integers = patterns[0].values.shape[1] if patterns else 1
        self._fixed = np.concatenate([one.fixed for one in patterns])
        if self._plain:
            columns = [prepare(one) for one in patterns]
            self._values = np.concatenate([one.values for one in columns])
            self._half = np.concatenate([one.half for one in columns])
            self._full = np.concatenate([one.full for one in columns])
            self._unit = np.concatenate([one.unit for one in columns])
            self._rows = np.arange(len(self._half)) * self._unit.shape[1]
            return
        weighed = [prepare_weighed(one) for one in patterns]
        tables = [
            _spread(
                [getattr(one, name) for one in weighed], [one.used for one in weighed], n_integers
            )
            for name in ("if_set", "if_known", "weights")
        ]
        self._if_set, self._if_known, self._seen_weights = tables
        self._n_fixed = np.concatenate([one.n_fixed for one in weighed])
        self._column_weights = np.concatenate([one.column_weights for one in weighed])

    def of_frame(self, packed: PackedFeatures, known: PackedFeatures) -> Single:
        """Cost of each cell, shape (cells,), single precision."""
        seen = known & self._fixed
        if not self._plain:
            return self._weigh(packed & known, known, seen)
        n_seen = np.bitwise_count(seen[:, 0])
        wrong = np.bitwise_count((packed[0] ^ self._values) & seen[:, 0])
        costs: Single = wrong * self._unit.take(self._rows + n_seen)
        np.copyto(costs, self._full, where=n_seen < self._half)
        return costs

    def _weigh(self, packed: PackedFeatures, known: PackedFeatures, seen: PackedFeatures) -> Single:
        fraction = _sum_bytes(self._if_set, packed) + _sum_bytes(self._if_known, known)
        weight = _sum_bytes(self._seen_weights, known)
        fraction /= np.where(weight > 0, weight, 1.0)
        n_seen = np.bitwise_count(seen).sum(axis=1, dtype=np.int64)
        weighed = np.where(2 * n_seen < self._n_fixed, 1.0, fraction) * self._column_weights
        costs: Single = weighed.astype(np.float32)
        return costs


def _spread(
    tables: Sequence[NDArray[np.float64]], used: Sequence[NDArray[np.intp]], n_integers: int
) -> NDArray[np.float64]:
    """Tables of all cells and bytes, shape (bytes, 256, cells); zero where a byte is free."""
    n_cells = sum(len(table) for table in tables)
    spread = np.zeros((8 * n_integers, 256, n_cells))
    first = 0
    for table, places in zip(tables, used, strict=True):
        spread[places, :, first : first + len(table)] = np.moveaxis(table, 0, -1)
        first += len(table)
    return spread


def _sum_bytes(tables: NDArray[np.float64], packed: PackedFeatures) -> NDArray[np.float64]:
    total = np.zeros(tables.shape[2])
    for table, byte in zip(tables, packed.astype("<u8").view(np.uint8), strict=True):
        total += table[byte]
    return total
