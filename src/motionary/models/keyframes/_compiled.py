"""The search of `search_query`, compiled: the same ranges, a step per run.

The three rarest planes are combined for many integers at once, the others where something is
left. Only integers within the gap of a neighbouring keyframe's frames are read.
"""

import numba
import numpy as np
from numpy.typing import NDArray

from motionary.packing import PackedFeatures

Integers = NDArray[np.int64]
Borders = tuple[Integers, Integers, NDArray[np.int32]]

_TILE = 256


@numba.njit(cache=True, nogil=True)
def _lowest(bits: np.uint64) -> np.int64:
    """Number of the lowest set bit."""
    bits = (bits & (~bits + np.uint64(1))) - np.uint64(1)
    bits = bits - ((bits >> np.uint64(1)) & np.uint64(0x5555555555555555))
    bits = (bits & np.uint64(0x3333333333333333)) + (
        (bits >> np.uint64(2)) & np.uint64(0x3333333333333333)
    )
    bits = (bits + (bits >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return np.int64((bits * np.uint64(0x0101010101010101)) >> np.uint64(56))


@numba.njit(cache=True, nogil=True)
def _read_runs(planes: PackedFeatures, rows: Integers, spans: Integers, at_most: int) -> Integers:
    """Runs (start, stop) of the positions that all rows hold in spans of integers."""
    edges = np.empty(2 * at_most, dtype=np.int64)
    rarest = np.empty(_TILE, dtype=np.uint64)
    second, third = rows[min(1, len(rows) - 1)], rows[min(2, len(rows) - 1)]
    n = 0
    for s in range(len(spans)):
        last_bit = np.uint64(0)
        for tile in range(spans[s, 0], spans[s, 1], _TILE):
            n_integers = min(_TILE, spans[s, 1] - tile)
            for j in range(n_integers):
                rarest[j] = planes[rows[0], tile + j] & planes[second, tile + j]
            for j in range(n_integers):
                rarest[j] &= planes[third, tile + j]
            for j in range(n_integers):
                bits = rarest[j]
                if bits == 0 and last_bit == 0:
                    continue
                for row in rows[3:]:
                    bits &= planes[row, tile + j]
                changes = bits ^ ((bits << np.uint64(1)) | last_bit)
                last_bit = bits >> np.uint64(63)
                while changes != 0:
                    edges[n] = (tile + j) * 64 + _lowest(changes)
                    changes &= changes - np.uint64(1)
                    n += 1
        if last_bit != 0:
            edges[n] = spans[s, 1] * 64
            n += 1
    runs: Integers = edges[:n].reshape(-1, 2)
    return runs


@numba.njit(cache=True, nogil=True)
def _near_spans(runs: Integers, least: int, most: int, layout: Borders) -> Integers:
    """Spans of integers from `least` to `most` frames after the runs; negative looks back."""
    starts, stops, of_byte = layout
    spans = np.empty_like(runs)
    n = 0
    for i in range(len(runs)):
        sequence = of_byte[runs[i, 0] >> 3]
        first = max(runs[i, 0] + least, starts[sequence])
        last = min(runs[i, 1] - 1 + most, stops[sequence] - 1)
        if first > last:
            continue
        if n > 0 and first >> 6 <= spans[n - 1, 1]:
            spans[n - 1, 1] = max(spans[n - 1, 1], (last >> 6) + 1)
        else:
            spans[n, 0], spans[n, 1] = first >> 6, (last >> 6) + 1
            n += 1
    return spans[:n]


@numba.njit(cache=True, nogil=True)
def _cut_back(runs: Integers, after: Integers, least: int, most: int, layout: Borders) -> Integers:
    """Parts of `runs` from which a position of `after` is within the gap and the sequence."""
    starts, _, of_byte = layout
    valid = np.empty((len(runs) + len(after), 2), dtype=np.int64)
    n = 0
    j = 0
    for k in range(len(runs)):
        at, stop = runs[k]
        while j < len(after) and after[j, 1] - least <= at:
            j += 1
        i = j
        while i < len(after) and at < stop:
            first = max(at, after[i, 0] - most, starts[of_byte[after[i, 0] >> 3]])
            last = min(stop, after[i, 1] - least)
            if first >= stop:
                break
            if first < last:
                if n > 0 and valid[n - 1, 1] == first:
                    valid[n - 1, 1] = last
                else:
                    valid[n, 0], valid[n, 1] = first, last
                    n += 1
                at = last
            i += 1
    return valid[:n]


@numba.njit(cache=True, nogil=True)
def _hit_ranges(valid: list[Integers], gaps: Integers, layout: Borders) -> Integers:
    """From each first interval to the end of the latest hit that begins there, merged."""
    _, stops, of_byte = layout
    ranges = np.empty_like(valid[0])
    at = np.zeros(len(valid), dtype=np.int64)
    n = 0
    for i in range(len(valid[0])):
        start, stop = valid[0][i]
        limit = stops[of_byte[start >> 3]] - 1
        position = stop - 1
        for k in range(1, len(valid)):
            position = min(position + gaps[k - 1, 1], limit)
            while at[k] + 1 < len(valid[k]) and valid[k][at[k] + 1, 0] <= position:
                at[k] += 1
            position = min(position, valid[k][at[k], 1] - 1)
        if n > 0 and ranges[n - 1, 1] >= start:
            ranges[n - 1, 1] = position + 1
        else:
            ranges[n, 0], ranges[n, 1] = start, position + 1
            n += 1
    return ranges[:n]


@numba.njit(cache=True, nogil=True)
def search_planes(
    planes: PackedFeatures,
    rows: Integers,
    ends: Integers,
    at_most: Integers,
    order: Integers,
    gaps: Integers,
    layout: Borders,
) -> Integers:
    """Hit ranges (start, stop) of positions, shape (ranges, 2).

    rows: of all keyframes, those of keyframe k up to ends[k]; at_most: positions of each
    keyframe's rarest row; order: of reading, each but the first beside one read before;
    gaps: (least, most); layout: starts, stops and of_byte of `Layout`.
    """
    n_keyframes = len(ends)
    lists = [np.empty((0, 2), dtype=np.int64) for _ in range(n_keyframes)]
    spans = np.array([[0, planes.shape[1]]])
    for i, k in enumerate(order):
        if i > 0 and k > order[0]:
            spans = _near_spans(lists[k - 1], gaps[k - 1, 0], gaps[k - 1, 1], layout)
        elif i > 0:
            spans = _near_spans(lists[k + 1], -gaps[k, 1], -gaps[k, 0], layout)
        begin = ends[k - 1] if k > 0 else 0
        runs: Integers = _read_runs(planes, rows[begin : ends[k]], spans, at_most[k])
        if len(runs) == 0:
            return runs
        lists[k] = runs
    for k in range(n_keyframes - 2, -1, -1):
        lists[k] = _cut_back(lists[k], lists[k + 1], gaps[k, 0], gaps[k, 1], layout)
    ranges: Integers = _hit_ranges(lists, gaps, layout)
    return ranges
