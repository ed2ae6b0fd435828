"""Orientations of a sensor from what it measures, by VQF (Laidig and Seel 2023).

Offline and without the magnetometer unless asked: near the floor of a laboratory the field is
disturbed by more than any filter forgives. Heading is then free, and drifts a little.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.inertial.synchronising import speeds_of_turn
from motionary.io.sensors import SensorRecording

Floats = NDArray[np.float64]

# Radians a second that no limb of a person stays below.
_STILL = 0.05
# A field that varies by more of its size between its 5 and 95 % is not the earth's.
_STEADY = 0.25


def orient_all(
    sensors: Sequence[SensorRecording], *, fused: bool = False, magnetic: bool = False
) -> tuple[dict[str, Floats], list[str]]:
    """Orientations of each sensor by name, and notes on those that have none or doubtful ones.

    Parameters
    ----------
    sensors : of one system
    fused : take orientations that the files bring instead of fusing raw measurements
    magnetic : let magnetometers tell headings
    """
    found: dict[str, Floats] = {}
    notes = []
    for sensor in sensors:
        if sensor.name in found:
            notes.append(f"{sensor.name} is there twice; the second one is left out")
            continue
        raw = sensor.gyr is not None and sensor.acc is not None
        try:
            if sensor.orientations is not None and (fused or not raw):
                turns = sensor.orientations
            else:
                turns = orient(sensor, magnetic=magnetic)
                notes += _note_field(sensor) if magnetic else []
        except InvalidInput as error:
            notes.append(str(error))
            continue
        if np.nanmax(speeds_of_turn(turns, sensor.rate_hz), initial=0.0) < _STILL:
            notes.append(f"{sensor.name} does not move and is left out")
        else:
            found[sensor.name] = turns
    return found, notes


def _note_field(sensor: SensorRecording) -> list[str]:
    """A note where the magnetic field about a sensor is disturbed."""
    assert sensor.mag is not None
    sizes = np.linalg.norm(sensor.mag, axis=1)
    low, middle, high = np.nanpercentile(sizes, [5, 50, 95])
    if high - low <= _STEADY * middle:
        return []
    return [
        f"the field about {sensor.name} varies by {(high - low) / middle:.0%} of its size: a "
        "magnetometer cannot tell headings there"
    ]


def orient(sensor: SensorRecording, *, magnetic: bool = False, online: bool = False) -> Floats:
    """Orientations (frames, 4) wxyz from sensor to world, z up; NaN where nothing was measured.

    Parameters
    ----------
    sensor : with rates of turn and accelerations
    magnetic : whether its field tells the heading
    online : as a filter that knows no future gives them; settles within seconds

    Raises
    ------
    InvalidInput
        If a measurement is missing, or the package is not installed.
    """
    if sensor.gyr is None or sensor.acc is None or (magnetic and sensor.mag is None):
        raise InvalidInput(
            f"{sensor.name}: orientations need rates of turn and accelerations"
            + (" and the field" if magnetic else "")
        )
    try:
        import vqf
    except ImportError as error:
        raise InvalidInput(
            "orientations from raw measurements need vqf: pip install 'motionary[imu]'"
        ) from error
    known = np.asarray(~np.isnan(np.concatenate([sensor.gyr, sensor.acc], axis=1)).any(axis=1))
    if not known.any():
        raise InvalidInput(f"{sensor.name}: measured nothing")
    gyr, acc = _bridge(sensor.gyr, known), _bridge(sensor.acc, known)
    mag = _bridge(sensor.mag, known) if magnetic and sensor.mag is not None else None
    step = 1.0 / sensor.rate_hz
    key = "quat9D" if magnetic else "quat6D"
    if online:
        result: Any = vqf.VQF(step).updateBatch(gyr, acc, mag)[key]
    else:
        result = vqf.offlineVQF(gyr, acc, mag, step)[key]
    turned = np.array(result, dtype=np.float64)
    turned[~known] = np.nan
    return turned


def _bridge(values: Floats, known: NDArray[np.bool_]) -> Floats:
    """Values with straight lines over gaps, contiguous."""
    at = np.arange(len(values))
    columns = [np.interp(at, at[known], column[known]) for column in np.nan_to_num(values).T]
    return np.ascontiguousarray(np.stack(columns, axis=1))
