"""Sensors beside tracking: solvers, real sensors, planted and simulated errors (thesis, 7)."""

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evidence.common.recordings import CMU, HDM05, Recordings, Results
from evidence.common.sensors import (
    ERRORS,
    RULES,
    WRONG_DEG,
    Tally,
    draw_quaternion,
    end_moved_m,
    find_errors,
    plant,
    rms,
    worse,
)
from motionary.inertial import (
    CalibrationSettings,
    calibrate,
    calibrate_direction,
    calibrate_drifting,
    calibrate_published,
    check_tracking,
    orient,
    synchronise,
    track_limbs,
)
from motionary.inertial.limbs import IDEAL, integrate_rates, simulate_sensor
from motionary.inertial.orientations import (
    distance_deg,
    heading,
    resample_orientations,
    speeds_of_turn,
    swing_twist_deg,
)
from motionary.io import read
from motionary.io.sensors import read_sensors
from motionary.motion import GENERIC_JOINTS
from motionary.recording import find_runs
from motionary.rotations import (
    conjugate_quaternions,
    matrices_to_quaternions,
    multiply_quaternions,
    quaternions_to_matrices,
    rotate,
    rotation_vectors_to_quaternions,
)

TITLE = "Tracking held against inertial sensors"
SPLIT = "limits were chosen on simulated sensors; nothing is chosen on the walk or on BROAD"
SEED = 0
DATA = (
    (
        "a walk with nine Xsens MTw and Vicon (NEURA, GPL-3); three trials of BROAD (Laidig, "
        f"Caruso, Cereatti, Seel 2021), CC BY 4.0; limbs of {CMU}; {HDM05}",
        lambda recordings: (37, 10.9),
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
#: Degrees of turn about the first axis, and about the others.
SPREADS = ((90, 30), (90, 15), (90, 8), (90, 4), (90, 2), (90, 1), (90, 0.5), (90, 0), (0, 0))
#: Of OpenCV, whose time grows with the square of the frames.
OPENCV_SEEDS, OPENCV_STEP = 10, 8
#: Of each trial of BROAD: total errors of Madgwick's and Mahony's filters as its authors
#: published them in its repository (2021, both tuned over all trials, with magnetometer).
PUBLISHED = {"02": (1.50, 2.97), "16": (4.82, 20.28), "24": (1.77, 2.15)}
ANY = CalibrationSettings(world="any")
#: Sample of the sensors at Vicon's first frame, by its file.
_VICON_FIRST = 1119


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
    }


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
    world, mount = draw_quaternion(rng), draw_quaternion(rng)
    measured = multiply_quaternions(multiply_quaternions(world, turns), mount)
    found, printed = calibrate(turns, measured, ANY), calibrate_published(turns, measured)
    smooth = resample_orientations(turns, np.linspace(0, 899, 3600))
    read_out = simulate_sensor(smooth, np.zeros((3600, 3)), rate_hz=120.0, settings=IDEAL)
    back = integrate_rates(smooth[0], read_out.gyr, 120.0)
    in_world = integrate_rates(smooth[0], rotate(smooth, read_out.gyr), 120.0)
    forces = rotate(conjugate_quaternions(smooth), read_out.acc)
    forward = np.concatenate([read_out.gyr[1:], read_out.gyr[-1:]])
    return {
        "opencv_deg": float(distance_deg(_by_opencv(turns[::6], measured[::6]), mount)) * 1e6,
        "robust_deg": worse(found.world, found.mount, world, mount) * 1e9,
        "printed_deg": worse(*printed, world, mount) * 1e9,
        "unconjugated_deg": float(distance_deg(conjugate_quaternions(printed[1]), mount)),
        "rates_back_deg": float(distance_deg(back, smooth).max()) * 1e9,
        "rates_in_world_deg": float(np.median(distance_deg(in_world, smooth))),
        "gravity_m_s2": float(np.abs(rotate(smooth, read_out.acc) - (0, 0, 9.81)).max()) * 1e9,
        "forces_as_printed": float(np.median(np.linalg.norm(forces - (0, 0, 9.81), axis=1))),
        "rates_late_deg": float(
            np.median(distance_deg(integrate_rates(smooth[0], forward, 120.0), smooth))
        ),
    }


def _by_opencv(turns: Floats, measured: Floats) -> Floats:
    """Mount by OpenCV's solver of Park's equations, over all pairs of frames."""
    import cv2

    sensor = list(quaternions_to_matrices(measured))
    limb = list(quaternions_to_matrices(conjugate_quaternions(turns)))
    nowhere = [np.zeros((3, 1))] * len(sensor)
    method = cv2.CALIB_HAND_EYE_PARK
    turn, _ = cv2.calibrateHandEye(sensor, nowhere, limb, nowhere, method=method)
    return conjugate_quaternions(matrices_to_quaternions(np.asarray(turn, dtype=np.float64)))


def _wrong_frames(folder: Path) -> Results:
    """Error of both solvers on limbs of a real motion, with runs of wrong frames."""
    limbs = track_limbs(read(folder / "cmu" / "86_01.amc"))
    result: Results = {}
    for limb in ("lshank", "lhand", "chest"):
        turns = limbs.turns[limb][: 3 * 1200 : 3]
        for share in SHARES:
            ours, printed, other, seconds = [], [], [], []
            for seed in range(SEEDS):
                rng = np.random.default_rng(seed)
                world, mount = draw_quaternion(rng), draw_quaternion(rng)
                measured = _noisy(
                    multiply_quaternions(multiply_quaternions(world, turns), mount), 5.0, rng
                )
                wrong = _spoilt(turns, share, rng)
                began = time.process_time()
                found = calibrate(wrong, measured, ANY)
                seconds.append(time.process_time() - began)
                ours.append(worse(found.world, found.mount, world, mount))
                printed.append(
                    worse(*calibrate_published(wrong, measured, seed=seed), world, mount)
                )
                if seed < OPENCV_SEEDS:
                    few = wrong[::OPENCV_STEP], measured[::OPENCV_STEP]
                    other.append(float(distance_deg(_by_opencv(*few), mount)))
            result[f"{limb}, {share:.0%}"] = {
                "robust": [np.median(ours), max(ours)],
                "printed": [np.median(printed), max(printed)],
                "opencv": [np.median(other), max(other)],
                "ms": 1000 * float(np.median(seconds)),
            }
    return result


def _spoilt(turns: Floats, share: float, rng: np.random.Generator) -> Floats:
    """Turns with runs of 30 frames turned by anything."""
    wrong = turns.copy()
    n_runs = len(turns) // 30
    for run in rng.choice(n_runs, round(share * n_runs), replace=False):
        part = slice(30 * run, 30 * run + 30)
        wrong[part] = multiply_quaternions(wrong[part], draw_quaternion(rng))
    return wrong


def _deviation() -> Results:
    """Expected against true error where turns about one axis prevail."""
    free = CalibrationSettings(world="any", refused_deg=np.inf)
    result: Results = {}
    for first, others in SPREADS:
        errors, expected = np.zeros(SEEDS), np.zeros(SEEDS)
        for seed in range(SEEDS):
            rng = np.random.default_rng(seed)
            turns = _wandering(600, rng, np.array([first, others, others], dtype=np.float64))
            world, mount = draw_quaternion(rng), draw_quaternion(rng)
            measured = _noisy(
                multiply_quaternions(multiply_quaternions(world, turns), mount), 5.0, rng
            )
            found = calibrate(turns, measured, free)
            errors[seed] = worse(found.world, found.mount, world, mount)
            expected[seed] = found.deviation_deg
        doubted, refused = (
            expected > limit
            for limit in (CalibrationSettings().doubted_deg, CalibrationSettings().refused_deg)
        )
        kept = errors[~refused]
        result[f"{first:g} / {others:g}"] = {
            "expected": float(np.median(expected)),
            "true": float(np.sqrt(np.mean(np.square(errors)))),
            "doubted": int((doubted & ~refused).sum()),
            "refused": int(refused.sum()),
            "kept_worst": float(kept.max()) if len(kept) else None,
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
    late = _lag_of_vicon(walk)
    at = np.arange(955.0) + _VICON_FIRST + late
    for name, (place, limb) in WORN.items():
        fused, raw = walk.fused[name], walk.raw[name]
        row: Results = {"limb": limb}
        for way, turns in (("fused", fused), ("raw", raw)):
            found = calibrate(walk.bvh[limb][WALK], turns[WALK], ANY)
            row[way] = [np.median(found.residual_deg), rms(found.residual_deg)]
        by_vicon = resample_orientations(raw, at)
        found = calibrate(walk.vicon[limb], by_vicon, ANY)
        row["vicon"] = [np.median(found.residual_deg), rms(found.residual_deg)]
        by_maker = resample_orientations(fused, at)
        row["vicon_fused"] = np.median(calibrate(walk.vicon[limb], by_maker, ANY).residual_deg)
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
        "late_frames": late,
        "same_shank_deg": same,
        "named": _named(walk),
        "placed": sum(placed[name].limb == limb for name, (_, limb) in WORN.items()),
        "least_margin": min(one.margin for one in check.limbs if one.limb != "root"),
        "false_alarms": len(check.track),
        "lag_s": check.lag.offset_s,
        "seconds": seconds,
    }


def _lag_of_vicon(walk: _Walk) -> float:
    """Frames by which the sensors' clock is ahead of Vicon's, by rates of turn."""
    tracked = [speeds_of_turn(walk.vicon[limb], 100.0) for _, limb in WORN.values()]
    measured = [speeds_of_turn(walk.raw[name], 100.0) for name in WORN]
    lag = synchronise(tracked, measured, rate_hz=100.0, most_s=15.0)
    return lag.offset_s * 100 - _VICON_FIRST


def _named(walk: _Walk) -> Results:
    """Seven sensors in any order on seven limbs: residuals after full calibrations."""
    own = [(name, limb) for name, (place, limb) in WORN.items() if not place.endswith("2")]
    settings = CalibrationSettings(refused_deg=np.inf)
    right, margins = 0, []
    for number in np.random.default_rng(SEED).permutation(len(own)):
        name, limb = own[number]
        measured, left = walk.raw[name][WALK], {}
        for _, other in own:
            found = calibrate(walk.bvh[other][WALK], measured, settings)
            left[other] = float(np.median(found.residual_deg))
        right += min(left, key=lambda other: left[other]) == limb
        margins.append(min(v for other, v in left.items() if other != limb) / left[limb])
    return {"right": right, "of": len(own), "least_margin": min(margins)}


def _parts(tracked: Floats, measured: Floats, found: Any, axis: Floats) -> list[float]:
    """Root mean square across and about a limb."""
    told = multiply_quaternions(
        multiply_quaternions(conjugate_quaternions(found.world), measured),
        conjugate_quaternions(found.mount),
    )
    return [rms(part) for part in swing_twist_deg(tracked, told, axis)]


def _planted(folder: Path) -> Results:
    """Errors planted into the BVH of the walk, against its sensors fused from raw."""
    walk = _read_walk(folder)
    turns = {limb: one[950:2150] for limb, one in walk.bvh.items()}
    legs = {limb: name for name, (place, limb) in WORN.items() if not place.endswith("2")}
    legs.pop("root")
    lengths = _lengths(folder)
    result: Results = {}
    for kind in ERRORS:
        tallies, by_joints = {rule: Tally() for rule in RULES}, Tally()
        for seed in range(10):
            rng = np.random.default_rng(seed)
            for limb, name in legs.items():
                wrong = plant(kind, turns, limb, walk.axes[limb], 100.0, rng)
                truth = np.asarray(distance_deg(wrong, turns[limb]) > WRONG_DEG)
                for rule, found in find_errors(wrong, walk.fused[name][950:2150], 100.0).items():
                    tallies[rule].add(found, truth)
                moved = end_moved_m(turns[limb], wrong, walk.axes[limb], lengths[limb])
                by_joints.add([(int(a), int(b)) for a, b in find_runs(moved > 0.1)], truth)
        result[kind] = {rule: tally.scores() for rule, tally in tallies.items()}
        result[kind]["joints"] = by_joints.scores()
    return result


def _lengths(folder: Path) -> dict[str, float]:
    """Lengths of the legs' limbs, metres."""
    joints = read(folder / "S02-Trial-Walk-1.bvh").generic_positions()
    ends = {"thigh": ("hip", "knee"), "shank": ("knee", "ankle"), "foot": ("ankle", "toes")}
    result = {}
    for side in "lr":
        for limb, pair in ends.items():
            a, b = (joints[:, GENERIC_JOINTS.index(side + one)] for one in pair)
            result[side + limb] = float(np.nanmedian(np.linalg.norm(a - b, axis=1)))
    return result


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
            row[way] = rms(error[moving & known])
            if way == "6-D offline":
                row |= _beside_truth(truth, told, moving, sensor.rate_hz)
        result[path.stem[:2]] = row
    return result


def _beside_truth(
    truth: Floats, told: Floats, moving: NDArray[np.bool_], rate_hz: float
) -> dict[str, float]:
    """The filter's error with heading, mount and drift of the heading found as a check does."""
    found, _, drift = calibrate_drifting(truth, told, rate_hz)
    whole = calibrate(truth, told)
    return {
        "heading fitted": rms(whole.residual_deg[moving]),
        "drift taken out": rms(found.residual_deg[moving]),
        "drift_deg": float(np.degrees(np.ptp(drift))),
    }


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
    return {"rows": rows, "shifts": _shifts(speeds)}


def _shifts(speeds: Floats) -> list[float]:
    """Median and largest error in samples of random shifts of half a minute of rates."""
    errors = []
    for seed in range(SEEDS):
        rng = np.random.default_rng(seed)
        shift, n = rng.uniform(-200, 200), 3000
        first = int(rng.integers(500, len(speeds) - int(1.2 * n) - 500))
        at = first + (np.arange(n) - shift) * 1.2
        sensor = np.interp(at, np.arange(len(speeds)), speeds) + rng.normal(size=n) * 0.05
        tracked = np.interp(first + np.arange(n) * 1.2, np.arange(len(speeds)), speeds)
        found = synchronise([tracked], [sensor], rate_hz=100.0)
        errors.append(abs(found.offset_s * 100 - shift))
    return [float(np.median(errors)), max(errors)]
