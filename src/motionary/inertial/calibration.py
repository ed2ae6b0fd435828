"""How a sensor sits on its limb and how its world lies to the tracker's, from any motion.

A sensor on a limb reads q_I = q_G q_T q_L (7.5): q_T the limb as tracked, q_L how the sensor is
mounted on it, q_G the sensor's world seen from the tracker's. The printed solver (Park; 7.7 to
7.15) takes all frames for true and is spoilt by few wrong ones; ours alternates between two closed
means with weights that wrong frames lose.
"""

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.inertial.orientations import direction_distance_deg, distance_deg, heading
from motionary.rotations import (
    conjugate_quaternions,
    matrices_to_quaternions,
    multiply_quaternions,
    quaternions_to_matrices,
    quaternions_to_rotation_vectors,
    rotate,
    rotation_vectors_to_quaternions,
    unit_vectors,
)

Floats = NDArray[np.float64]
World = Literal["heading", "any"]


@dataclass(frozen=True, slots=True)
class CalibrationSettings:
    """How a calibration is found, and when it is doubted or refused.

    Attributes
    ----------
    world : "heading" if both worlds have z up, so that only a turn about it is between them
    scale_deg : residuals much beyond it count little (Geman and McClure)
    most_frames : that are looked at while searching
    doubted_deg, refused_deg : standard deviation from which on
    """

    world: World = "heading"
    scale_deg: float = 6.0
    most_frames: int = 300
    doubted_deg: float = 5.0
    refused_deg: float = 15.0


class Calibration(NamedTuple):
    """A calibration and how sure it is.

    Attributes
    ----------
    world, mount : q_G and q_L, unit quaternions wxyz
    residual_deg : array, shape (frames,), of all frames; NaN where one is not known
    deviation_deg : standard deviation that is to be expected of the worse of the two
    notes : what makes it doubtful, one sentence each
    """

    world: Floats
    mount: Floats
    residual_deg: Floats
    deviation_deg: float
    notes: tuple[str, ...] = ()

    def predict(self, tracked: Floats) -> Floats:
        """What the sensor should read where the limb is tracked, (frames, 4)."""
        return multiply_quaternions(multiply_quaternions(self.world, tracked), self.mount)


def calibrate(
    tracked: Floats, measured: Floats, settings: CalibrationSettings | None = None
) -> Calibration:
    """World and mount of a sensor, whatever share of the frames, up to half, is tracked wrongly.

    Parameters
    ----------
    tracked, measured : array, shape (frames, 4), orientations of limb and sensor at the same
        times, both in a world with z up; NaN = not known
    settings : see there

    Raises
    ------
    InvalidInput
        If too little moves to tell: too few frames, no motion, or turns about one axis.
    """
    settings = settings or CalibrationSettings()
    tracked, measured, seen = _check_pairs(tracked, measured)
    axes = _HEADINGS if settings.world == "heading" else np.eye(4)
    chosen = _choose(measured, seen, settings.most_frames)
    products = _products(tracked[chosen], measured[chosen], axes)
    worlds, _, costs = _descend(products, _starts(products), _COARSE, settings.scale_deg)
    # The best few, as the coarse steps cannot tell near ones apart.
    worlds, mounts, costs = _descend(
        products, worlds[np.argsort(costs, kind="stable")[:4]], _SCALES, settings.scale_deg
    )
    shares, mount = worlds[costs.argmin()], mounts[costs.argmin()]
    # More frames than the search needs make the answer sharper.
    chosen = _choose(measured, seen, _MOST_REFINED)
    world, mount, deviation = _refine(
        tracked[chosen], measured[chosen], shares @ axes, mount, settings
    )
    found = Calibration(world, mount, np.zeros(0), deviation)
    residual = distance_deg(measured, found.predict(tracked))
    if not deviation <= settings.refused_deg:
        raise InvalidInput(
            "the motion does not determine how the sensor sits: expected error "
            f"{min(deviation, 180):.0f} degrees; it needs turns about two axes, such as a squat, a "
            "step and a turn round"
        )
    notes: tuple[str, ...] = ()
    if deviation > settings.doubted_deg:
        notes = (
            f"turns about one axis only: expected error of the calibration {deviation:.0f} degrees",
        )
    return found._replace(residual_deg=residual, notes=notes)


