"""`motionary imu` and `synth`: motion held against inertial sensors, and sensors simulated."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from motionary.cli import screen
from motionary.cli.options import (
    REQUIRED,
    AsJson,
    Excel,
    Force,
    LibraryDefault,
    argument,
    check_picture,
    check_target,
    declare,
    flag,
    option,
)
from motionary.cli.query import Start, Stop, check_part
from motionary.cli.recordings import read_recording
from motionary.errors import InvalidInput, UnwritableFile
from motionary.io.options import ReadOptions

if TYPE_CHECKING:
    from collections.abc import Iterable

    from motionary.body.rendering import Floats
    from motionary.inertial import LimbCheck, TrackingCheck

#: Headings of a limb's row, and its keys.
_LIMBS = {
    "sensor": "sensor", "limb": "limb", ">median": "median_deg", ">95 %": "p95_deg",
    ">across": "swing_deg", ">about": "twist_deg", ">sure to": "deviation_deg",
    ">drift": "drift_deg", ">wrong_s": "wrong_s", "": "notes",
}  # fmt: skip

Columns = Annotated[
    str | None, declare("--columns TOML", "Columns, units and rate of tables of no known layout.")
]
Magnetic = Annotated[
    bool,
    declare("--magnetic/--no-magnetic", "Let magnetometers tell headings; floors disturb them."),
]


def imu() -> None:
    """Hold tracked motion against inertial sensors.

    Sensors: Xsens MTw (.txt) and MVNX, OpenSense (.sto), APDM and BROAD (.h5), Movella DOT and
    other tables (.csv, with --columns).

    motionary imu check take.bvh --imu sensors/
    motionary imu orient sensors/ -o orientations.sto
    """


@dataclass(frozen=True, kw_only=True)
class CheckOptions:
    """Which sensors, where they sit, and where results go."""

    sensors: str = option("--imu PATH", "A folder or file of the sensors.", REQUIRED)
    limbs: str | None = option(
        "--map TOML", 'Limb of each sensor, "00B40C45" = "lthigh"; else found.'
    )
    columns: Columns = None
    fused: bool = flag(
        "--fused/--no-fused", "Take the orientations that the files bring, if they do."
    )
    magnetic: Magnetic = False
    output: str | None = option("--output -o CSV", "Write the table of limbs, too.")
    labels: str | None = option(
        "--labels FILE", "Write the wrong segments as labels, in any format."
    )
    plot: str | None = option("--plot PNG", "Draw the angles over time.")
    excel: Excel = False
    force: Force = False


def check(
    motion: Annotated[str, argument("RECORDING", "The motion as tracked.")],
    options: CheckOptions,
    as_json: AsJson = False,
    *,
    reading: ReadOptions,
) -> int:
    """List where limbs are tracked wrongly, by sensors that were worn.

    No calibration pose and no map is needed: clocks, limbs, mounts and headings are found. Angles
    are in degrees: between limb and sensor, across the limb and about it, and the expected error
    of the calibration ("sure to"). Positions cannot be checked so, only how limbs point and turn.

    motionary imu check take.bvh --imu sensors/ --plot angles.png --labels wrong.csv
    """
    from motionary.inertial import CheckSettings, check_tracking
    from motionary.io.labels import write_labels
    from motionary.io.sensors import read_sensors
    from motionary.io.text import write_table

    check_picture("--plot", options.plot)
    for target in (options.output, options.labels):
        check_target(target, replace=options.force)
    limbs = _read_map(options.limbs) if options.limbs is not None else None
    tracked = read_recording(Path(motion), reading)
    sensors = read_sensors(options.sensors, columns=options.columns)
    found = check_tracking(
        tracked,
        sensors,
        limbs=limbs,
        settings=CheckSettings(fused=options.fused, magnetic=options.magnetic),
    )
    rows = [_to_row(one, found) for one in found.limbs]
    if options.output is not None:
        columns = [key for key in rows[0] if key != "wrong"]
        table = [[row[key] for key in columns] for row in rows]
        write_table([columns, *table], options.output, excel=options.excel)
    if options.labels is not None:
        write_labels([found.track], options.labels)
    if options.plot is not None:
        from motionary.plots import plot_check, save

        save(plot_check(found), options.plot)
    if as_json:
        screen.print_json(*rows)
    else:
        _show(found, rows)
    for note in (*found.notes, *(note for sensor in sensors for note in sensor.notes)):
        screen.warn(note)
    return 0


def orient(
    source: Annotated[str, argument("PATH", "A folder or file of sensors.")],
    output: Annotated[str, declare("--output -o STO", "Orientations, for OpenSense.")],
    columns: Columns = None,
    magnetic: Magnetic = False,
    force: Force = False,
) -> int:
    """Write orientations of sensors from their raw measurements.

    motionary imu orient sensors/ -o orientations.sto
    """
    from motionary.inertial import orient as orient_sensor
    from motionary.io.sensors import read_sensors, write_orientations

    check_target(output, replace=force)
    sensors = read_sensors(source, columns=columns)
    found = {one.name: orient_sensor(one, magnetic=magnetic) for one in sensors}
    write_orientations(output, found, sensors[0].rate_hz)
    screen.say(f"{len(sensors)} sensors written to {output}")
    return 0


def _read_map(path: str) -> dict[str, str]:
    from motionary.io.text import read_toml

    limbs = read_toml(Path(path))
    wrong = [name for name, limb in limbs.items() if not isinstance(limb, str)]
    if wrong or not limbs:
        raise InvalidInput(
            f'needs lines such as "00B40C45" = "lthigh", got {wrong[0] if wrong else "none"}',
            file=Path(path).name,
        )
    return limbs


def _to_row(one: "LimbCheck", found: "TrackingCheck") -> dict[str, Any]:
    """What is said of one sensor, for JSON and tables."""
    import numpy as np

    rate = found.track.recording.rate_hz

    def summed(values: Any, how: Any) -> float | None:
        known = None if values is None else values[~np.isnan(values)]
        return None if known is None or not len(known) else round(float(how(known)), 2)

    def rms(values: Any) -> float:
        return float(np.sqrt(np.mean(values**2)))

    def finite(value: float) -> float | None:
        return round(value, 2) if np.isfinite(value) else None

    return {
        "recording": found.track.recording.name,
        "sensor": one.sensor,
        "limb": one.limb or None,
        "median_deg": summed(one.residual_deg, np.median),
        "p95_deg": summed(one.residual_deg, lambda known: np.percentile(known, 95)),
        "swing_deg": summed(one.swing_deg, rms),
        "twist_deg": summed(one.twist_deg, rms),
        "deviation_deg": finite(one.deviation_deg),
        "heading_deg": finite(one.heading_deg),
        "drift_deg": finite(one.drift_deg),
        "margin": finite(one.margin),
        "lag_s": round(found.lag.offset_s, 4),
        "wrong_s": round(sum(stop - first for first, stop in one.wrong) / rate, 2),
        "wrong": [[round(a / rate, 3), round(b / rate, 3)] for a, b in one.wrong],
        "notes": "; ".join(one.notes),
    }


def _show(found: "TrackingCheck", rows: list[dict[str, Any]]) -> None:
    cells = [
        [screen.cell(row[key], digits=1, unknown="-") for key in _LIMBS.values()] for row in rows
    ]
    screen.print_table(tuple(_LIMBS), cells)
    lag = found.lag
    drift = f", drift {lag.drift * 1e6:.0f} ppm" if lag.drift else ""
    screen.say(f"sensors' clock: motion's + {lag.offset_s:.3f} s{drift} (agreement {lag.peak:.2f})")
    for label in found.track:
        screen.say(
            f"{label.name}: {label.start_s:.2f} to {label.end_s:.2f} s, up to "
            f"{label.extra['worst_deg']} degrees in {label.extra['kind']} ({label.extra['sensor']})"
        )
    if not len(found.track):
        screen.say("no segment is tracked wrongly, as far as the sensors tell")


# -- simulated ----------------------------------------------------------------------------


# How names of synthetic files begin, and what describes the camera of images.
_SYNTHETIC, _CAMERA = "synthetic-", "camera.json"
Recording = Annotated[str, argument("RECORDING", "The motion to be recorded again.")]
Folder = Annotated[str, declare("--output -o FOLDER", "The folder to write into.")]
Seed = Annotated[int, declare("--seed N", "Of everything that is drawn at random.", min=0)]


def synth() -> None:
    """Make synthetic recordings of a motion: depth images, inertial sensors.

    What is written is synthetic and says so. The same seed gives the same files.

    motionary synth imu take.bvh -o sensors
    motionary synth depth take.bvh -o images --noise kinect
    """


def simulate_imu(
    recording: Recording,
    output: Folder,
    limbs: Annotated[
        list[str] | None, declare("--limb LIMB", "Limbs that wear one; else all nine usual.")
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
    motion = read_recording(Path(recording), reading)
    made = simulate_sensors(motion, limbs, seed=seed)
    _empty_folder(output)
    for sensor in made:
        write_mtw(Path(output) / f"{_SYNTHETIC}{sensor.name}.txt", sensor)
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
    own = [*Path(output).glob(f"{_SYNTHETIC}*"), Path(output, _CAMERA)]
    return [path for path in own if path.is_file()]


@dataclass(frozen=True, kw_only=True)
class DepthOptions:
    """A depth camera, what it sees wrongly, and where its images are written."""

    output: Folder
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
    seed: Seed = 0
    force: Force = False


def simulate_depth(recording: Recording, options: DepthOptions, *, reading: ReadOptions) -> int:
    """Write what a depth camera would have seen: 16-bit PNG in millimetres, and its intrinsics.

    motionary synth depth take.bvh -o images --noise tof --distance 2.5
    """
    from motionary.body import DepthSettings, load_body, record_depth

    settings = DepthSettings(options.noise, options.distance_m, options.images_hz)
    _check_folder(options.output, replace=options.force)
    motion = read_recording(Path(recording), reading)
    start_s, stop_s = check_part(motion.recording, options.start, options.stop)
    first = min(round(start_s * motion.rate_hz), motion.n_frames - 1)
    motion = motion.cut(first, min(max(round(stop_s * motion.rate_hz), first + 1), motion.n_frames))
    body = load_body(fine=options.fine)
    camera, images = record_depth(body, motion, settings, seed=options.seed)
    _empty_folder(options.output)
    written, n_cut = _write_images(Path(options.output), images)
    description = {
        "synthetic": True, "noise": options.noise, "seed": options.seed,
        "rate_hz": options.images_hz, "unit": "mm", "width": camera.width,
        "height": camera.height, "focal": camera.focal, "centre": camera.centre,
        "world_from_camera": camera.world_from_camera.tolist(),
        "position": camera.position.tolist(),
    }  # fmt: skip
    Path(options.output, _CAMERA).write_text(json.dumps(description, indent=1) + "\n", "utf-8")
    screen.say(f"{written} synthetic depth images written to {options.output}")
    if n_cut:
        screen.warn(
            f"in {n_cut} of {written} images the person is not whole: take a part of the recording "
            "by --from and --to, or a larger --distance"
        )
    return 0


def _write_images(folder: Path, images: "Iterable[Floats]") -> tuple[int, int]:
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
        Image.fromarray(millimetres).save(folder / f"{_SYNTHETIC}{count - 1:06d}.png")
    return count, n_cut


#: Commands of the groups, in the sequence of their helps.
SUBCOMMANDS = {
    "imu": {"check": check, "orient": orient},
    "synth": {"imu": simulate_imu, "depth": simulate_depth},
}
