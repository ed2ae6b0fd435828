"""Sensors beside tracking: solvers, real sensors, planted and simulated errors (thesis, 7)."""

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evidence.common.recordings import CMU, HDM05, Recordings, Results
from evidence.common.running import compute_all
from motionary.body.sensors import IDEAL, integrate_rates, simulate_sensor
from motionary.errors import InvalidInput
from motionary.inertial import (
    CalibrationSettings,
    DetectionSettings,
    calibrate,
    calibrate_direction,
    calibrate_drifting,
    calibrate_published,
    check_tracking,
    find_wrong,
    orient,
    synchronise,
    track_limbs,
)
from motionary.inertial.orientations import (
    SENSORS_FROM_TRACKING,
    distance_deg,
    heading,
    resample_orientations,
    swing_twist_deg,
)
from motionary.inertial.synchronising import speeds_of_turn
from motionary.io import read
from motionary.io.sensors import SensorRecording, read_sensors
from motionary.motion import resample
from motionary.recording import find_runs
from motionary.rotations import (
    conjugate_quaternions,
    multiply_quaternions,
    rotate,
    rotation_vectors_to_quaternions,
)

TITLE = "Tracking held against inertial sensors"
SPLIT = (
    "limits of 25 and 12 degrees were chosen on CMU 86 and HDM05 bd; neither is among the "
    "people on whom sensors are simulated"
)
SEED = 0
DATA = (
    (
        "a walk with nine Xsens MTw and Vicon (NEURA, GPL-3); three trials of BROAD, CC BY 4.0; "
        f"{CMU}; {HDM05}; sensors on CMU and HDM05 are simulated",
        lambda recordings: (16 + len(_takes(recordings.folder)), 12.0),
    ),
)

Floats = NDArray[np.float64]

WALK = slice(1119, 2074)
WORN = {
    "00B40B91": ("Pelvis", "root"), "00B40C45": ("L_UpLeg", "lthigh"),
    "00B40C3C": ("R_UpLeg", "rthigh"), "00B40C44": ("L_LowLeg", "lshank"),
    "00B40C47": ("R_LowLeg", "rshank"), "00B40C55": ("L_Foot", "lfoot"),
    "00B40C48": ("R_Foot", "rfoot"), "00B40BA5": ("L_LowLeg2", "lshank"),
    "00B40C35": ("R_LowLeg2", "rshank"),
}  # fmt: skip
#: Columns of the Vicon segments.
VICON = {"root": "RPV", "lthigh": "LTH", "rthigh": "RTH", "lshank": "LSK", "rshank": "RSK",
         "lfoot": "LFT", "rfoot": "RFT"}  # fmt: skip
AXES = {"lthigh": (0, 0, -1.0), "rthigh": (0, 0, -1.0), "lshank": (0, 0, -1.0),
        "rshank": (0, 0, -1.0), "lfoot": (0, 0, 1.0), "rfoot": (0, 0, 1.0)}  # fmt: skip
SHARES = (0.0, 0.1, 0.3, 0.5)
SEEDS = 20
#: Degrees of turn about the second and third axis.
SPREADS = (1, 2, 4, 8, 15, 30)
ERRORS = ("twist 30", "twist 60", "twist 90", "drift 60", "swapped", "frozen")
RULES = {
    "printed solver, 45°": (False, DetectionSettings(45, 45, 0.0, 0.0)),
    "robust, 45°": (True, DetectionSettings(45, 45, 0.0, 0.0)),
    "robust, 20°": (True, DetectionSettings(20, 20, 0.0, 0.0)),
    "robust and drift, 25°/12°": (True, DetectionSettings()),
}
LIMBS = ("root", "chest", "lthigh", "rthigh", "lshank", "rshank", "lforearm", "rforearm", "lhand")
#: The trials of BROAD, and the bar of each in degrees.
TRIALS = {"02": 1.1, "16": 0.7, "24": 1.3}
ANY = CalibrationSettings(world="any")
#: Frames at 30 Hz below which a take is too short to calibrate on.
LEAST = 120
#: Frames by which the sensors' clock is ahead of Vicon's.
_VICON_LATE = 1.5


