"""Orientations of a sensor from what it measures, by VQF (Laidig and Seel 2023).

Offline and without the magnetometer unless asked: near the floor of a laboratory the field is
disturbed by more than any filter forgives. Heading is then free, and drifts a little.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.io.sensors import SensorRecording

Floats = NDArray[np.float64]


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
