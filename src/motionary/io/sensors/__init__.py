"""Recordings of inertial sensors: Xsens MTw and MVNX, OpenSense, APDM, Movella DOT, BROAD, CSV.

Conventions: quaternions wxyz from sensor to a world with z up, rates in radians a
second, specific force in m/s² (9.81 upwards at rest), fields as the file has them; NaN = not known.
"""

from motionary.io.sensors.reading import SENSOR_FORMATS, read_sensor_file, read_sensors
from motionary.io.sensors.recording import SensorRecording, write_mtw, write_orientations

__all__ = [
    "SENSOR_FORMATS",
    "SensorRecording",
    "read_sensor_file",
    "read_sensors",
    "write_mtw",
    "write_orientations",
]