def _check_pairs(tracked: Floats, measured: Floats) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Both as unit quaternions, and where both are known.

    Raises
    ------
    InvalidInput
        If they do not fit, are no unit quaternions, or are known together in too few frames.
    """
    tracked, measured = (np.asarray(one, dtype=np.float64) for one in (tracked, measured))
    if tracked.shape != measured.shape or tracked.ndim != 2 or tracked.shape[1] != 4:
        raise InvalidInput(
            "a calibration needs as many orientations (frames, 4) of limb and sensor, got "
            f"{tracked.shape} and {measured.shape}"
        )
    seen = np.asarray(~np.isnan(tracked).any(axis=1) & ~np.isnan(measured).any(axis=1))
    for name, one in (("limb", tracked), ("sensor", measured)):
        lengths = np.linalg.norm(one[seen], axis=1)
        if np.any(np.abs(lengths - 1) > 0.01):
            worst = lengths[np.abs(lengths - 1).argmax()]
            raise InvalidInput(
                f"orientations of the {name} need to be unit quaternions wxyz, got one of length "
                f"{worst:.3g}"
            )
    if seen.sum() < 20:
        raise InvalidInput(
            f"a calibration needs at least 20 frames in which limb and sensor are known, got "
            f"{int(seen.sum())}"
        )
    return tracked, measured, seen


def match_limb(tracked: Floats, measured: Floats) -> float:
    """Root mean square of what a rough fit of a sensor to a limb leaves, in degrees.

    Frames are weighed by how much the sensor turns: standing still fits everywhere.
    """
    tracked, measured, seen = _check_pairs(tracked, measured)
    chosen = _choose(measured, seen, _MOST_ROUGH)
    products = _products(tracked[chosen], measured[chosen], _HEADINGS)
    scale = CalibrationSettings().scale_deg
    worlds, mounts, costs = _descend(products, _starts(products), _COARSE, scale)
    best = costs.argmin()
    cosines = np.abs((products @ mounts[best]) @ worlds[best])
    away = np.degrees(2 * np.arccos(np.minimum(cosines, 1.0)))
    # Half the frames may be tracked wrongly: the better half tells where the sensor sits.
    return float(np.sqrt(np.mean(np.sort(away)[: max(len(away) // 2, 1)] ** 2)))


def _choose(measured: Floats, seen: NDArray[np.bool_], most: int) -> NDArray[np.intp]:
    """Known frames at equal steps of how far the sensor has turned, and a few where it rests."""
    known = np.flatnonzero(seen)
    if len(known) <= most:
        return known
    turned = distance_deg(measured[known[:-1]], measured[known[1:]])
    steps = np.concatenate([[0.0], np.minimum(turned, 5.0)])
    travelled = np.cumsum(steps + 0.1 * max(float(steps.mean()), 1e-9))
    at = np.linspace(travelled[0], travelled[-1], most)
    return np.asarray(known[np.unique(np.searchsorted(travelled, at).clip(0, len(known) - 1))])


def _products(tracked: Floats, measured: Floats, axes: Floats) -> Floats:
    """Of each frame how much each axis of the world and each of the mount tell of the sensor.

    Shape (frames, axes, 4): the cosine of half the distance (7.2) is linear in world and mount.
    """
    result = np.empty((len(tracked), len(axes), 4))
    for i, axis in enumerate(axes):
        turned = multiply_quaternions(axis, tracked)
        for j, other in enumerate(np.eye(4)):
            result[:, i, j] = (measured * multiply_quaternions(turned, other)).sum(axis=1)
    return result


def _starts(products: Floats) -> Floats:
    """Worlds from which the search starts, as shares of the axes, (starts, axes).

    The best product of a world and a mount over all frames, and over parts of them: what is wrong
    is wrong for a while, so some parts are right.
    """
    n = len(products)
    parts = [products, *np.array_split(products, min(_PARTS, max(n // 12, 1)))]
    starts = []
    for part in parts:
        flat = part.reshape(len(part), -1)
        top = np.linalg.eigh(flat.T @ flat)[1][:, -1].reshape(products.shape[1:])
        starts.append(np.asarray(np.linalg.svd(top)[0][:, 0]))
    if products.shape[1] == 2:
        angles = np.linspace(0, np.pi, 6, endpoint=False)
        starts += [np.array([np.cos(angle), np.sin(angle)]) for angle in angles]
    return np.stack(starts)


def _descend(
    products: Floats, worlds: Floats, scales: tuple[float, ...], scale_deg: float
) -> tuple[Floats, Floats, Floats]:
    """Worlds, mounts and costs of all starts after closed means at each scale, in degrees."""
    n, n_axes, _ = products.shape
    by_axis = np.ascontiguousarray(products.transpose(1, 0, 2)).reshape(n_axes, -1)
    by_mount = np.ascontiguousarray(products.transpose(2, 0, 1)).reshape(4, -1)
    weights = np.ones((len(worlds), n))
    for scale in scales:
        mounts = _leading((worlds @ by_axis).reshape(-1, n, 4), weights)
        seen = (mounts @ by_mount).reshape(-1, n, n_axes)
        worlds = _leading(seen, weights)
        cosines = np.minimum(np.abs(seen @ worlds[:, :, None])[..., 0], 1.0)
        squares = np.degrees(2 * np.arccos(cosines)) ** 2
        weights = (scale**2 / (squares + scale**2)) ** 2
    return worlds, mounts, np.asarray((squares / (squares + scale_deg**2)).mean(axis=1))


def _leading(seen: Floats, weights: Floats) -> Floats:
    """Of each start the unit vector with the largest weighed sum of squared products."""
    scatter = (seen * weights[:, :, None]).transpose(0, 2, 1) @ seen
    return np.asarray(np.linalg.eigh(scatter)[1][:, :, -1])


# Turns about z.
_HEADINGS = np.eye(4)[[0, 3]]
# Graduated: the scale shrinks from 90 degrees by a fifth a step.
_SCALES = tuple(90.0 * 0.8**step for step in range(13))
_COARSE = _SCALES[:10:3]
_REFINING = 8
_MOST_ROUGH, _MOST_REFINED = 80, 2000
_PARTS = 10
# Of directions, residuals much beyond it count little.
_DIRECTION_SCALE_DEG = 5.0


def _refine(
    tracked: Floats, measured: Floats, world: Floats, mount: Floats, settings: CalibrationSettings
) -> tuple[Floats, Floats, float]:
    """World and mount by Gauss-Newton steps, and the standard deviation of the worse, degrees.

    Closed means go slowly where little turns; these steps do not.
    """
    scale = np.radians(settings.scale_deg) ** 2
    for _ in range(_REFINING):
        predicted = multiply_quaternions(multiply_quaternions(world, tracked), mount)
        misses = quaternions_to_rotation_vectors(
            multiply_quaternions(conjugate_quaternions(predicted), measured)
        )
        squares = (misses**2).sum(axis=1)
        weights = (scale / (squares + scale)) ** 2
        turned = quaternions_to_matrices(conjugate_quaternions(predicted))
        if settings.world == "heading":
            turned = turned[:, :, 2:]
        rows = np.concatenate([turned, np.tile(np.eye(3), (len(turned), 1, 1))], axis=2)
        weighed = rows * weights[:, None, None]
        normal = np.einsum("nij,nik->jk", weighed, rows)
        split = turned.shape[2]
        # Where nothing turns, nothing moves the answer.
        step = np.linalg.solve(
            normal + 1e-6 * len(rows) * np.eye(len(normal)), np.einsum("nij,ni->j", weighed, misses)
        )
        about = step[:split] if split == 3 else step[0] * np.array([0.0, 0.0, 1.0])
        world = multiply_quaternions(rotation_vectors_to_quaternions(about), world)
        mount = multiply_quaternions(mount, rotation_vectors_to_quaternions(step[split:]))
    variance = float((weights * squares).sum() / (3 * weights.sum()))
    lasting = _correlation_length(misses * weights[:, None])
    values, vectors = np.linalg.eigh(normal)
    spread = max(variance, np.radians(0.01) ** 2) * lasting
    covariance = (vectors / np.maximum(values, 1e-9)) @ vectors.T * spread
    traces = np.trace(covariance[:split, :split]), np.trace(covariance[split:, split:])
    return world, mount, float(np.degrees(np.sqrt(max(traces))))


def _correlation_length(values: Floats) -> float:
    """How many frames in a row tell the same: one and twice the sum of the correlations."""
    centred = values - values.mean(axis=0)
    power = (centred**2).sum()
    if power == 0:
        return 1.0
    total = 1.0
    for lag in range(1, len(values) // 3):
        share = float((centred[lag:] * centred[:-lag]).sum() / power)
        if share <= 0.05:
            break
        total += 2 * share
    return total


def calibrate_published(
    tracked: Floats, measured: Floats, *, seed: int = 0
) -> tuple[Floats, Floats]:
    """World and mount as the thesis solves for them: Park's means over random pairs of frames.

    Conjugates that are lost in print are put back. Raises `InvalidInput` if nothing turns.
    """
    tracked, measured, seen = _check_pairs(tracked, measured)
    known = np.flatnonzero(seen)
    pairs = np.random.default_rng(seed).choice(known, (2000, 2))
    s, t = pairs[pairs[:, 0] != pairs[:, 1]].T

    def between(one: Floats, *, inside: bool) -> Floats:
        if inside:
            return multiply_quaternions(conjugate_quaternions(one[s]), one[t])
        return multiply_quaternions(one[t], conjugate_quaternions(one[s]))

    mount = conjugate_quaternions(
        _turn_between(between(measured, inside=True), between(tracked, inside=True))
    )
    world = _turn_between(between(measured, inside=False), between(tracked, inside=False))
    return world, mount


def _turn_between(measured: Floats, tracked: Floats) -> Floats:
    """X with measured X = X tracked (7.14): the rotation nearest to the scatter of the logs."""
    logs = quaternions_to_rotation_vectors(measured), quaternions_to_rotation_vectors(tracked)
    usable = (np.linalg.norm(logs[0], axis=1) < np.radians(150)) & (
        np.linalg.norm(logs[1], axis=1) < np.radians(150)
    )
    both = logs[1][usable].T @ logs[0][usable]
    if np.linalg.norm(both) < 1e-9:
        raise InvalidInput("nothing turns, so nothing tells how the sensor sits")
    left, _, right = np.linalg.svd(both)
    turn = right.T @ np.diag([1, 1, np.sign(np.linalg.det(right.T @ left.T))]) @ left.T
    return matrices_to_quaternions(turn)


class DirectionCalibration(NamedTuple):
    """Heading of a sensor's world and the limb's axis in the sensor.

    `heading_rad` turns tracked directions into the sensor's world; `axis` (3,) is a unit vector;
    `residual_deg` (frames,) the angle between both, NaN where one is not known.
    """

    heading_rad: float
    axis: Floats
    residual_deg: Floats


def calibrate_direction(directions: Floats, measured: Floats) -> DirectionCalibration:
    """The same where only the direction of a limb is tracked, as by joints without turns.

    The twist of the limb is not asked about: no guess of it is as good as the sensor.

    Parameters
    ----------
    directions : array, shape (frames, 3), unit vectors in a world with z up; NaN = not seen
    measured : array, shape (frames, 4)
    """
    seen = ~np.isnan(directions).any(axis=1) & ~np.isnan(measured).any(axis=1)
    if seen.sum() < 20:
        raise InvalidInput(f"a calibration needs at least 20 frames, got {int(seen.sum())}")
    chosen = _choose(measured, np.asarray(seen), 600)
    d, q = directions[chosen], measured[chosen]
    if np.linalg.norm(d.mean(axis=0)) > 1 - 1e-4:
        raise InvalidInput("the limb keeps its direction, so nothing tells how the sensor sits")
    starts = np.linspace(0, 2 * np.pi, 8, endpoint=False)
    tried = [_descend_direction(d, q, float(start), 6) for start in starts]
    tried.sort(key=lambda one: one[2])
    chosen = _choose(measured, np.asarray(seen), _MOST_REFINED)
    d, q = directions[chosen], measured[chosen]
    finest = [_descend_direction(d, q, angle, 24) for angle, _, _ in tried[:2]]
    angle, axis, _ = min(finest, key=lambda one: one[2])
    residual = np.full(len(directions), np.nan)
    turned = rotate(np.broadcast_to(heading(angle), measured[seen].shape), directions[seen])
    pointing = rotate(measured[seen], np.broadcast_to(axis, turned.shape))
    residual[seen] = direction_distance_deg(turned, pointing)
    return DirectionCalibration(angle, axis, residual)


def _descend_direction(
    directions: Floats, measured: Floats, angle: float, n_steps: int
) -> tuple[float, Floats, float]:
    weights, scale = np.ones(len(directions)), 90.0
    for _ in range(n_steps):
        turned = rotate(np.broadcast_to(heading(angle), measured.shape), directions)
        in_sensor = rotate(conjugate_quaternions(measured), turned)
        axis = unit_vectors((weights[:, None] * in_sensor).sum(axis=0))
        pointing = rotate(measured, np.broadcast_to(axis, directions.shape))
        sine = (weights * np.cross(directions, pointing)[:, 2]).sum()
        cosine = (weights * (directions[:, :2] * pointing[:, :2]).sum(axis=1)).sum()
        angle = float(np.arctan2(sine, cosine))
        turned = rotate(np.broadcast_to(heading(angle), measured.shape), directions)
        squares = direction_distance_deg(turned, pointing) ** 2
        weights = (scale**2 / (squares + scale**2)) ** 2
        scale = max(scale * 0.8, _DIRECTION_SCALE_DEG)
    return angle, axis, float((squares / (squares + _DIRECTION_SCALE_DEG**2)).mean())
