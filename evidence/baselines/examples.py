"""One example searched for without a template.

DTW of the example's frames in a document, after Müller and Röder (2006), section 5.5: on
features with the Manhattan distance, on local rotations with the geodesic distance of
unit quaternions, and on normalised joint positions with the Euclidean distance.
"""

from collections.abc import Callable, Mapping
from functools import partial
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evidence.baselines.dtw import match_costs
from evidence.baselines.frames import feature_frames, position_frames, rotation_frames
from motionary.errors import InvalidInput
from motionary.matching import SKIP_WEIGHT, Hit
from motionary.motion import Motion

Floats = NDArray[np.float64]


class Baseline(NamedTuple):
    """A way to compare frames.

    Attributes
    ----------
    measure : frames of a motion at 30 Hz, shape (frames, ...)
    costs : of the frames of an example and of a document, the matrix (columns, frames)
    """

    measure: Callable[[Motion], Floats]
    costs: Callable[[Floats, Floats], Floats]


def find_example(
    example: Motion,
    motion: Motion,
    *,
    baseline: str = "positions",
    threshold: float = np.inf,
    limit: int | None = 10,
    skip_weight: float = SKIP_WEIGHT,
) -> list[Hit]:
    """Stretches of a motion that are like an example, cheapest first.

    Of stretches that share more than half of the shorter one, the cheapest counts.

    Parameters
    ----------
    example, motion : Motion
    baseline : one of `BASELINES`
    threshold : largest cost of a hit, in the baseline's own unit
    limit : most hits to return; all if None
    skip_weight : how often the cell after a (2, 1) step counts

    Returns
    -------
    list of Hit, frames at 30 Hz

    Raises
    ------
    InvalidInput
        If the baseline is unknown, or the motions lack what it compares.
    """
    if baseline not in BASELINES:
        raise InvalidInput(f"baseline must be one of {', '.join(BASELINES)}, got {baseline!r}")
    way = BASELINES[baseline]
    matches = match_costs(
        way.costs(way.measure(example), way.measure(motion)), skip_weight=skip_weight
    )
    hits: list[Hit] = []
    for end in np.argsort(matches.distance, kind="stable"):
        cost = float(matches.distance[end])
        if cost > threshold or np.isinf(cost) or len(hits) == limit:
            break
        hit = Hit(int(matches.starts[end]), int(end) + 1, cost)
        if not any(_same(hit, taken) for taken in hits):
            hits.append(hit)
    return hits


def _same(one: Hit, other: Hit) -> bool:
    shared = min(one.stop, other.stop) - max(one.start, other.start)
    return 2 * shared > min(one.stop - one.start, other.stop - other.start)


def feature_costs(example: Floats, document: Floats) -> Floats:
    """Fraction of the features known in both that disagree; 1 if fewer than half are known."""
    seen_x, seen_y = np.isfinite(example), np.isfinite(document)
    x, y = np.where(seen_x, example, 0.0), np.where(seen_y, document, 0.0)
    n_known = seen_x.astype(np.float64) @ seen_y.T.astype(np.float64)
    # |x - y| of zeros and ones is x + y - 2 x y, each where the other is known.
    wrong = x @ seen_y.T + seen_x @ y.T - 2 * (x @ y.T)
    costs = np.divide(wrong, n_known, out=np.ones_like(wrong), where=2 * n_known >= x.shape[1])
    return np.asarray(np.maximum(costs, 0.0))


def rotation_costs(example: Floats, document: Floats) -> Floats:
    """Mean angle in radians between the local rotations of all joints."""
    _check_joints(example, document)
    costs = np.zeros((len(example), len(document)))
    for joint in range(example.shape[1]):
        cosine = np.abs(example[:, joint] @ document[:, joint].T)
        costs += 2 * np.arccos(np.minimum(cosine, 1.0))
    costs /= example.shape[1]
    return costs


def position_costs(example: Floats, document: Floats) -> Floats:
    """Mean distance of the joints seen in both; infinite if there is none."""
    _check_joints(example, document)
    total = np.zeros((len(example), len(document)))
    n_seen = np.zeros_like(total)
    for joint in range(example.shape[1]):
        x, y = example[:, joint], document[:, joint]
        squares = (x**2).sum(1)[:, np.newaxis] + (y**2).sum(1) - 2 * (x @ y.T)
        seen = np.isfinite(squares)
        total += np.sqrt(np.where(seen, np.maximum(squares, 0.0), 0.0))
        n_seen += seen
    return np.divide(total, n_seen, out=np.full_like(total, np.inf), where=n_seen > 0)


def _check_joints(example: Floats, document: Floats) -> None:
    if example.shape[1:] != document.shape[1:]:
        raise InvalidInput(
            "example and motion must have the same joints, got frames of shape "
            f"{example.shape[1:]} and {document.shape[1:]}; compare features instead"
        )


#: By name: features with equal weights, rotations, and positions whose heading, or whole
#: rotation as in print, is removed.
BASELINES: Mapping[str, Baseline] = MappingProxyType(
    {
        "relations": Baseline(feature_frames, feature_costs),
        "quaternions": Baseline(rotation_frames, rotation_costs),
        "positions": Baseline(position_frames, position_costs),
        "positions-upright": Baseline(partial(position_frames, removed="rotation"), position_costs),
    }
)
