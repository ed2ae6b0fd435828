"""`motionary synth`: what cameras and sensors would have recorded of a motion."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from motionary.cli import screen
from motionary.cli.options import Force, check_target, wrong
from motionary.cli.recordings import read_recording
from motionary.errors import UnwritableFile
from motionary.io.options import ReadOptions

if TYPE_CHECKING:
    from motionary.body import Camera

Recording = Annotated[
    str, typer.Argument(metavar="RECORDING", help="The motion to be recorded again.")
]
Folder = Annotated[
    str, typer.Option("--output", "-o", metavar="FOLDER", help="The folder to write into.")
]
Seed = Annotated[
    int, typer.Option(min=0, metavar="N", help="Of everything that is drawn at random.")
]

_NOISES = ("none", "kinect", "tof")
_SENSOR_HZ = 100.0
_PREFIX, _CAMERA = "synthetic-", "camera.json"


def synth() -> None:
    """Make synthetic recordings of a motion: depth images, inertial sensors.

    What is written is synthetic and says so. The same seed gives the same files.

    motionary synth imu take.bvh -o sensors
    motionary synth depth take.bvh -o images --noise kinect
    """


def imu(
    recording: Recording,
    output: Folder,
    limbs: Annotated[
        list[str] | None,
        typer.Option("--limb", metavar="LIMB", help="Limbs that wear one; else all nine usual."),
    ] = None,
    seed: Seed = 0,
    force: Force = False,
    *,
    reading: ReadOptions,
) -> int:
    """Write what inertial sensors on the limbs would have measured, as Xsens' text files.

    motionary synth imu take.bvh -o sensors --limb lthigh --limb lshank
    """
    import numpy as np

    from motionary.body.sensors import simulate_sensor
    from motionary.inertial import track_limbs
    from motionary.inertial.orientations import SENSORS_FROM_TRACKING, resample_orientations
    from motionary.io.sensors import SensorRecording, write_mtw
    from motionary.motion import resample
    from motionary.rotations import rotate

    _check_folder(output, replace=force)
    motion = read_recording(Path(recording), reading)
    tracked = track_limbs(motion)
    usual = [name for name in _USUAL if name in tracked.turns]
    chosen = limbs or usual
    for limb in chosen:
        if limb not in tracked.turns:
            there = ", ".join(tracked.turns) or "none: it holds positions without rotations"
            raise wrong("--limb", f"the turns of {limb!r} are not known; known are {there}")
    n_frames = int((motion.n_frames - 1) / motion.rate_hz * _SENSOR_HZ) + 1
    at = np.arange(n_frames) / _SENSOR_HZ * motion.rate_hz
    # Places of the root are near enough to where accelerations are felt.
    root = motion.generic_positions()[:, :1]
    joints = resample(root, rate_hz=motion.rate_hz, to_hz=_SENSOR_HZ)[:n_frames]
    places = rotate(np.broadcast_to(SENSORS_FROM_TRACKING, (n_frames, 1, 4)), joints)
    _empty_folder(output)
    for number, limb in enumerate(chosen):
        read = simulate_sensor(
            resample_orientations(tracked.turns[limb], at),
            np.nan_to_num(places[:, 0]),
            rate_hz=_SENSOR_HZ,
            seed=seed + number,
        )
        made = SensorRecording(limb, _SENSOR_HZ, read.gyr, read.acc, read.mag)
        write_mtw(Path(output) / f"{_PREFIX}{limb}.txt", made)
    screen.say(f"{len(chosen)} synthetic sensors written to {output}")
    return 0


# What people usually wear, where the motion has it.
_USUAL = ("root", "lthigh", "lshank", "lfoot", "rthigh", "rshank", "rfoot", "lforearm", "rforearm")


def _check_folder(output: str, *, replace: bool) -> None:
    """Fail before the work where files of two runs would stand beside each other."""
    check_target(output, is_folder=True)
    if not replace and _of_former_runs(output):
        raise UnwritableFile(
            f"{output}: holds synthetic recordings of a former run; --force replaces them"
        )


def _empty_folder(output: str) -> None:
    """Make the folder, and remove in it what a former run wrote."""
    for path in _of_former_runs(output):
        path.unlink()
    Path(output).mkdir(parents=True, exist_ok=True)


def _of_former_runs(output: str) -> list[Path]:
    own = [*Path(output).glob(f"{_PREFIX}*"), Path(output, _CAMERA)]
    return [path for path in own if path.is_file()]


@dataclass(frozen=True, kw_only=True)
class DepthOptions:
    """A depth camera, and what it sees wrongly."""

    noise: Annotated[str, typer.Option(metavar="|".join(_NOISES), help="Of the camera.")] = "kinect"
    distance_m: Annotated[
        float, typer.Option("--distance", metavar="METRES", help="From camera to body.")
    ] = 3.0
    images_hz: Annotated[float, typer.Option("--images", metavar="HZ", help="Images a second.")] = (
        30.0
    )
    fine: Annotated[bool, typer.Option(help="Use the finer mesh.")] = False


def depth(
    recording: Recording,
    output: Folder,
    options: DepthOptions,
    seed: Seed = 0,
    force: Force = False,
    *,
    reading: ReadOptions,
) -> int:
    """Write what a depth camera would have seen: 16-bit PNG in millimetres, and its intrinsics.

    motionary synth depth take.bvh -o images --noise tof --distance 2.5
    """
    import numpy as np
    from PIL import Image

    from motionary.body import (
        Camera,
        add_kinect_noise,
        add_time_of_flight_noise,
        load_body,
        pose_from_motion,
        render_depth,
        skin,
    )

    noise = options.noise
    if noise not in _NOISES:
        raise wrong("--noise", f"choose one of {', '.join(_NOISES)}, got {noise!r}")
    for option, value, least, most in (
        ("--distance", options.distance_m, 0.7, 20.0),
        ("--images", options.images_hz, 0.01, 1000.0),
    ):
        if not least <= value <= most:
            raise wrong(option, f"needs to be from {least:g} to {most:g}, got {value:g}")
    _check_folder(output, replace=force)
    motion = read_recording(Path(recording), reading)
    body = load_body(fine=options.fine)
    driven = pose_from_motion(body, motion)
    frames = np.arange(0, motion.n_frames, motion.rate_hz / options.images_hz).astype(np.intp)
    target = np.median(driven.pose.joints[:, 0], axis=0)
    camera = Camera().looking_at(target + np.array([0.0, 0.2, options.distance_m]), target)
    _empty_folder(output)
    for number, frame in enumerate(frames):
        pose = driven.pose._replace(
            rotations=driven.pose.rotations[frame : frame + 1],
            joints=driven.pose.joints[frame : frame + 1],
        )
        image = render_depth(np.asarray(skin(body, pose)[0]), body.faces, camera).depth
        if noise == "kinect":
            image = add_kinect_noise(image, camera, seed=seed + number)
        elif noise == "tof":
            image = add_time_of_flight_noise(image, seed=seed + number)
        millimetres = np.nan_to_num(np.clip(image * 1000, 0, 65535)).astype(np.uint16)
        Image.fromarray(millimetres).save(Path(output) / f"{_PREFIX}{number:06d}.png")
    told = {"noise": noise, "seed": seed, "rate_hz": options.images_hz}
    _write_camera(Path(output, _CAMERA), camera, told)
    screen.say(f"{len(frames)} synthetic depth images written to {output}")
    return 0


def _write_camera(path: Path, camera: "Camera", told: dict[str, Any]) -> None:
    content = {
        "synthetic": True, **told, "unit": "mm", "width": camera.width, "height": camera.height,
        "focal": camera.focal, "centre": camera.centre,
        "world_from_camera": camera.world_from_camera.tolist(),
        "position": camera.position.tolist(),
    }  # fmt: skip
    path.write_text(json.dumps(content, indent=1) + "\n", "utf-8")


SUBCOMMANDS = {"imu": imu, "depth": depth}
