"""Which cameras show the left limb as the right one, decided along time.

For each limb a state says which cameras have its sides exchanged. A state costs what its rays
miss, exchanges cost something, and so do changes of state and jumps of the limb; the path of
least cost over all frames is found by dynamic programming (Viterbi).

Conventions: arrays are (cameras, frames, ...); a camera's bit in the number of a state is 1 where
it is exchanged.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.multiview.cameras import USUAL_FOCAL, Sight, solve, triangulate
from motionary.rotations import unit_vectors

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

#: Limbs whose sides are exchanged together, by their points without L and R.
LIMBS = {
    "legs": ("Hip", "Knee", "Ankle", "BigToe", "SmallToe", "Heel"),
    "arms": ("Elbow", "Wrist"),
}
# Costs were chosen on synthetic views of walks of CMU 02, 05 and 35.
#: Of a pair of rays that contradict the others at most this counts, at `_SCALE_PX` half.
_SCALE_PX = 10.0
# Two cameras contradict each other less than more do.
_COST_EXCHANGED, _COST_OF_TWO = 0.06, 0.1
# A ray that no other meets: else exchanges would pay that part rays which nearly meet.
_COST_ALONE = 0.3
_COST_CHANGE = 0.3
_COST_JUMP, _MOST_JUMP_M = 8.0, 0.3
# Hips and elbows that lie against the shoulders, left where those have right, cost so much. It
# tells a state from its opposite, which has the same rays.
_COST_AGAINST = 1.2
# Bones whose length is off by this part of it or more cost so much: rays of two cameras to points
# of both sides meet as well, but not where the limb could be.
_COST_LENGTH, _WRONG_LENGTH = 0.8, 0.35
_BONES = (("Shoulder", "Elbow"), ("Elbow", "Wrist"), ("Hip", "Knee"), ("Knee", "Ankle"))
#: States whose costs differ by less are told apart by chance: "unsure".
UNSURE = 0.25
#: Cameras beyond so many are decided one after the other.
MOST_TOGETHER = 6
_FRAMES_AT_ONCE = 500


class Exchange(NamedTuple):
    """Exchanged sides of one limb.

    `limb` one of `LIMBS`; `exchanged` (cameras, frames); `margin` (cameras, frames), by how much
    the best path with the other answer costs more; inf where a camera does not see the limb.
    """

    limb: str
    exchanged: Bools
    margin: Floats

    @property
    def unsure(self) -> Bools:
        """Where the other answer costs nearly the same."""
        return np.asarray(self.margin < UNSURE)


def find_exchanges(sight: Sight, *, near: Floats | None = None) -> tuple[Exchange, ...]:
    """Exchanged sides of legs and arms.

    Parameters
    ----------
    sight : rays of the keypoints; of two cameras or more
    near : array, shape (frames, points, 3), where the points are by a tracked pose, NaN where
        unknown; None = by the rays alone
    """
    found = []
    shoulders = _shoulders(sight, near)
    lengths = _bone_lengths(sight, near)
    for limb, parts in LIMBS.items():
        own = [part for part in parts if len(find_pairs(sight.names, (part,)))]
        if own:
            pairs = find_pairs(sight.names, own)
            # Rays by pairs and sides: (cameras, frames, pairs, sides, 3).
            rays = sight._replace(
                directions=sight.directions[:, :, pairs], weights=sight.weights[:, :, pairs]
            )
            body = _Body(tuple(own), shoulders, lengths)
            found.append(_decide(limb, rays, None if near is None else near[:, pairs], body))
    return tuple(found)


def right_sides(sight: Sight, *, near: Floats | None = None) -> tuple[Sight, tuple[Exchange, ...]]:
    """The sight with exchanged sides put right, and what was exchanged; see `find_exchanges`."""
    exchanges = find_exchanges(sight, near=near)
    return sight.exchanged(exchange_sources(sight, exchanges)), exchanges


class _Body(NamedTuple):
    """What the rest of the body tells of a limb of `parts`.

    `shoulders` (frames, 2, 3), left and right, NaN where unknown; `lengths` of bones.
    """

    parts: tuple[str, ...]
    shoulders: Floats
    lengths: dict[tuple[str, str], float]

    def cost(self, places: Floats) -> Floats:
        """Costs (states, frames) of places of the left limb (states, frames, pairs, 3)."""
        right = places[::-1]
        # The first pair of a limb lies nearest to the trunk.
        sides = unit_vectors(places[:, :, 0] - right[:, :, 0])
        across = unit_vectors(self.shoulders[:, 0] - self.shoulders[:, 1])
        total: Floats = _COST_AGAINST * np.nan_to_num(1 - (sides * across).sum(axis=-1)) / 2
        bones = [bone for bone in self.lengths if bone[1] in self.parts]
        for one, other in bones:
            for side, limb in enumerate((places, right)):
                start = self.shoulders[:, side]
                if one in self.parts:
                    start = limb[:, :, self.parts.index(one)]
                far = np.linalg.norm(limb[:, :, self.parts.index(other)] - start, axis=-1)
                off = np.abs(far / self.lengths[one, other] - 1) / _WRONG_LENGTH
                total += _COST_LENGTH / (2 * len(bones)) * np.nan_to_num(np.minimum(off, 1) ** 2)
        return total


def _bone_lengths(sight: Sight, near: Floats | None) -> dict[tuple[str, str], float]:
    """Medians of the lengths of arms and legs, of both sides."""
    points = triangulate(sight).points if near is None else near
    lengths = {}
    for one, other in _BONES:
        pairs = find_pairs(sight.names, (one, other))
        if len(pairs) == 2:
            far = np.linalg.norm(points[:, pairs[0]] - points[:, pairs[1]], axis=-1)
            if np.isfinite(far).any():
                lengths[one, other] = float(np.nanmedian(far))
    return lengths


def _shoulders(sight: Sight, near: Floats | None) -> Floats:
    """Places of the left shoulder and the right one, (frames, 2, 3); NaN where unknown."""
    pair = find_pairs(sight.names, ("Shoulder",))
    if not len(pair):
        return np.full((sight.weights.shape[1], 2, 3), np.nan)
    own = pair[0].tolist()
    if near is None or np.isnan(near[:, own]).any():
        return triangulate(sight.of_points(own)).points
    return near[:, own]


def find_pairs(names: Sequence[str], parts: Sequence[str]) -> NDArray[np.intp]:
    """Numbers of the left and the right point of parts, shape (pairs, 2)."""
    pairs = [
        (names.index(f"L{part}"), names.index(f"R{part}"))
        for part in parts
        if f"L{part}" in names and f"R{part}" in names
    ]
    return np.array(pairs, dtype=np.intp).reshape(-1, 2)


def exchange_sources(sight: Sight, found: Sequence[Exchange]) -> NDArray[np.intp]:
    """Which point takes each point's place, shape (cameras, frames, points)."""
    sources = np.broadcast_to(np.arange(len(sight.names)), sight.weights.shape).copy()
    for one in found:
        for left, right in find_pairs(sight.names, LIMBS[one.limb]):
            sources[..., left][one.exchanged] = right
            sources[..., right][one.exchanged] = left
    return sources