def measure(recordings: Recordings) -> Results:
    """All tables of the page."""
    folder = recordings.folder
    return {
        "exact": _exact(),
        "wrong_frames": _wrong_frames(folder),
        "deviation": _deviation(),
        "walk": _walk(folder / "sensors" / "neura"),
        "planted": _planted(folder / "sensors" / "neura"),
        "broad": _broad(folder / "sensors" / "broad"),
        "clocks": _clocks(folder),
        "simulated": _simulated(folder),
    }


def _quaternion(rng: np.random.Generator) -> Floats:
    one = rng.normal(size=4)
    return np.asarray(one / np.linalg.norm(one))


def _noisy(turns: Floats, deg: float, rng: np.random.Generator) -> Floats:
    noise = np.radians(deg / np.sqrt(3)) * rng.normal(size=(len(turns), 3))
    return multiply_quaternions(turns, rotation_vectors_to_quaternions(noise))


def _wandering(n: int, rng: np.random.Generator, spread: Floats) -> Floats:
    """Turns by smooth angles about three axes, of standard deviations in degrees."""
    knots = rng.normal(size=(n // 15 + 2, 3)) * np.radians(spread)
    at = np.arange(n) / 15
    smooth = np.stack([np.interp(at, np.arange(len(knots)), k) for k in knots.T], axis=1)
    return rotation_vectors_to_quaternions(smooth)


def _exact() -> Results:
    """Without noise; and the printed forms of appendix A beside ours."""
    rng = np.random.default_rng(SEED)
    turns = _wandering(900, rng, np.array([60.0, 60, 60]))
    world, mount = _quaternion(rng), _quaternion(rng)
    measured = multiply_quaternions(multiply_quaternions(world, turns), mount)
    found, printed = calibrate(turns, measured, ANY), calibrate_published(turns, measured)
    smooth = resample_orientations(turns, np.linspace(0, 899, 3600))
    read_out = simulate_sensor(smooth, np.zeros((3600, 3)), rate_hz=120.0, settings=IDEAL)
    back = integrate_rates(smooth[0], read_out.gyr, 120.0)
    in_world = integrate_rates(smooth[0], rotate(smooth, read_out.gyr), 120.0)
    forces = rotate(conjugate_quaternions(smooth), read_out.acc)
    return {
        "robust_deg": _worse(found.world, found.mount, world, mount) * 1e9,
        "printed_deg": _worse(*printed, world, mount) * 1e9,
        "unconjugated_deg": float(distance_deg(conjugate_quaternions(printed[1]), mount)),
        "rates_back_deg": float(distance_deg(back, smooth).max()) * 1e9,
        "rates_in_world_deg": float(np.median(distance_deg(in_world, smooth))),
        "gravity_m_s2": float(np.abs(rotate(smooth, read_out.acc) - (0, 0, 9.81)).max()) * 1e9,
        "forces_as_printed": float(np.median(np.linalg.norm(forces - (0, 0, 9.81), axis=1))),
    }


def _worse(world: Floats, mount: Floats, true_world: Floats, true_mount: Floats) -> float:
    return float(max(distance_deg(world, true_world), distance_deg(mount, true_mount)))


def _wrong_frames(folder: Path) -> Results:
    """Error of both solvers on limbs of a real motion, with runs of wrong frames."""
    limbs = track_limbs(read(folder / "cmu" / "86_01.amc"))
    result: Results = {}
    for limb in ("lshank", "lhand", "chest"):
        turns = limbs.turns[limb][: 3 * 1200 : 3]
        for share in SHARES:
            ours, printed, seconds = [], [], []
            for seed in range(SEEDS):
                rng = np.random.default_rng(seed)
                world, mount = _quaternion(rng), _quaternion(rng)
                measured = _noisy(
                    multiply_quaternions(multiply_quaternions(world, turns), mount), 5.0, rng
                )
                wrong = _spoilt(turns, share, rng)
                began = time.process_time()
                found = calibrate(wrong, measured, ANY)
                seconds.append(time.process_time() - began)
                ours.append(_worse(found.world, found.mount, world, mount))
                printed.append(
                    _worse(*calibrate_published(wrong, measured, seed=seed), world, mount)
                )
            result[f"{limb}, {share:.0%}"] = {
                "robust": [np.median(ours), max(ours)],
                "printed": [np.median(printed), max(printed)],
                "ms": 1000 * float(np.median(seconds)),
            }
    return result


def _spoilt(turns: Floats, share: float, rng: np.random.Generator) -> Floats:
    """Turns with runs of 30 frames turned by anything."""
    wrong = turns.copy()
    n_runs = len(turns) // 30
    for run in rng.choice(n_runs, round(share * n_runs), replace=False):
        part = slice(30 * run, 30 * run + 30)
        wrong[part] = multiply_quaternions(wrong[part], _quaternion(rng))
    return wrong


def _deviation() -> Results:
    """Expected against true error where turns about one axis prevail."""
    free = CalibrationSettings(world="any", refused_deg=np.inf)
    result: Results = {}
    for spread in SPREADS:
        errors, expected, refused = [], [], 0
        for seed in range(SEEDS):
            rng = np.random.default_rng(seed)
            turns = _wandering(600, rng, np.array([90.0, spread, spread]))
            world, mount = _quaternion(rng), _quaternion(rng)
            measured = _noisy(
                multiply_quaternions(multiply_quaternions(world, turns), mount), 5.0, rng
            )
            found = calibrate(turns, measured, free)
            errors.append(_worse(found.world, found.mount, world, mount))
            expected.append(found.deviation_deg)
            refused += found.deviation_deg > CalibrationSettings().refused_deg
        result[str(spread)] = {
            "expected": float(np.median(expected)),
            "true": float(np.sqrt(np.mean(np.square(errors)))),
            "refused": int(refused),
        }
    return result


class _Walk(NamedTuple):
    """The walk with sensors: limbs by Xsens' BVH and by Vicon, orientations of sensors."""

    bvh: Mapping[str, Floats]
    directions: Mapping[str, Floats]
    axes: Mapping[str, Floats]
    vicon: Mapping[str, Floats]
    fused: Mapping[str, Floats]
    raw: Mapping[str, Floats]


def _read_walk(folder: Path) -> _Walk:
    limbs = track_limbs(read(folder / "S02-Trial-Walk-1.bvh"))
    lines = (folder / "S02-Trial-Walk-1.csv").read_text("utf-8").splitlines()
    titles = lines[5].split(",")
    rows = np.array([[float(x) for x in line.split(",")] for line in lines[6:]])
    vicon = {
        limb: rows[:, [titles.index(f"q{code}_{k}") for k in range(1, 5)]]
        for limb, code in VICON.items()
    }
    sensors = read_sensors(folder / "imu")
    return _Walk(
        limbs.turns,
        limbs.directions,
        limbs.axes,
        vicon,
        {one.name: one.orientations for one in sensors if one.orientations is not None},
        {one.name: orient(one) for one in sensors},
    )


def _walk(folder: Path) -> Results:
    """Residuals of each sensor, with and without turns; who sits where; the whole command."""
    walk = _read_walk(folder)
    sensors: Results = {}
    at = np.arange(955.0) + 1119 + _VICON_LATE
    for name, (place, limb) in WORN.items():
        fused, raw = walk.fused[name], walk.raw[name]
        row: Results = {"limb": limb}
        for way, turns in (("fused", fused), ("raw", raw)):
            found = calibrate(walk.bvh[limb][WALK], turns[WALK], ANY)
            row[way] = [np.median(found.residual_deg), _rms(found.residual_deg)]
        by_vicon = resample_orientations(raw, at)
        found = calibrate(walk.vicon[limb], by_vicon, ANY)
        row["vicon"] = [np.median(found.residual_deg), _rms(found.residual_deg)]
        if limb in AXES:
            row["vicon_parts"] = _parts(walk.vicon[limb], by_vicon, found, np.array(AXES[limb]))
            direction = calibrate_direction(walk.directions[limb][WALK], fused[WALK])
            row["direction"] = np.percentile(direction.residual_deg, [50, 95, 100])
            pointing = rotate(walk.vicon[limb], np.tile(AXES[limb], (955, 1)))
            direction = calibrate_direction(pointing, resample_orientations(fused, at))
            row["vicon_direction"] = np.percentile(direction.residual_deg, [50, 95, 100])
        sensors[place] = row
    same = [
        np.median(calibrate(walk.raw[a][WALK], walk.raw[b][WALK], ANY).residual_deg)
        for a, b in (("00B40C44", "00B40BA5"), ("00B40C47", "00B40C35"))
    ]
    began = time.process_time()
    motion = read(folder / "S02-Trial-Walk-1.bvh")
    check = check_tracking(motion, read_sensors(folder / "imu"))
    seconds = time.process_time() - began
    placed = {one.sensor: one for one in check.limbs}
    return {
        "sensors": sensors,
        "same_shank_deg": same,
        "placed": sum(placed[name].limb == limb for name, (_, limb) in WORN.items()),
        "least_margin": min(one.margin for one in check.limbs if one.limb != "root"),
        "false_alarms": len(check.track),
        "lag_s": check.lag.offset_s,
        "seconds": seconds,
    }


def _parts(tracked: Floats, measured: Floats, found: Any, axis: Floats) -> list[float]:
    """Root mean square across and about a limb."""
    told = multiply_quaternions(
        multiply_quaternions(conjugate_quaternions(found.world), measured),
        conjugate_quaternions(found.mount),
    )
    return [_rms(part) for part in swing_twist_deg(tracked, told, axis)]


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


def _plant(
    kind: str, turns: Mapping[str, Floats], limb: str, rate_hz: float, rng: np.random.Generator
) -> tuple[Floats, list[tuple[int, int]]]:
    """A limb's turns with errors in some stretches, and where these are."""
    wrong, stretches = turns[limb].copy(), []
    n, axis = len(wrong), np.array([0.0, 1.0, 0.0])
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
        stretches.append((first, first + length))
    return wrong, stretches


def _judge(tracked: Floats, measured: Floats, rate_hz: float, rule: str) -> list[tuple[int, int]]:
    """What a rule finds wrong, calibrated on the very motion."""
    robust, settings = RULES[rule]
    if not robust:
        world, mount = calibrate_published(tracked, measured)
        told = multiply_quaternions(multiply_quaternions(world, tracked), mount)
        return find_wrong(distance_deg(measured, told), rate_hz, settings)
    if "drift" in rule:
        found = calibrate_drifting(tracked, measured, rate_hz).calibration
    else:
        found = calibrate(tracked, measured)
    return find_wrong(found.residual_deg, rate_hz, settings)


class _Tally:
    """Frames and stretches, found and true, over many limbs."""

    def __init__(self) -> None:
        self.counts = np.zeros(7)

    def add(self, found: list[tuple[int, int]], truth: NDArray[np.bool_]) -> None:
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


def _planted(folder: Path) -> Results:
    """Errors planted into the BVH of the walk, against its sensors fused from raw."""
    walk = _read_walk(folder)
    turns = {limb: one[950:2150] for limb, one in walk.bvh.items()}
    legs = {limb: name for name, (place, limb) in WORN.items() if not place.endswith("2")}
    legs.pop("root")
    result: Results = {}
    for kind in ERRORS:
        tallies = {rule: _Tally() for rule in RULES}
        for seed in range(10):
            rng = np.random.default_rng(seed)
            for limb, name in legs.items():
                wrong, _ = _plant(kind, turns, limb, 100.0, rng)
                truth = distance_deg(wrong, turns[limb]) > 20
                for rule, tally in tallies.items():
                    found = _attempt(wrong, walk.fused[name][950:2150], 100.0, rule)
                    tally.add(found, np.asarray(truth))
        result[kind] = {rule: tally.scores() for rule, tally in tallies.items()}
    return result


def _attempt(tracked: Floats, measured: Floats, rate_hz: float, rule: str) -> list[tuple[int, int]]:
    try:
        return _judge(tracked, measured, rate_hz, rule)
    except InvalidInput:
        return []


def _broad(folder: Path) -> Results:
    """Errors of orientations in movement, by trial; heading is set by the first two seconds."""
    import h5py

    result: Results = {}
    for path in sorted(folder.glob("*.hdf5")):
        (sensor,) = read_sensors(path)
        with h5py.File(path) as file:
            truth = np.array(file["opt_quat"])
            moving = np.array(file["movement"], dtype=bool)
        row = {}
        for way, options in (("6-D offline", {}), ("9-D offline", {"magnetic": True}),
                             ("9-D online", {"magnetic": True, "online": True})):  # fmt: skip
            told = orient(sensor, **options)
            between = multiply_quaternions(truth, conjugate_quaternions(told))
            known = ~np.isnan(between).any(axis=1)
            if "magnetic" not in options:
                start = between[known][: int(2 * sensor.rate_hz)]
                turn = heading(2 * np.arctan2(start[:, 3].sum(), start[:, 0].sum()))
                between = multiply_quaternions(truth, conjugate_quaternions(
                    multiply_quaternions(turn, told)))  # fmt: skip
            error = distance_deg(between, np.array([1.0, 0, 0, 0]))
            row[way] = _rms(error[moving & known])
        result[path.stem[:2]] = row
    return result


def _clocks(folder: Path) -> Results:
    """Offsets and drifts planted into ten minutes of rates of real motion."""
    speeds = np.concatenate([
        speeds_of_turn(track_limbs(read(path)).turns["lshank"], 120.0)
        for path in sorted((folder / "hdm05").glob("*/*.amc"))
    ])[: 120 * 600]  # fmt: skip
    rng, rows = np.random.default_rng(SEED), []
    for offset, drift in ((0.12, 0.0), (-0.74, 200e-6), (1.23, -150e-6)):
        n = int(len(speeds) / 1.2)
        seconds = np.arange(n) / 100
        at = (seconds - offset) / (1 + drift) * 120
        sensor = np.interp(at, np.arange(len(speeds)), speeds) + rng.normal(size=n) * 0.05
        tracked = np.interp(np.arange(n) * 1.2, np.arange(len(speeds)), speeds)
        found = synchronise([tracked], [sensor], rate_hz=100.0)
        spoilt = tracked.copy()
        spoilt[0] = np.radians(9000)
        moved = synchronise([spoilt], [sensor], rate_hz=100.0)
        middle = seconds[-1] / 2
        wanted = offset + drift * middle
        rows.append({
            "offset_s": offset, "drift_ppm": drift * 1e6, "minutes": seconds[-1] / 60,
            "offset_error_ms": abs(found.offset_s + found.drift * middle - wanted) * 1000,
            "drift_error_ppm": abs(found.drift - drift) * 1e6,
            "moved_frames": abs(moved.offset_s - found.offset_s) * 100,
        })  # fmt: skip
    return {"rows": rows}


def _takes(folder: Path) -> list[Path]:
    """Takes of people on whom nothing was chosen."""
    takes = [*(folder / "hdm05_takes").glob("*.amc"), *(folder / "cmu_everyday").glob("*.amc"),
             *(folder / "cmu").rglob("*.amc")]  # fmt: skip
    return sorted(path for path in takes if "_bd_" not in path.name and path.stem != "86_01")


def _simulated(folder: Path) -> Results:
    """Simulated sensors on real motion: clean, and with planted errors."""
    parts = compute_all(_simulate_take, _takes(folder))
    kinds = ["clean", *ERRORS]
    tallies = {kind: {rule: _Tally() for rule in RULES} for kind in kinds}
    alarms, minutes = dict.fromkeys(RULES, 0), 0.0
    for part in parts:
        minutes += part["minutes"]
        for rule in RULES:
            alarms[rule] += part["alarms"][rule]
            for kind in ERRORS:
                tallies[kind][rule].counts += part["counts"][kind][rule]
    return {
        "limb_minutes": minutes,
        "alarms_per_10_min": {rule: 10 * n / minutes for rule, n in alarms.items()},
        "errors": {kind: {rule: tallies[kind][rule].scores() for rule in RULES} for kind in ERRORS},
    }


def _simulate_take(path: Path) -> dict[str, Any]:
    """Counts of one take, at 30 Hz, tracked with 4 degrees of smooth noise."""
    # The exercises have no skeleton of their own; one of another person turns alike.
    asf = path.parents[1] / "86.asf" if path.parent.name == "exercises" else None
    motion = read(path, asf=asf)
    limbs = track_limbs(motion)
    step = motion.rate_hz / 30
    n = int((motion.n_frames - 1) / step) + 1
    fast: Floats = (
        np.arange(int((motion.n_frames - 1) / motion.rate_hz * 100) + 1) / 100 * motion.rate_hz
    )
    joints = resample(motion.generic_positions()[:, :1], rate_hz=motion.rate_hz, to_hz=100.0)
    places = rotate(np.tile(SENSORS_FROM_TRACKING, (len(fast), 1)), joints[: len(fast), 0])
    counts = {kind: {rule: np.zeros(7) for rule in RULES} for kind in ERRORS}
    result: dict[str, Any] = {"minutes": 0.0, "alarms": dict.fromkeys(RULES, 0), "counts": counts}
    if n < LEAST:
        return result
    turns = {
        limb: resample_orientations(limbs.turns[limb], np.asarray(np.arange(n) * step))
        for limb in limbs.turns
    }
    for number, limb in enumerate(LIMBS):
        if limb not in turns:
            continue
        rng = np.random.default_rng([SEED, number, len(path.stem), motion.n_frames])
        sensed = simulate_sensor(
            resample_orientations(limbs.turns[limb], fast), places, rate_hz=100.0,
            mount=_quaternion(rng), seed=int(rng.integers(1 << 30)),
        )  # fmt: skip
        told = orient(SensorRecording(limb, 100.0, sensed.gyr, sensed.acc))
        measured = resample_orientations(told, np.arange(n) / 30 * 100)
        knots = rng.normal(size=(3, n // 6 + 2)) * np.radians(4 / np.sqrt(3))
        at = np.arange(n) / 6
        smooth = np.stack([np.interp(at, np.arange(len(one)), one) for one in knots], axis=1)
        shaking = rotation_vectors_to_quaternions(smooth)
        tracked = {one: multiply_quaternions(turns[one], shaking) for one in turns}
        result["minutes"] += n / 30 / 60
        for rule in RULES:
            result["alarms"][rule] += len(_attempt(tracked[limb], measured, 30.0, rule))
        for kind in ERRORS:
            if kind == "swapped" and limb in ("root", "chest"):
                continue
            wrong, _ = _plant(kind, tracked, limb, 30.0, rng)
            truth = np.asarray(distance_deg(wrong, tracked[limb]) > 20)
            for rule in RULES:
                tally = _Tally()
                tally.add(_attempt(wrong, measured, 30.0, rule), truth)
                counts[kind][rule] += tally.counts
    return result
