"""Poses of a chain whose points are nearest to all rays, over all frames at once.

After Baak (2012), eqs. (6.3) and (6.4): a point on a ray, x × n = m, linearised in the twists of
the chain. Rays far from the chain count little (Geman and McClure). Beyond the printed method,
frames are joined: accelerations of points cost, as much as the noise of the rays makes them
welcome, so that noise is smoothed and gaps are bridged. Gauss-Newton steps on banded systems.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.multiview.cameras import Sight, distances
from motionary.multiview.chain import Chain, ChainPose, linearise, move, points_of

Floats = NDArray[np.float64]

_MOST_ANGLE = 0.5
# What a turn of one radian, or a step of one metre, away from the last pose costs, in m².
_DAMPING = 2e-4
_FRAMES_AT_ONCE, _OVERLAP = 400, 40


@dataclass(frozen=True, slots=True)
class SolverSettings:
    """What is expected of rays and of motions.

    Attributes
    ----------
    noise_m : standard deviation of a ray at the person
    acceleration : of points in m/s², standard deviation
    deviation_m : of points from where a chain of constant lengths has them
    """

    noise_m: float = 0.02
    acceleration: float = 20.0
    deviation_m: float = 0.02

    def stiffness(self, rate_hz: float) -> float:
        """What squared second differences of points cost, by squared distances from rays."""
        return (self.noise_m / self.acceleration) ** 2 * rate_hz**4


class Pull(NamedTuple):
    """Where priors want points: weights (frames, points, 3, 3) and places (frames, points, 3)."""

    matrices: Floats
    places: Floats


def ray_weights(sight: Sight, points: Floats, scale_m: float) -> Floats:
    """Weights of rays by their distance from points: (cameras, frames, points)."""
    far, depth = distances(sight, np.nan_to_num(points))
    weights: Floats = sight.weights * (scale_m**2 / (scale_m**2 + far**2)) ** 2
    return np.where((depth > 0) & ~np.isnan(points[..., 0]), weights, 0.0)


def _system(
    sight: Sight, points: Floats, scale_m: float, pull: Pull | None
) -> tuple[Floats, Floats]:
    """M and b of the sum of squared distances x·M x − 2 b·x from rays and from what pulls."""
    n, weights = sight.directions, ray_weights(sight, points, scale_m)
    whole = weights.sum(axis=0)
    matrices = whole[..., None, None] * np.eye(3) - np.einsum(
        "cfp,cfpi,cfpj->fpij", weights, n, n, optimize=True
    )
    along = np.einsum("cfpi,ci->cfp", n, sight.origins)
    slopes = np.einsum("cfp,ci->fpi", weights, sight.origins) - np.einsum(
        "cfp,cfpi->fpi", weights * along, n
    )
    if pull is not None:
        matrices = matrices + pull.matrices
        slopes = slopes + (pull.matrices @ pull.places[..., None])[..., 0]
    return matrices, slopes


def solve_chain(
    chain: Chain,
    pose: ChainPose,
    sight: Sight,
    *,
    scales_m: tuple[float, ...],
    rate_hz: float,
    settings: SolverSettings,
    pull: Pull | None = None,
) -> ChainPose:
    """The pose after a step for each of `scales_m`, beyond which rays count little, coarse to fine.

    `sight` has rays of the chain's points, in their sequence.
    """
    for scale in scales_m:
        steps = np.zeros((len(pose.turns), 3 + 3 * len(chain.joints)))
        for first, stop, kept in _windows(len(steps)):
            part = slice(first, stop)
            own = ChainPose(pose.turns[part], pose.centres[part])
            wanted = None if pull is None else Pull(pull.matrices[part], pull.places[part])
            found = _step(chain, own, sight.of_frames(part), scale, rate_hz, settings, wanted)
            steps[kept] = found[kept.start - first : kept.stop - first]
        size = np.abs(steps[:, 3:]).max(axis=1, initial=_MOST_ANGLE)
        steps *= (_MOST_ANGLE / size)[:, None]
        pose = move(chain, pose, steps)
    return pose


def _windows(n_frames: int) -> list[tuple[int, int, slice]]:
    """Overlapping parts of a recording, and which frames of each are kept."""
    if n_frames <= _FRAMES_AT_ONCE + _OVERLAP:
        return [(0, n_frames, slice(0, n_frames))]
    parts = []
    for start in range(0, n_frames, _FRAMES_AT_ONCE):
        stop = min(start + _FRAMES_AT_ONCE, n_frames)
        first, last = max(0, start - _OVERLAP), min(n_frames, stop + _OVERLAP)
        parts.append((first, last, slice(start, stop)))
    return parts


def _step(
    chain: Chain,
    pose: ChainPose,
    sight: Sight,
    scale_m: float,
    rate_hz: float,
    settings: SolverSettings,
    pull: Pull | None,
) -> Floats:
    """The Gauss-Newton step, (frames, unknowns)."""
    points = points_of(chain, pose)
    n_frames, n_points = points.shape[:2]
    matrices, slopes = _system(sight, points, scale_m, pull)
    rows = linearise(chain, pose, points)
    n = rows.shape[-1]
    gradient = (matrices @ points[..., None])[..., 0] - slopes
    flat = rows.reshape(n_frames, 3 * n_points, n)
    weighted = (matrices @ rows).reshape(flat.shape)
    stiff = settings.stiffness(rate_hz)
    second = stiff * _second_differences(points.reshape(n_frames, -1))
    slope = np.einsum("fk,fkn->fn", gradient.reshape(n_frames, -1) + second, flat)
    return _solve_banded(flat, weighted, slope, stiff, n)


def _second_differences(values: Floats) -> Floats:
    """D2ᵀ D2 of values along frames: slope of the sum of squared second differences."""
    result = np.zeros_like(values)
    if len(values) > 2:
        second = values[:-2] - 2 * values[1:-1] + values[2:]
        result[:-2] += second
        result[1:-1] -= 2 * second
        result[2:] += second
    return result


def _couplings(n_frames: int) -> tuple[Floats, Floats, Floats]:
    """Diagonals of D2ᵀ D2: of each frame with itself, the next, and the one after."""
    own, one, two = np.zeros(n_frames), np.zeros(n_frames), np.zeros(n_frames)
    for k in range(n_frames - 2):
        own[k : k + 3] += (1, 4, 1)
        one[k : k + 2] -= (2, 2)
        two[k] += 1
    return own, one, two


def _solve_banded(rows: Floats, weighted: Floats, slope: Floats, stiff: float, n: int) -> Floats:
    """Solve (Jᵀ M J + stiff Jᵀ D2ᵀ D2 J + damping) step = −slope, block by block in a band."""
    from scipy.linalg import solveh_banded

    n_frames = len(rows)
    across = np.swapaxes(rows, 1, 2)
    own, one, two = _couplings(n_frames)
    diagonal = across @ weighted + (stiff * own)[:, None, None] * (across @ rows)
    diagonal[:, np.arange(n), np.arange(n)] += _DAMPING
    blocks = [diagonal]
    for ahead, coupling in ((1, one), (2, two)):
        if n_frames > ahead:
            product = across[:-ahead] @ rows[ahead:]
            blocks.append((stiff * coupling[: n_frames - ahead])[:, None, None] * product)
    # Lower form: what stands in row r and column c of the matrix is at band[r - c, c].
    band = np.zeros((3 * n, n_frames, n))
    row, column = (grid.ravel() for grid in np.indices((n, n)))
    for ahead, block in enumerate(blocks):
        offset = ahead * n + row - column
        own_half = offset >= 0
        band[offset[own_half], : len(block), column[own_half]] = block[
            :, column[own_half], row[own_half]
        ].T
    step: Floats = -solveh_banded(
        band.reshape(3 * n, -1), slope.ravel(), lower=True, overwrite_ab=True, check_finite=False
    )
    return step.reshape(n_frames, n)


def free_points(
    sight: Sight,
    points: Floats,
    *,
    rate_hz: float,
    settings: SolverSettings,
    scale_m: float,
    pull: Pull | None = None,
) -> Floats:
    """Points that may deviate from the chain, as far as rays that agree with it tell.

    A chain of constant lengths is a little wrong everywhere. Where no ray tells, a point stays
    where the chain has it.
    """
    from scipy.linalg import solveh_banded

    result = points.copy()
    n_frames = len(points)
    matrices, slopes = _system(sight, points, scale_m, pull)
    held = (settings.noise_m / settings.deviation_m) ** 2
    stiff = settings.stiffness(rate_hz)
    own, one, two = _couplings(n_frames)
    for k in range(points.shape[1]):
        band = np.zeros((7, n_frames, 3))
        for row in range(3):
            for column in range(row + 1):
                band[row - column, :, column] += matrices[:, k, row, column]
        band[0] += held + stiff * own[:, None]
        band[3] += stiff * one[:, None]
        band[6] += stiff * two[:, None]
        slope = slopes[:, k] + held * points[:, k]
        result[:, k] = solveh_banded(
            band.reshape(7, -1), slope.ravel(), lower=True, check_finite=False
        ).reshape(n_frames, 3)
    return result