def _decide(limb: str, rays: Sight, near: Floats | None, body: _Body) -> Exchange:
    """The exchanges of one limb."""
    seen = rays.weights.sum(axis=(2, 3))
    n_cameras, n_frames = seen.shape
    # Those that see most are decided together, the others against them.
    order = np.argsort(-seen.sum(axis=1), kind="stable")
    together = np.sort(order[:MOST_TOGETHER])
    exchanged = np.zeros((n_cameras, n_frames), dtype=bool)
    margin = np.full((n_cameras, n_frames), np.inf)
    states = _states(len(together))
    unary, places = _cost_states(_of_cameras(rays, together), near, states)
    unary += body.cost(places)
    path, costs = _viterbi(unary, _Steps(states, places))
    exchanged[together] = states[path].T
    for k, camera in enumerate(together):
        margin[camera] = _margins(costs, states[:, k])
    frames = np.arange(n_frames)
    both = np.stack([places[path, frames], places[::-1][path, frames]], axis=2)
    bit = _states(1)
    for camera in order[MOST_TOGETHER:]:
        alone = _of_cameras(rays, [camera])
        misses = [_misses(alone, both[:, :, side]) for side in ((0, 1), (1, 0))]
        cost = np.stack(misses) + _COST_EXCHANGED * bit
        path, costs = _viterbi(cost, _Steps(bit, None))
        exchanged[camera], margin[camera] = path == 1, _margins(costs, bit[:, 0])
    # A camera that does not see the limb has nothing to exchange.
    blind = seen <= 0
    exchanged[blind], margin[blind] = False, np.inf
    return Exchange(limb, exchanged, margin)


def _states(n_cameras: int) -> Bools:
    """All states, shape (2^cameras, cameras); the last one is the opposite of the first."""
    numbers = np.arange(1 << n_cameras)
    return np.asarray((numbers[:, None] >> np.arange(n_cameras)) & 1, dtype=bool)


def _of_cameras(rays: Sight, cameras: Sequence[int] | NDArray[np.intp]) -> Sight:
    directions, origins, weights, focal = (one[cameras] for one in rays[:4])
    return Sight(directions, origins, weights, focal, rays.names)


def _cost_states(rays: Sight, near: Floats | None, states: Bools) -> tuple[Floats, Floats]:
    """Costs (states, frames), and places of the left limb (states, frames, pairs, 3).

    The right limb of a state is the left one of the opposite state.
    """
    n_frames, n_pairs = rays.directions.shape[1:3]
    costs = np.empty((len(states), n_frames))
    places = np.empty((len(states), n_frames, n_pairs, 3))
    for first in range(0, n_frames, _FRAMES_AT_ONCE):
        span = slice(first, first + _FRAMES_AT_ONCE)
        part = rays.of_frames(span)
        places[:, span] = _place(part, states)
        left, right = places[:, span], places[::-1, span]
        if near is not None:
            left = np.broadcast_to(near[None, span, :, 0], left.shape)
            right = np.broadcast_to(near[None, span, :, 1], right.shape)
        for k, state in enumerate(states):
            costs[k, span] = _misses(part, np.stack([left[k], right[k]], axis=2), state)
    each = _COST_OF_TWO if states.shape[1] == 2 else _COST_EXCHANGED
    return costs + each * states.sum(axis=1)[:, None], places


