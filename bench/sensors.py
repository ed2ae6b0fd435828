"""A walk held against nine sensors, and one calibration beside OpenCV's.

The whole of `motionary imu check`: reading a BVH of 25 s and eleven files of sensors, fusing what
they measured, clocks, limbs, calibrations and wrong segments (NEURA's walk, where MOTIONARY_DATA
has it; else synthetic). The calibration: ours over 1200 frames, beside OpenCV's solver of Park's
equations over each eighth of them, as its time grows with their square.
"""

import os
import tempfile
from pathlib import Path

import numpy as np

import motionary as mo
from motionary.inertial import CalibrationSettings, calibrate, simulate_sensors
from motionary.io.sensors import read_sensors, write_mtw
from motionary.rotations import (
    conjugate_quaternions,
    multiply_quaternions,
    quaternions_to_matrices,
    rotation_vectors_to_quaternions,
)
from motionary.samples import synthetic_stream
from timing import compare, print_ratios

#: Promised: seconds of the whole check.
WANTED_S = 3.0
N_FRAMES, EACH = 1200, 8


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        walk, sensors, what = find_walk(Path(folder))
        print(f"whole check, {what}")
        medians = compare(
            {
                "whole check": lambda: mo.check_tracking(mo.read(walk), read_sensors(sensors)),
                "  reading": lambda: (mo.read(walk), read_sensors(sensors)),
            },
            runs=3,
        )
        reference = f"wanted ({WANTED_S:.0f} s)"
        print_ratios(medians, reference=reference, seconds=WANTED_S)
    calibrations()


def find_walk(folder: Path) -> tuple[Path, Path, str]:
    """A motion, its sensors, and what they are."""
    real = Path(os.environ.get("MOTIONARY_DATA", "")) / "sensors" / "neura"
    if "MOTIONARY_DATA" in os.environ and real.is_dir():
        return real / "S02-Trial-Walk-1.bvh", real / "imu", "nine Xsens MTw, 25 s"
    stream, _ = synthetic_stream(["squat", "walk", "kick_left", "spin_left"] * 3, seed=0)
    mo.write(stream, folder / "walk.bvh")
    (folder / "imu").mkdir()
    for sensor in simulate_sensors(stream):
        write_mtw(folder / "imu" / f"{sensor.name}.txt", sensor)
    return folder / "walk.bvh", folder / "imu", f"synthetic, {stream.duration_s:.0f} s"


def calibrations() -> None:
    rng = np.random.default_rng(0)
    knots = np.cumsum(rng.normal(size=(N_FRAMES // 15 + 2, 3)) * 0.3, axis=0)
    at = np.arange(N_FRAMES) / 15
    vectors = np.stack([np.interp(at, np.arange(len(knots)), one) for one in knots.T], axis=1)
    tracked = rotation_vectors_to_quaternions(vectors)
    mount = rotation_vectors_to_quaternions(np.array([0.3, 1.0, -0.4]))
    noise = rotation_vectors_to_quaternions(rng.normal(size=(N_FRAMES, 3)) * 0.05)
    measured = multiply_quaternions(multiply_quaternions(tracked, mount), noise)
    settings = CalibrationSettings(world="any")
    ways = {"calibrate": lambda: calibrate(tracked, measured, settings)}
    try:
        from cv2 import CALIB_HAND_EYE_PARK, calibrateHandEye
    except ImportError:
        print("calibration: an OpenCV with calibrateHandEye (below 5) is not installed")
        return
    sensor = list(quaternions_to_matrices(measured[::EACH]))
    limb = list(quaternions_to_matrices(conjugate_quaternions(tracked[::EACH])))
    nowhere = [np.zeros((3, 1))] * len(sensor)
    reference = f"OpenCV, {len(sensor)} frames"
    ways[reference] = lambda: calibrateHandEye(
        sensor, nowhere, limb, nowhere, method=CALIB_HAND_EYE_PARK
    )
    print(f"calibration of one sensor, {N_FRAMES} frames")
    print_ratios(compare(ways, runs=5), reference=reference)
