"""Inertial sensors on a moving limb, simulated.

After Baak (2012), appendix A, with its formulas corrected: a gyroscope reads the rate of turn in
its own axes, q' = q w / 2 (A.8 has it in the world's), the mean rate of a step is
log(conj(q(t - 1)) q(t)) / dt (A.11 to A.14 lack the conjugate), and an accelerometer reads
conj(q) (p'' + g) q (A.24 turns the other way).

Conventions: quaternions wxyz from sensor to world; the world of sensors has z up and x to magnetic
north; radians a second, m/s², microtesla. Synthetic, and to be called so.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.io.sensor_recordings import GRAVITY
from motionary.rotations import (
    conjugate_quaternions,
    continuous_signs,
    multiply_quaternions,
    quaternions_to_rotation_vectors,
    rotate,
    rotation_vectors_to_quaternions,
)

Floats = NDArray[np.float64]


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
    lever: Floats | None = None,
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
    lever : where on the limb it sits, seen from the joint, metres
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
    place = places + rotate(limb, np.zeros(3) if lever is None else np.asarray(lever))
    turned = limb if mount is None else multiply_quaternions(limb, np.asarray(mount))
    if settings.lowpass_hz is not None:
        place = _lowpass(place, settings.lowpass_hz, rate_hz)
        turned = _lowpass(turned, settings.lowpass_hz, rate_hz)
    turned = multiply_quaternions(turned, _soft_tissue(n, rate_hz, settings, rng))
    turned /= np.linalg.norm(turned, axis=1, keepdims=True)
    gyr = rates_of_turn(turned, rate_hz) + _errors(
        n, settings.gyr_noise * np.sqrt(rate_hz), settings.gyr_bias, rng
    )
    acc = specific_forces(turned, place, rate_hz) + _errors(
        n, settings.acc_noise * np.sqrt(rate_hz), settings.acc_bias, rng
    )
    mag = rotate(conjugate_quaternions(turned), _field(place, settings))
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
