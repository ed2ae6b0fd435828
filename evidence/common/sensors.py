"""What pages on sensors share: rules, planted errors, counts, and simulated takes."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.inertial import (
    DetectionSettings,
    calibrate,
    calibrate_drifting,
    calibrate_published,
    find_wrong,
    orient,
    track_limbs,
)
from motionary.inertial.limbs import rates_of_turn, simulate_sensor
from motionary.inertial.orientations import (
    SENSORS_FROM_TRACKING,
    distance_deg,
    resample_orientations,
    swing_twist_deg,
)
from motionary.io import read
from motionary.io.sensors import SensorRecording
from motionary.motion import resample
from motionary.recording import find_runs
from motionary.rotations import multiply_quaternions, rotate, rotation_vectors_to_quaternions

Floats = NDArray[np.float64]
Stretches = list[tuple[int, int]]

ERRORS = ("twist 30", "twist 60", "twist 90", "drift 60", "swapped", "frozen")


def _by_print(tracked: Floats, measured: Floats, rate_hz: float) -> Floats:
    world, mount = calibrate_published(tracked, measured)
    told = multiply_quaternions(multiply_quaternions(world, tracked), mount)
    return distance_deg(measured, told)


def _robustly(tracked: Floats, measured: Floats, rate_hz: float) -> Floats:
    return calibrate(tracked, measured).residual_deg


def _drifting(tracked: Floats, measured: Floats, rate_hz: float) -> Floats:
    return calibrate_drifting(tracked, measured, rate_hz).calibration.residual_deg


#: How residuals are found, and what counts as wrong.
RULES = {
    "printed solver, 45°": (_by_print, DetectionSettings(45, 45, 0.0, 0.0)),
    "robust, 45°": (_robustly, DetectionSettings(45, 45, 0.0, 0.0)),
    "robust, 20°": (_robustly, DetectionSettings(20, 20, 0.0, 0.0)),
    "robust and drift, 25°/12°": (_drifting, DetectionSettings()),
}
DEFAULT = "robust and drift, 25°/12°"
#: A planted error counts where the limb is turned by more.
WRONG_DEG = 20.0
LIMBS = ("root", "chest", "lthigh", "rthigh", "lshank", "rshank", "lfoot", "rfoot",
         "lforearm", "rforearm", "lhand", "rhand")  # fmt: skip
#: On whom rules were chosen, of HDM05 and CMU.
DEVELOPMENT = {"bd", "bk", "dg", "02", "05", "07", "16", "35", "86"}
#: Frames a second at which limbs and sensors are compared, and of simulated sensors.
RATE_HZ, SENSOR_HZ = 30.0, 100.0
#: Frames below which a take is too short to calibrate on.
LEAST = 120
#: A limb that turns by more in 1/120 s is an error of the recording: 7200 degrees a second.
JUMP_DEG = 60.0


def draw_quaternion(rng: np.random.Generator) -> Floats:
    """Any orientation."""
    one = rng.normal(size=4)
    return np.asarray(one / np.linalg.norm(one))


def rms(values: Floats) -> float:
    """Root mean square of what is known."""
    return float(np.sqrt(np.nanmean(values**2)))


def worse(world: Floats, mount: Floats, true_world: Floats, true_mount: Floats) -> float:
    """Error of the worse of world and mount, degrees."""
    return float(max(distance_deg(world, true_world), distance_deg(mount, true_mount)))


def plant(
    kind: str,
    turns: Mapping[str, Floats],
    limb: str,
    axis: Floats,
    rate_hz: float,
    rng: np.random.Generator,
) -> Floats:
    """A limb's turns with an error in a stretch of each half; twists are about its axis."""
    wrong, n = turns[limb].copy(), len(turns[limb])
    for number in range(2):
        long_s = rng.uniform(3, 5) if kind.startswith("drift") else rng.uniform(0.5, 1.5)
        length = min(int(long_s * rate_hz), n // 5)
        first = int(rng.integers(number * n // 2, (number + 1) * n // 2 - length))
        part = slice(first, first + length)
        if kind.startswith("twist"):
            turn = np.radians(float(kind.split()[1])) * axis
            wrong[part] = multiply_quaternions(wrong[part], rotation_vectors_to_quaternions(turn))
        elif kind.startswith("drift"):
            angle = np.radians(np.linspace(0, float(kind.split()[1]), length))
            turn = rotation_vectors_to_quaternions(angle[:, None] * axis)
            wrong[part] = multiply_quaternions(wrong[part], turn)
        elif kind == "swapped":
            wrong[part] = turns[{"l": "r", "r": "l"}[limb[0]] + limb[1:]][part]
        else:
            wrong[part] = wrong[first]
    return wrong


def end_moved_m(turns: Floats, wrong: Floats, axis: Floats, length_m: float) -> Floats:
    """How far the end of a limb is off: all that joint positions show of a wrong turn."""
    swing, _ = swing_twist_deg(turns, wrong, axis)
    return np.asarray(2 * length_m * np.sin(np.radians(swing) / 2))


def find_errors(
    tracked: Floats, measured: Floats, rate_hz: float, rules: Iterable[str] = RULES
) -> dict[str, Stretches]:
    """What rules find wrong, calibrated on the very motion; nothing where that is refused."""
    found: dict[str, Stretches] = {}
    residuals: dict[Callable[[Floats, Floats, float], Floats], Floats] = {}
    for rule in rules:
        solve, settings = RULES[rule]
        if solve not in residuals:
            try:
                residuals[solve] = solve(tracked, measured, rate_hz)
            except InvalidInput:
                residuals[solve] = np.full(len(tracked), np.nan)
        found[rule] = find_wrong(residuals[solve], rate_hz, settings)
    return found


class Tally:
    """Frames and stretches, found and true, over many limbs."""

    def __init__(self) -> None:
        self.counts = np.zeros(7)

    def add(self, found: Stretches, truth: NDArray[np.bool_]) -> None:
        """Count what was found in one limb, beside where it is wrong."""
        told = np.zeros(len(truth), dtype=bool)
        for first, stop in found:
            told[first:stop] = True
        true = [(int(a), int(b)) for a, b in find_runs(truth)]
        hit = sum(told[a:b].any() for a, b in true)
        right = sum(truth[a:b].any() for a, b in found)
        seen = (told & truth).sum(), told.sum(), truth.sum(), hit, len(true), right, len(found)
        self.counts += np.array(seen, dtype=np.float64)

    def scores(self) -> list[float]:
        """Precision, recall, F of frames; of stretches."""
        both, told, true, hit, n_true, right, n_found = self.counts
        result: list[float] = []
        for p, r in ((both / max(told, 1), both / max(true, 1)),
                     (right / max(n_found, 1), hit / max(n_true, 1))):  # fmt: skip
            result += [p, r, 2 * p * r / max(p + r, 1e-12)]
        return result


def find_takes(folder: Path, *, development: bool) -> list[Path]:
    """Takes of HDM05 and CMU, each once, of people on whom rules were chosen or of the others."""
    found: dict[str, Path] = {}
    for place in ("hdm05_takes", "hdm05", "cmu_everyday", "cmu"):
        for path in sorted((folder / place).rglob("*.amc")):
            parts = path.stem.split("_")
            person = parts[1] if parts[0] == "HDM" else parts[0]
            if (person in DEVELOPMENT) == development:
                found.setdefault(path.stem, path)
    return [found[name] for name in sorted(found)]


def describe_takes(
    folder: Path, *, development: Sequence[bool] = (False, True)
) -> tuple[int, float]:
    """How many takes are long enough, and their minutes."""
    paths = [path for one in development for path in find_takes(folder, development=one)]
    frames = [
        sum(line.strip().isdigit() for line in path.open(encoding="latin-1")) for path in paths
    ]
    long = [n for n in frames if n >= LEAST * 120 / RATE_HZ]
    return len(long), round(sum(long) / 120 / 60, 2)


class SensedLimb(NamedTuple):
    """A limb with a simulated sensor, at 30 Hz.

    Attributes
    ----------
    name : of the limb
    tracked : turns of all limbs with the noise of a tracker, of which `name` is one
    measured : orientations of the sensor, fused from what it read
    axis : of the limb, seen from it
    jumps : frames beside which the recording itself turns faster than limbs can
    rng : for what is drawn next
    fusing : of the fusion: median angle to the limb's own turns, degrees; error of the bias of
        the gyroscope as planted and as found, degrees a second
    """

    name: str
    tracked: Mapping[str, Floats]
    measured: Floats
    axis: Floats
    jumps: NDArray[np.intp]
    rng: np.random.Generator
    fusing: tuple[float, float, float]


def sense_limbs(path: Path, *, seed: int = 0, limbs: Sequence[str] = LIMBS) -> Iterator[SensedLimb]:
    """Limbs of a take with simulated sensors, tracked with 4 degrees of smooth noise."""
    # The exercises have no skeleton of their own; one of another person turns alike.
    asf = path.parents[1] / "86.asf" if path.parent.name == "exercises" else None
    motion = read(path, asf=asf)
    step = motion.rate_hz / RATE_HZ
    n = int((motion.n_frames - 1) / step) + 1
    if n < LEAST:
        return
    true, at = track_limbs(motion), np.asarray(np.arange(n) * step)
    turns = {limb: resample_orientations(one, at) for limb, one in true.turns.items()}
    n_fast = int((motion.n_frames - 1) / motion.rate_hz * SENSOR_HZ) + 1
    fast: Floats = np.arange(n_fast) / SENSOR_HZ * motion.rate_hz
    root = motion.generic_positions()[:, 0]
    root = resample(root, rate_hz=motion.rate_hz, to_hz=SENSOR_HZ)[:n_fast]
    places = rotate(np.tile(SENSORS_FROM_TRACKING, (n_fast, 1)), root)
    for number, limb in enumerate(LIMBS):
        if limb not in turns or limb not in limbs:
            continue
        rng = np.random.default_rng([seed, number, len(path.stem), motion.n_frames])
        own = true.turns[limb]
        read_out = simulate_sensor(
            resample_orientations(own, fast), places, rate_hz=SENSOR_HZ,
            mount=draw_quaternion(rng), seed=int(rng.integers(1 << 30)),
        )  # fmt: skip
        told = orient(SensorRecording(limb, SENSOR_HZ, read_out.gyr, read_out.acc))
        measured = resample_orientations(told, np.asarray(np.arange(n) / RATE_HZ * SENSOR_HZ))
        shaking = _smooth_noise(n, rng)
        tracked = {one: multiply_quaternions(turns[one], shaking) for one in turns}
        steps = distance_deg(own[1:], own[:-1]) * motion.rate_hz / 120
        jumps = np.unique((np.flatnonzero(steps > JUMP_DEG) / step).round().astype(np.intp))
        yield SensedLimb(
            limb, tracked, measured, true.axes[limb], jumps, rng,
            (_median_fit(turns[limb], measured), *_biases(read_out)),
        )  # fmt: skip


def _smooth_noise(n: int, rng: np.random.Generator) -> Floats:
    """Turns of 4 degrees that go on for a fifth of a second."""
    knots = rng.normal(size=(3, n // 6 + 2)) * np.radians(4 / np.sqrt(3))
    at = np.arange(n) / 6
    smooth = np.stack([np.interp(at, np.arange(len(one)), one) for one in knots], axis=1)
    return rotation_vectors_to_quaternions(smooth)


def _median_fit(turns: Floats, measured: Floats) -> float:
    try:
        found = calibrate_drifting(turns, measured, RATE_HZ).calibration
    except InvalidInput:
        return np.nan
    return float(np.nanmedian(found.residual_deg))


def _biases(read_out: Any) -> tuple[float, float]:
    """Size of the planted bias of the gyroscope, and what the filter misses of it, degrees/s."""
    import vqf

    true = (read_out.gyr - rates_of_turn(read_out.orientations, SENSOR_HZ)).mean(axis=0)
    gyr, acc = (np.ascontiguousarray(one) for one in (read_out.gyr, read_out.acc))
    found = np.median(vqf.offlineVQF(gyr, acc, None, 1 / SENSOR_HZ)["bias"], axis=0)
    sizes = np.degrees([np.linalg.norm(true), np.linalg.norm(found - true)])
    return float(sizes[0]), float(sizes[1])
