"""Limbs of a motion as sensors see them, in a world with z up, and sensors simulated on them.

Simulated after Baak (2012), appendix A, with its formulas corrected: a gyroscope reads the rate of
turn in its own axes, q' = q w / 2 (A.8 has it in the world's), the mean rate of a step is
log(conj(q(t - 1)) q(t)) / dt (A.11 to A.14 lack the conjugate), and an accelerometer reads
conj(q) (p'' + g) q (A.24 turns the other way).

Conventions: quaternions wxyz from sensor to world; the world of sensors has z up and x to magnetic
north; radians a second, m/s², microtesla. Synthetic, and to be called so.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.body.driving import read_turns
from motionary.errors import InvalidInput
from motionary.inertial.orientations import (
    SENSORS_FROM_TRACKING,
    resample_orientations,
    speeds_of_directions,
    speeds_of_turn,
)
from motionary.io.sensor_recordings import GRAVITY
from motionary.io.sensors import SensorRecording
from motionary.motion import Motion, resample
from motionary.rotations import (
    conjugate_quaternions,
    continuous_signs,
    matrices_to_quaternions,
    multiply_quaternions,
    quaternions_to_rotation_vectors,
    rotate,
    rotation_vectors_to_quaternions,
)

Floats = NDArray[np.float64]

#: What people usually wear.
WORN = ("root", "lthigh", "lshank", "lfoot", "rthigh", "rshank", "rfoot", "lforearm", "rforearm")

# So many times faster than a limb no sensor on it turns.
_OTHER_UNIT = 8.0


class TrackedLimbs(NamedTuple):
    """A motion's limbs in a world with z up: turns (frames, 4), else directions (frames, 3)."""

    turns: dict[str, Floats]
    directions: dict[str, Floats]
    axes: dict[str, Floats]
    rate_hz: float

    @property
    def limbs(self) -> list[str]:
        """Names of the limbs."""
        return [*self.turns, *(name for name in self.directions if name not in self.turns)]

    def speeds(self, limb: str) -> Floats:
        """How fast a limb turns, rad/s, (frames,)."""
        if limb in self.turns:
            return speeds_of_turn(self.turns[limb], self.rate_hz)
        return speeds_of_directions(self.directions[limb], self.rate_hz)


def track_limbs(motion: Motion) -> TrackedLimbs:
    """Limbs of a motion in the sensors' world.

    Raises
    ------
    UnknownSkeleton, NotHuman
        If the motion's joints are not known.
    """
    turns = read_turns(motion)
    quaternions = {
        bone: multiply_quaternions(SENSORS_FROM_TRACKING, matrices_to_quaternions(matrices))
        for bone, matrices in turns.turns.items()
    }
    directions = {
        bone: rotate(np.broadcast_to(SENSORS_FROM_TRACKING, (len(one), 4)), one)
        for bone, one in turns.directions().items()
        if np.isfinite(one).all(axis=1).sum() >= 20
    }
    return TrackedLimbs(quaternions, directions, turns.rest, motion.rate_hz)


def compare_speeds(
    tracked: TrackedLimbs, seen: Mapping[str, Floats], placed: Mapping[str, str]
) -> list[str]:
    """Notes on sensors that turn many times as fast or as slowly as their limbs."""
    notes = []
    for name, limb in sorted(placed.items()):
        own, of_limb = (
            np.nanpercentile(one, 90) if np.isfinite(one).any() else np.nan
            for one in (speeds_of_turn(seen[name], tracked.rate_hz), tracked.speeds(limb))
        )
        if own > _OTHER_UNIT * of_limb or of_limb > _OTHER_UNIT * own:
            notes.append(
                f"{name} turns {own / of_limb:.2g} times as fast as {limb}: rates of turn need "
                "radians a second, or a unit in a map of columns"
            )
    return notes


# ---- simulated sensors


