"""`motionary synth`: what cameras and sensors would have recorded of a motion."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from motionary.cli import screen
from motionary.cli.options import Force, LibraryDefault, check_target, flag, option
from motionary.cli.query import Start, Stop, check_part
from motionary.cli.recordings import read_recording
from motionary.errors import UnwritableFile
from motionary.io.options import ReadOptions

if TYPE_CHECKING:
    from collections.abc import Iterator

    from motionary.body.rendering import Floats

Recording = Annotated[
    str, typer.Argument(metavar="RECORDING", help="The motion to be recorded again.")
]
Folder = Annotated[
    str, typer.Option("--output", "-o", metavar="FOLDER", help="The folder to write into.")
]
Seed = Annotated[
    int, typer.Option(min=0, metavar="N", help="Of everything that is drawn at random.")
]

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
    from motionary.inertial import simulate_sensors
    from motionary.io.sensors import write_mtw

    _check_folder(output, replace=force)
    made = simulate_sensors(read_recording(Path(recording), reading), limbs, seed=seed)
    _empty_folder(output)
    for sensor in made:
        write_mtw(Path(output) / f"{_PREFIX}{sensor.name}.txt", sensor)
    screen.say(f"{len(made)} synthetic sensors written to {output}")
    return 0


def _check_folder(output: str, *, replace: bool) -> None:
    """Fail before the work where files of two runs would stand beside each other."""
    check_target(output, is_folder=True)
    if not replace and _of_former_runs(output):
        raise UnwritableFile(
            "holds synthetic recordings of a former run; --force replaces them", file=output
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

    noise: str = option(
        "--noise none|kinect|tof",
        "Of the camera.",
        LibraryDefault("motionary.body:DepthSettings", "noise"),
    )
    distance_m: float = option(
        "--distance METRES",
        "From camera to body.",
        LibraryDefault("motionary.body:DepthSettings", "distance_m"),
    )
    images_hz: float = option(
        "--images HZ",
        "Images a second.",
        LibraryDefault("motionary.body:DepthSettings", "images_hz"),
    )
    start: Start = None
    stop: Stop = None
    fine: bool = flag("--fine/--no-fine", "Use the finer mesh.")


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
    from motionary.body import DepthSettings, load_body, record_depth

    settings = DepthSettings(options.noise, options.distance_m, options.images_hz)
    _check_folder(output, replace=force)
    motion = read_recording(Path(recording), reading)
    start_s, stop_s = check_part(motion.recording, options.start, options.stop)
    first = min(round(start_s * motion.rate_hz), motion.n_frames - 1)
    motion = motion.cut(first, min(max(round(stop_s * motion.rate_hz), first + 1), motion.n_frames))
    camera, images = record_depth(load_body(fine=options.fine), motion, settings, seed=seed)
    _empty_folder(output)
    written, n_cut = _write_images(Path(output), images)
    description = {
        "synthetic": True, "noise": options.noise, "seed": seed, "rate_hz": options.images_hz,
        "unit": "mm", "width": camera.width, "height": camera.height, "focal": camera.focal,
        "centre": camera.centre, "world_from_camera": camera.world_from_camera.tolist(),
        "position": camera.position.tolist(),
    }  # fmt: skip
    Path(output, _CAMERA).write_text(json.dumps(description, indent=1) + "\n", "utf-8")
    screen.say(f"{written} synthetic depth images written to {output}")
    if n_cut:
        screen.warn(
            f"in {n_cut} of {written} images the person is not whole: take a part of the recording "
            "by --from and --to, or a larger --distance"
        )
    return 0


def _write_images(folder: Path, images: "Iterator[Floats]") -> tuple[int, int]:
    """Write images as 16-bit PNG in millimetres, 0 where nothing is.

    How many there were, and in how many the person reaches the edge or is out of sight.
    """
    import numpy as np
    from PIL import Image

    count = n_cut = 0
    for count, image in enumerate(images, start=1):
        millimetres = np.nan_to_num(np.clip(image * 1000, 0, 65535)).astype(np.uint16)
        inner = int(np.count_nonzero(millimetres[1:-1, 1:-1]))
        n_cut += inner == 0 or inner < int(np.count_nonzero(millimetres))
        Image.fromarray(millimetres).save(folder / f"{_PREFIX}{count - 1:06d}.png")
    return count, n_cut


SUBCOMMANDS = {"imu": imu, "depth": depth}
