"""The best set of intervals by trying all sets, and the choice with a look-ahead."""

from itertools import combinations


def shrunk(interval, shrink):
    start, end = interval[0], interval[1]
    return start + shrink * (end - start), end - shrink * (end - start)


def conflict(a, b, shrink):
    """Intervals are (start, end, value, parts); parts is a set."""
    (begin_a, stop_a), (begin_b, stop_b) = shrunk(a, shrink), shrunk(b, shrink)
    return bool(a[3] & b[3]) and stop_a > begin_b and stop_b > begin_a


def fit(intervals, shrink):
    return not any(conflict(a, b, shrink) for a, b in combinations(intervals, 2))


def best_set(intervals, shrink):
    """Indices of a set of the largest total, none of value 0 or less; tries all that fit."""

    def best_from(i, chosen):
        if i == len(intervals):
            return sum(intervals[j][2] for j in chosen), chosen
        without = best_from(i + 1, chosen)
        if intervals[i][2] <= 0 or any(
            conflict(intervals[i], intervals[j], shrink) for j in chosen
        ):
            return without
        return max(without, best_from(i + 1, chosen | {i}), key=lambda pair: pair[0])

    return set(best_from(0, frozenset())[1])


def causal_set(intervals, shrink, look_ahead):
    """Indices: each end is decided by the best of what ended at most `look_ahead` after."""
    final, left_out = [], set()
    for end in sorted({interval[1] for interval in intervals}):
        open_ones = [
            i
            for i, interval in enumerate(intervals)
            if interval[1] <= end + look_ahead
            and interval[2] > 0
            and i not in left_out
            and i not in final
            and not any(conflict(interval, intervals[j], shrink) for j in final)
        ]
        best = best_set([intervals[i] for i in open_ones], shrink)
        for place, i in enumerate(open_ones):
            if intervals[i][1] == end:
                if place in best:
                    final.append(i)
                else:
                    left_out.add(i)
    return set(final)