@dataclass(frozen=True, slots=True)
class SensorSettings:
    """What a simulated sensor measures wrongly, and the field it is in.

    Attributes
    ----------
    lowpass_hz : of place and orientation before rates are taken, zero phase; None for none
    soft_tissue_deg : root mean square of the turn of the sensor on its limb, about 4 Hz
    gyr_noise, acc_noise, mag_noise : per axis and root hertz (rad/s, m/s²), per sample (uT)
    gyr_bias, acc_bias : per axis, drawn once from a normal distribution of this spread
    field_ut, inclination_deg : of the magnetic field
    floor_ut : disturbance by the floor, which falls by e in a quarter of a metre
    """

    lowpass_hz: float | None = 15.0
    soft_tissue_deg: float = 2.0
    gyr_noise: float = np.radians(0.01)
    acc_noise: float = 0.0015
    mag_noise: float = 0.3
    gyr_bias: float = np.radians(0.3)
    acc_bias: float = 0.03
    field_ut: float = 48.0
    inclination_deg: float = 65.5
    floor_ut: float = 15.0


#: A sensor without any fault: what it reads is what moves it.
IDEAL = SensorSettings(None, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, floor_ut=0.0)


class SimulatedSensor(NamedTuple):
    """What a simulated sensor reads, shape (frames, 3) each, and its true orientations."""

    gyr: Floats
    acc: Floats
    mag: Floats
    orientations: Floats


def simulate_sensor(
    orientations: Floats,
    places: Floats,
    *,
    rate_hz: float,
    mount: Floats | None = None,
    settings: SensorSettings | None = None,
    seed: int = 0,
) -> SimulatedSensor:
    """What a sensor on a limb reads.

    Parameters
    ----------
    orientations : array, shape (frames, 4), of the limb, wxyz, in a world with z up
    places : array, shape (frames, 3), metres, of the limb's joint in that world
    rate_hz : frames per second
    mount : how the sensor is turned on the limb, (4,); not at all if None
    settings : its faults; those of a usual sensor if None
    seed : of all that is drawn
    """
    settings = settings or SensorSettings()
    n = len(orientations)
    if n < 8 or orientations.shape != (n, 4) or places.shape != (n, 3):
        raise InvalidInput(
            "a sensor needs at least 8 orientations (frames, 4) with as many places (frames, 3), "
            f"got {orientations.shape} and {places.shape}"
        )
    rng = np.random.default_rng(seed)
    limb = continuous_signs(orientations)
    turned = limb if mount is None else multiply_quaternions(limb, np.asarray(mount))
    if settings.lowpass_hz is not None:
        places = _lowpass(places, settings.lowpass_hz, rate_hz)
        turned = _lowpass(turned, settings.lowpass_hz, rate_hz)
    turned = multiply_quaternions(turned, _soft_tissue(n, rate_hz, settings, rng))
    turned /= np.linalg.norm(turned, axis=1, keepdims=True)
    gyr = rates_of_turn(turned, rate_hz) + _errors(
        n, settings.gyr_noise * np.sqrt(rate_hz), settings.gyr_bias, rng
    )
    acc = specific_forces(turned, places, rate_hz) + _errors(
        n, settings.acc_noise * np.sqrt(rate_hz), settings.acc_bias, rng
    )
    mag = rotate(conjugate_quaternions(turned), _field(places, settings))
    mag += _errors(n, settings.mag_noise, 0.0, rng)
    return SimulatedSensor(gyr, acc, mag, turned)


def rates_of_turn(orientations: Floats, rate_hz: float) -> Floats:
    """Mean rates over the step that leads to each frame, in the sensor's axes, (frames, 3).

    The first frame has the rate of the second; integrated they give the orientations back.
    """
    before = conjugate_quaternions(orientations[:-1])
    steps = quaternions_to_rotation_vectors(multiply_quaternions(before, orientations[1:]))
    result: Floats = np.concatenate([steps[:1], steps]) * rate_hz
    return result


def integrate_rates(start: Floats, rates: Floats, rate_hz: float) -> Floats:
    """Orientations (frames, 4) from the first one and rates in the sensor's axes."""
    steps = rotation_vectors_to_quaternions(rates / rate_hz)
    result = np.empty((len(rates), 4))
    result[0] = start
    for frame in range(1, len(rates)):
        result[frame] = multiply_quaternions(result[frame - 1], steps[frame])
    return result


def specific_forces(orientations: Floats, places: Floats, rate_hz: float) -> Floats:
    """What an accelerometer reads: the second derivative of a spline and gravity, (frames, 3)."""
    from scipy.interpolate import CubicSpline

    spline = CubicSpline(np.arange(len(places)) / rate_hz, places)
    in_world = spline(np.arange(len(places)) / rate_hz, 2)
    in_world[:, 2] += GRAVITY
    return rotate(conjugate_quaternions(orientations), in_world)


