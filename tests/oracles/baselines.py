"""Costs of frames, one joint of one pair of frames at a time."""

from math import acos, sqrt


def angles(example, document):
    """Mean geodesic distance of unit quaternions."""
    return [[_mean(_angle(a, b) for a, b in zip(x, y, strict=True)) for y in document]
            for x in example]  # fmt: skip


def distances(example, document):
    """Mean distance of places."""
    return [[_mean(_distance(a, b) for a, b in zip(x, y, strict=True)) for y in document]
            for x in example]  # fmt: skip


def _angle(a, b):
    cosine = sum(x * y for x, y in zip(a, b, strict=True))
    return 2 * acos(min(1, abs(cosine)))


def _distance(a, b):
    return sqrt(sum((x - y) ** 2 for x, y in zip(a, b, strict=True)))


def _mean(values):
    values = list(values)
    return sum(values) / len(values)
