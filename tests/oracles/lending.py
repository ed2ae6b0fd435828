"""Poses of a limb by the rest of the body, frame by frame as defined."""

import numpy as np


def velocity(values, at, step, rate_hz):
    """Difference over `step` to either side, fewer at the ends, by the seconds between."""
    ahead, behind = min(at + step, len(values) - 1), max(at - step, 0)
    return (values[ahead] - values[behind]) / (max(ahead - behind, 1) / rate_hz)


def blend(poses, columns, own, seen, limb, *, rate_hz, beside, moved, moved_s, agrees):
    """Mean of the limb in poses (examples, columns, points, 3), by how the others agree."""
    result = np.full((len(own), len(limb), 3), np.nan)
    others = [k for k in range(own.shape[1]) if k not in limb]
    for frame, column in enumerate(columns):
        if column < 0:
            continue
        offered, misfits = [], []
        for example in poses:
            for near in range(column - beside, column + beside + 1):
                if not 0 <= near < len(example):
                    continue
                costs = []
                for point in others:
                    if seen[frame, point]:
                        off = example[near, point] - own[frame, point]
                        here = velocity(own[:, point], frame, round(moved * rate_hz / 30), rate_hz)
                        there = velocity(example[:, point], near, moved, 30)
                        costs.append(off @ off + moved_s**2 * ((there - here) @ (there - here)))
                offered.append(example[near][limb])
                misfits.append(np.mean(costs) if costs else 0.0)
        weights = np.exp(-(np.array(misfits) - min(misfits)) / (2 * agrees**2))
        result[frame] = np.tensordot(weights / weights.sum(), offered, axes=1)
    return result