def magnetic_field(settings: SensorSettings, *, declination_deg: float = 0.0) -> Floats:
    """The field in the world (A.6, A.7), microtesla; x points to magnetic north.

    With a declination x points to true north, and magnetic north lies east of it.
    """
    dip, aside = np.radians([settings.inclination_deg, declination_deg])
    north = np.array([np.cos(aside) * np.cos(dip), -np.sin(aside) * np.cos(dip), -np.sin(dip)])
    return np.asarray(settings.field_ut * north)


def _field(places: Floats, settings: SensorSettings) -> Floats:
    """The field at each place: the earth's, and near the floor one that turns with the place."""
    near = settings.floor_ut * np.exp(-np.maximum(places[:, 2], 0) / 0.25)
    angle = 2 * np.pi * (places[:, 0] + 0.7 * places[:, 1])
    floor = near[:, None] * np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    result: Floats = magnetic_field(settings) + floor
    return result


def _soft_tissue(
    n: int, rate_hz: float, settings: SensorSettings, rng: np.random.Generator
) -> Floats:
    """Small turns of the sensor on its limb: noise below 4 Hz, shape (n, 4)."""
    noise = rng.normal(size=(n, 3))
    if settings.soft_tissue_deg == 0:
        return rotation_vectors_to_quaternions(0 * noise)
    smooth = _lowpass(noise, 4.0, rate_hz)
    size = np.sqrt((smooth**2).sum(axis=1).mean())
    return rotation_vectors_to_quaternions(smooth / size * np.radians(settings.soft_tissue_deg))


def _lowpass(values: Floats, cut_hz: float, rate_hz: float) -> Floats:
    """Values without what is faster, at zero phase; as they are where nothing is faster."""
    if cut_hz >= 0.45 * rate_hz:
        return values.copy()
    from scipy.signal import butter, sosfiltfilt

    sections = butter(2, cut_hz, fs=rate_hz, output="sos")
    most = 3 * (2 * len(sections) + 1)
    result: Floats = sosfiltfilt(sections, values, axis=0, padlen=min(len(values) - 1, most))
    return result


def _errors(n: int, noise: float, bias: float, rng: np.random.Generator) -> Floats:
    return rng.normal(size=(n, 3)) * noise + rng.normal(size=3) * bias


def simulate_sensors(
    motion: Motion,
    limbs: Sequence[str] | None = None,
    *,
    rate_hz: float = 100.0,
    settings: SensorSettings | None = None,
    seed: int = 0,
) -> list[SensorRecording]:
    """What sensors on limbs of a motion would have measured; synthetic.

    Accelerations are those of the root, turned into each limb: near enough for orientations.

    Parameters
    ----------
    motion : with rotations
    limbs : that wear one; of `WORN` those that the motion has if None
    rate_hz, settings, seed : of the sensors

    Raises
    ------
    InvalidInput
        If the turns of a limb are not known.
    """
    tracked = track_limbs(motion)
    chosen = [limb for limb in WORN if limb in tracked.turns] if limbs is None else limbs
    there = ", ".join(tracked.turns) or "none: the motion holds positions without rotations"
    for limb in chosen:
        if limb not in tracked.turns:
            raise InvalidInput(f"the turns of {limb!r} are not known; known are {there}")
    if not chosen:
        raise InvalidInput(f"no limb can wear a sensor; turns are known of {there}")
    n_frames = int((motion.n_frames - 1) / motion.rate_hz * rate_hz) + 1
    at = np.arange(n_frames) / rate_hz * motion.rate_hz
    root = resample(motion.generic_positions()[:, 0], rate_hz=motion.rate_hz, to_hz=rate_hz)
    places = rotate(np.broadcast_to(SENSORS_FROM_TRACKING, (n_frames, 4)), root[:n_frames])
    made = []
    for number, limb in enumerate(chosen):
        read = simulate_sensor(
            resample_orientations(tracked.turns[limb], np.asarray(at)),
            np.nan_to_num(places),
            rate_hz=rate_hz,
            settings=settings,
            seed=seed + number,
        )
        made.append(SensorRecording(limb, rate_hz, read.gyr, read.acc, read.mag))
    return made
