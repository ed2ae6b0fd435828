"""The genetic algorithm for keyframe queries, by definition."""

import itertools
from fractions import Fraction


def holds_a_hit(keyframes, gaps, packed, known):
    """Whether any choice of one frame per keyframe is a hit in one clip.

    keyframes: pairs (value, fixed) of 0/1 per feature; gaps: pairs (least, most);
    packed, known: one row of 0/1 per frame.
    """
    for frames in itertools.product(range(len(packed)), repeat=len(keyframes)):
        steps = [b - a for a, b in itertools.pairwise(frames)]
        in_time = all(lo <= step <= hi for step, (lo, hi) in zip(steps, gaps, strict=True))
        if in_time and all(
            shows(value, fixed, packed[n], known[n])
            for n, (value, fixed) in zip(frames, keyframes, strict=True)
        ):
            return True
    return False


def shows(value, fixed, frame, known):
    """Whether a frame shows a keyframe, feature by feature."""
    return all(k and v == w for v, f, w, k in zip(value, fixed, frame, known, strict=True) if f)


def fitness(retrieved, positives, beta):
    """Equations 4.9 to 4.11 of the thesis, of sets of clips, as a fraction."""
    if not retrieved & positives:
        return Fraction(0)
    precision = Fraction(len(retrieved & positives), len(retrieved))
    recall = Fraction(len(retrieved & positives), len(positives))
    b = Fraction(beta) ** 2
    return (1 + b) * precision * recall / (b * precision + recall)


def expected_counts(values, count):
    """How often each individual is to be chosen, on average."""
    total = sum(values)
    if total == 0:
        return [Fraction(count, len(values))] * len(values)
    return [Fraction(value) / Fraction(total) * count for value in values]


def is_legal(positions, values, fixed, least, most, n_columns, n_features):
    """Whether these numbers are a query over a template."""
    n = len(positions)
    return (
        n >= min(2, n_columns)
        and len(values) == len(fixed) == n
        and len(least) == len(most) == n - 1
        and list(positions) == sorted(positions)
        and all(0 <= p < n_columns for p in positions)
        and all(0 <= f < 2**n_features for f in fixed)
        and all(v & ~f == 0 for v, f in zip(values, fixed, strict=True))
        and all(0 <= lo <= hi for lo, hi in zip(least, most, strict=True))
    )