def _place(rays: Sight, states: Bools) -> Floats:
    """Where rays meet that each state takes for the left limb, (states, frames, pairs, 3)."""
    n_cameras, n_frames, n_pairs = rays.weights.shape[:3]
    n, w = rays.directions, rays.weights
    matrices = w[..., None, None] * (np.eye(3) - n[..., :, None] * n[..., None, :])
    slopes = np.einsum("cfpsij,cj->cfpsi", matrices, rays.origins)
    whole = np.concatenate([matrices.reshape(*w.shape, 9), slopes, (w > 0)[..., None]], axis=-1)
    # A state takes from each camera one of both sides: sums of these are one product.
    flat = np.moveaxis(whole, 3, 1).reshape(2 * n_cameras, -1)
    taken = np.stack([~states, states], axis=2).reshape(len(states), -1).astype(np.float64)
    sums = (taken @ flat).reshape(len(states), n_frames, n_pairs, 13)
    points = solve(sums[..., :9].reshape(*sums.shape[:-1], 3, 3), sums[..., 9:12])
    points[sums[..., 12] < 2] = np.nan
    return points


def _misses(rays: Sight, places: Floats, state: Bools | None = None) -> Floats:
    """What rays miss of both limbs (frames, pairs, sides, 3), robust, for each pair: (frames,)."""
    n, w = rays.directions, rays.weights
    if state is not None and state.any():
        n, w = n.copy(), w.copy()
        n[state], w[state] = n[state][:, :, :, ::-1], w[state][:, :, :, ::-1]
    away = places - rays.origins[:, None, None, None]
    depth = (away * n).sum(axis=-1)
    square = np.maximum((away * away).sum(axis=-1) - depth**2, 0.0)
    square *= USUAL_FOCAL**2 / np.maximum(depth, 0.1) ** 2
    cost = square / (square + _SCALE_PX**2)
    cost[np.isnan(cost)] = _COST_ALONE
    mean: Floats = (w * cost).sum(axis=(0, 2, 3)) / places.shape[1]
    return mean


class _Steps:
    """Costs of steps from the states of one frame to those of the next."""

    def __init__(self, states: Bools, places: Floats | None) -> None:
        self._change: Floats = _COST_CHANGE * (states[:, None] != states[None]).sum(axis=2)
        # A limb that is not seen is where it was, so that it cannot turn up as the other side.
        self._places = None if places is None else _hold_last(places)

    def at(self, frame: int) -> Floats:
        """Costs (states before, states after) from the frame before to a frame."""
        if self._places is None:
            return self._change
        before, after = self._places[:, frame - 1], self._places[:, frame]
        step = np.sqrt(((before[:, None] - after[None]) ** 2).sum(axis=-1))
        known = ~np.isnan(step)
        far = np.where(known, np.minimum(step, _MOST_JUMP_M), 0.0).sum(axis=2)
        # The right limb's jump is the left one's between the opposite states.
        far, count = far + far[::-1, ::-1], known.sum(axis=2)
        count = count + count[::-1, ::-1]
        jump: Floats = self._change + _COST_JUMP * far / np.maximum(count, 1)
        return jump


def _hold_last(places: Floats) -> Floats:
    """Places (states, frames, pairs, 3), where not known those of the last frame that was."""
    frames = np.arange(places.shape[1])[None, :, None]
    last = np.maximum.accumulate(np.where(np.isnan(places[..., 0]), 0, frames), axis=1)
    return np.take_along_axis(places, last[..., None], axis=1)


def _viterbi(unary: Floats, steps: _Steps) -> tuple[NDArray[np.intp], Floats]:
    """The states of the path of least cost, and of the best path through each state and frame."""
    n_states, n_frames = unary.shape
    forward, backward = unary.copy(), np.zeros_like(unary)
    cheapest = np.zeros((n_states, n_frames), dtype=np.intp)
    kept = []
    for frame in range(1, n_frames):
        step = steps.at(frame)
        kept.append(step)
        through = forward[:, frame - 1][:, None] + step
        cheapest[:, frame] = through.argmin(axis=0)
        forward[:, frame] += through.min(axis=0)
    for frame in range(n_frames - 1, 0, -1):
        onwards = (backward[:, frame] + unary[:, frame])[None] + kept[frame - 1]
        backward[:, frame - 1] = onwards.min(axis=1)
    path = np.zeros(n_frames, dtype=np.intp)
    path[-1] = forward[:, -1].argmin()
    for frame in range(n_frames - 1, 0, -1):
        path[frame - 1] = cheapest[path[frame], frame]
    return path, forward + backward


def _margins(costs: Floats, bit: Bools) -> Floats:
    """By how much the best path with the other answer of one camera costs more, (frames,)."""
    margin: Floats = np.abs(costs[bit].min(axis=0) - costs[~bit].min(axis=0))
    return margin
