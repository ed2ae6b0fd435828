"""Keyframe queries by trying everything."""

import itertools

import numpy as np


def shows(value, fixed, frame, known):
    """Whether a frame shows a keyframe, feature by feature.

    value, fixed, frame, known: sequences of 0/1, one entry per feature.
    """
    return all(k and v == w for v, f, w, k in zip(value, fixed, frame, known, strict=True) if f)


def all_hits(keyframes, gaps, packed, known):
    """All hits (n_1, ..., n_K) in one document, 0-based, in lexicographic order.

    keyframes: pairs (value, fixed); gaps: pairs (least, most), most None = no bound;
    packed, known: arrays (frames, features) of 0/1.
    """
    candidates = [
        [n for n in range(len(packed)) if shows(*keyframe, packed[n], known[n])]
        for keyframe in keyframes
    ]
    found = []
    for hit in itertools.product(*candidates):
        right_gaps = all(
            least <= after - before and (most is None or after - before <= most)
            for (least, most), before, after in zip(gaps, hit, hit[1:], strict=False)
        )
        if right_gaps:
            found.append(hit)
    return found


def covered_ranges(hits, n_frames):
    """Union of [n_1 : n_K] over hits, as half-open maximal runs of frames."""
    covered = np.zeros(n_frames + 2, dtype=bool)
    for hit in hits:
        covered[hit[0] + 1 : hit[-1] + 2] = True
    ranges, start = [], None
    for n in range(n_frames + 2):
        if covered[n] and start is None:
            start = n - 1
        if not covered[n] and start is not None:
            ranges.append((start, n - 1))
            start = None
    return ranges


def plain_runs(frames):
    """Maximal runs [s : t] of ascending frames, both ends included."""
    result = []
    for n in frames:
        if result and result[-1][1] == n - 1:
            result[-1][1] = n
        else:
            result.append([n, n])
    return [tuple(run) for run in result]


def match_of(hit, lists):
    """Numbers of the segments [s, t] that hold each frame of a hit."""
    return tuple(
        next(i for i, (s, t) in enumerate(segments) if s <= n <= t)
        for n, segments in zip(hit, lists, strict=True)
    )


def choose(values, fixed, groups, count, min_distance, zero_weight):
    """Keyframes (column, group) by the rule of thumb, in the order of time.

    values, fixed: arrays (columns, features); groups: the group of every feature.
    """
    n_columns = len(values)
    ramp = n_columns // 5
    names = list(dict.fromkeys(groups))
    scores = {}
    for name in names:
        members = [i for i, group in enumerate(groups) if group == name]
        for k in range(n_columns):
            ones = sum(bool(fixed[k, i] and values[k, i]) for i in members)
            zeros = sum(bool(fixed[k, i] and not values[k, i]) for i in members)
            score = (2 * ones + zero_weight * zeros) / len(members)
            # Halves of a Hann window over the first and the last fifth.
            step = min(k + 1, n_columns - k)
            if step <= ramp:
                score *= 0.5 - 0.5 * np.cos(np.pi * step / (ramp + 1))
            scores[name, k] = score
    chosen = []
    while len(chosen) < count:
        best = max(scores.values())
        if best <= 0:
            break
        # Ties: the first group, then the first column.
        name, k = next((g, k) for g in names for k in range(n_columns) if scores[g, k] == best)
        chosen.append((k, name))
        low, high = max(k - min_distance, 0), min(k + min_distance, n_columns - 1)
        while low > 0 and scores[name, low - 1] < scores[name, low]:
            low -= 1
        while high < n_columns - 1 and scores[name, high + 1] < scores[name, high]:
            high += 1
        for blanked in range(low, high + 1):
            for g in names:
                scores[g, blanked] = 0.0
    return sorted(chosen)
