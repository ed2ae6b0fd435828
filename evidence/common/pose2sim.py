"""Pose2Sim's demonstration, and Pose2Sim itself where a Python that has it is named.

`POSE2SIM_PYTHON` names the Python of an environment of its own with Pose2Sim 0.5.7 and what its
triangulation imports. Without it, what it computes is left out.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

VARIABLE = "POSE2SIM_PYTHON"
_SESSION = "Pose2Sim/Demo/S00_Demo_Session/"
_TRIAL = Path("S00_P00_Participant", "S00_P00_T01_BalancingTrial")
# Its filtering opens a window and is left out.
_RUN = "from Pose2Sim import Pose2Sim; Pose2Sim.personAssociation(); Pose2Sim.triangulation()"


class Demonstration(NamedTuple):
    """Folders of the demonstration: session, trial, keypoints; and the calibration."""

    session: Path
    trial: Path
    pose: Path
    calibration: Path


@contextmanager
def demonstration() -> Iterator[Demonstration]:
    """The demonstration's files, from the wheel of version 0.5.7 (BSD-3)."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "pip", "download", "-q", "--no-deps", "-d", folder]
        subprocess.run([*command, "pose2sim==0.5.7"], check=True)
        with zipfile.ZipFile(next(Path(folder).glob("*.whl"))) as wheel:
            part = f"{_SESSION}{_TRIAL.as_posix()}/"
            own = [
                name
                for name in wheel.namelist()
                if name.startswith(part)
                or name.endswith("Calib_qualisys.toml")
                or (name.startswith(_SESSION) and name.endswith("Config.toml"))
            ]
            wheel.extractall(folder, [name for name in own if "T00_Static" not in name])
        session = Path(folder, _SESSION)
        trial = session / _TRIAL
        calibration = session / "S00_Calibration" / "Calib_qualisys.toml"
        yield Demonstration(session, trial, trial / "pose", calibration)


def has_pose2sim() -> bool:
    """Whether a Python of Pose2Sim is named."""
    return bool(os.environ.get(VARIABLE))


def run_pose2sim(demo: Demonstration, keypoints: Path, names: tuple[str, ...]) -> Floats:
    """Pose2Sim's own points (frames, points, 3) of a folder of keypoints, metres.

    In the axes of the calibration; NaN for points that it does not have.
    """
    python = os.environ[VARIABLE]
    if keypoints != demo.pose:
        shutil.rmtree(demo.pose)
        shutil.copytree(keypoints, demo.pose)
    for made in ("pose-associated", "pose-3d"):
        shutil.rmtree(demo.trial / made, ignore_errors=True)
    environment = {**os.environ, "QT_QPA_PLATFORM": "offscreen"}
    environment.pop("PYTHONPATH", None)
    subprocess.run(
        [python, "-c", _RUN], cwd=demo.trial, env=environment, check=True, capture_output=True
    )
    return _read_trc(next((demo.trial / "pose-3d").glob("*.trc")), names)


def _read_trc(path: Path, wanted: tuple[str, ...]) -> Floats:
    lines = path.read_text("utf-8").splitlines()
    markers = lines[3].split("\t")[2::3]
    rows = np.array([[float(cell) for cell in line.split("\t")[2:]] for line in lines[5:] if line])
    at = rows[:, : 3 * len(markers)].reshape(len(rows), -1, 3)
    points = np.full((len(rows), len(wanted), 3), np.nan)
    for k, name in enumerate(wanted):
        if name in markers:
            # It writes y, z, x.
            points[:, k] = at[:, markers.index(name)][:, [2, 0, 1]]
    return points
