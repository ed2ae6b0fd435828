"""One example as the query, among clips that stand one behind the other.

Two empty frames between clips keep paths apart, as in a corpus of words.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evidence.baselines import BASELINES, match_costs
from evidence.common.recordings import Clip, Recordings
from motionary.evaluation import compute_average_precision

Floats = NDArray[np.float64]
Joined = tuple[Floats, NDArray[np.bool_]]

#: Ways of the publication, by the names of the package.
BASELINE = {"RF": "relations", "Q": "quaternions", "3D": "positions-upright",
            "3D heading": "positions"}  # fmt: skip
RANKS = (5, 10, 20)
MOST = 10
INFINITE = "inf"


class Frames:
    """Frames of clips, measured once, one behind the other with two empty ones between."""

    def __init__(self, recordings: Recordings, clips: Sequence[Clip], way: str) -> None:
        self._way = BASELINES[BASELINE[way]]
        measured = [self._way.measure(recordings.motion(clip.name)) for clip in clips]
        if way == "RF":
            measured = [frames[:, :39] for frames in measured]
        self.by_name = {c.name: frames for c, frames in zip(clips, measured, strict=True)}

    def join(self, clips: Sequence[Clip]) -> Joined:
        """All frames, and which of them lie between the clips."""
        parts, between = [], []
        for clip in clips:
            frames = self.by_name[clip.name]
            empty = np.zeros((2, *frames.shape[1:]))
            parts += [frames, empty]
            between += [np.zeros(len(frames), np.bool_), np.ones(2, np.bool_)]
        return np.concatenate(parts), np.concatenate(between)

    def distance(self, query: Clip, among: Joined) -> Floats:
        """The distance function of one example over joined clips."""
        costs = self._way.costs(self.by_name[query.name], among[0])
        costs[:, among[1]] = np.inf
        return match_costs(costs).distance

    def distances(self, queries: Sequence[Clip], among: Joined) -> list[Floats]:
        """Those of several examples."""
        return [self.distance(query, among) for query in queries]


def as_joined(distance: Any) -> Floats:
    """A distance function of a corpus as `Frames.join` lays it out: the last clip ends alike."""
    return np.append(np.asarray(distance, dtype=np.float64), [np.inf, np.inf])


def score_distance(
    distance: Floats, clips: Sequence[Clip], relevant: NDArray[np.bool_]
) -> dict[str, Any]:
    """One hit a clip; separation: median of the distance by that of the right first ten."""
    costs = smallest(distance, clips)
    order = np.lexsort((relevant, costs))
    right = relevant[order] & np.isfinite(costs[order])
    top = costs[order][:MOST][right[:MOST]]
    middle = float(np.median(distance[np.isfinite(distance)]))
    separation: float | str | None = None
    if len(top):
        found = float(np.median(top))
        separation = middle / found if found > 0 else INFINITE
    return {
        "average_precision": compute_average_precision(costs, relevant),
        "first": [int(right[:rank].sum()) for rank in RANKS],
        "separation": separation,
    }


def smallest(distance: Floats, clips: Sequence[Clip]) -> Floats:
    lengths = np.array([len(clip.packed) + 2 for clip in clips])
    ends = np.cumsum(lengths)
    return np.array([distance[end - n : end].min() for end, n in zip(ends, lengths, strict=True)])
