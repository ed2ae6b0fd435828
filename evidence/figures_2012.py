"""Table 7.1 and figures 7.12 to 7.14 of Baak (2012), as far as there are data."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evidence.common.drawing import (
    BLACK,
    BLUE,
    ORANGE,
    VERMILLION,
    Panel,
    draw_panels,
    house_style,
    new_figure,
)
from evidence.common.recordings import CMU, HDM05, Recordings, Results
from evidence.common.running import compute_all
from evidence.common.sensors import (
    DEFAULT,
    ERRORS,
    RATE_HZ,
    WRONG_DEG,
    Tally,
    describe_takes,
    draw_quaternion,
    end_moved_m,
    find_errors,
    find_takes,
    plant,
    sense_limbs,
)
from motionary.errors import InvalidInput
from motionary.inertial import (
    CalibrationSettings,
    calibrate,
    calibrate_published,
    orient,
    track_limbs,
)
from motionary.inertial.limbs import IDEAL, simulate_sensor
from motionary.inertial.orientations import (
    SENSORS_FROM_TRACKING,
    distance_deg,
    resample_orientations,
)
from motionary.io import read
from motionary.io.sensors import read_sensors
from motionary.motion import GENERIC_JOINTS
from motionary.recording import find_runs
from motionary.rotations import multiply_quaternions, rotate, rotation_vectors_to_quaternions, slerp

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TITLE = "Tracking errors in tables and pictures, beside the thesis"
SPLIT = "nothing is learned; simulated sensors on people on whom no limit was chosen"
SEED = 0
DATA = (
    (
        f"sensors simulated on {CMU}; {HDM05}; beside them a walk with real ones (NEURA, GPL-3)",
        lambda recordings: describe_takes(recordings.folder, development=(False,)),
    ),
)

Floats = NDArray[np.float64]

GROUPS = {"legs": ("lshank", "rshank"), "hands": ("lhand", "rhand")}
#: From a limb's joint to where the next one, or the fingertips, would be, metres.
LENGTHS_M = {"legs": 0.42, "hands": 0.19}
#: What joints must be off by to be seen.
SEEN_M = 0.1
TRUTHS = ("turned", "seen")
THRESHOLDS = tuple(range(5, 125, 5))
#: The thesis' limit, and its precision and recall by two annotators.
LIMIT = 45
PUBLISHED = {"legs": ((0.65, 0.91), (0.64, 0.96)), "hands": ((0.36, 0.78), (0.45, 0.69))}
#: The walk's frames, the sensor on its left shank, and when that leg is taken for the other, s.
WALK = slice(1119, 2074)
SENSOR = "00B40C44"
WRONG_S = (4.6, 6.6)
SLIDING_S = 0.3
#: Legs of the walk with their sensors, and the joint near which each sits.
WORN = {
    "lthigh": ("00B40C45", "lknee"), "rthigh": ("00B40C3C", "rknee"),
    "lshank": ("00B40C44", "lankle"), "rshank": ("00B40C47", "rankle"),
    "lfoot": ("00B40C55", "lankle"), "rfoot": ("00B40C48", "rankle"),
}  # fmt: skip
DATA_KINDS = ("orientation", "rate of turn", "acceleration")
ANY = CalibrationSettings(world="any")


def measure(recordings: Recordings) -> Results:
    """All numbers of the table and of the pictures."""
    folder = recordings.folder
    walk = _read_walk(folder / "sensors" / "neura")
    return {
        "limits": _limits(folder),
        "example": _example(walk),
        "kinds": _kinds(walk),
        "offsets": _offsets(),
    }


def _limits(folder: Path) -> Results:
    """Precision and recall over limits, by both truths (table 7.1, figure 7.12)."""
    parts = compute_all(_count_take, find_takes(folder, development=False))
    result: Results = {}
    for group in GROUPS:
        result[group] = {"minutes": sum(part[group]["minutes"] for part in parts)}
        for truth in TRUTHS:
            counts = sum(part[group][truth] for part in parts)
            ours = Tally()
            ours.counts += sum(part[group]["ours", truth] for part in parts)
            result[group][truth] = {
                "curve": [_frame_scores(row) for row in counts],
                "ours": ours.scores(),
            }
    return result


def _frame_scores(counts: Floats) -> list[float]:
    both, told, true = counts
    p, r = both / max(told, 1), both / max(true, 1)
    return [p, r, 2 * p * r / max(p + r, 1e-12)]


def _count_take(path: Path) -> dict[str, Any]:
    result: dict[str, Any] = {
        group: {"minutes": 0.0}
        | {truth: np.zeros((len(THRESHOLDS), 3)) for truth in TRUTHS}
        | {("ours", truth): np.zeros(7) for truth in TRUTHS}
        for group in GROUPS
    }
    chosen = {limb: group for group, limbs in GROUPS.items() for limb in limbs}
    for limb in sense_limbs(path, seed=SEED, limbs=tuple(chosen)):
        if len(limb.jumps):
            continue
        of, own = result[chosen[limb.name]], limb.tracked[limb.name]
        try:
            # As in the thesis from a take that is tracked well; here the same one.
            world, mount = calibrate_published(own, limb.measured)
        except InvalidInput:
            continue
        of["minutes"] += len(own) / RATE_HZ / 60
        for kind in ERRORS:
            wrong = plant(kind, limb.tracked, limb.name, limb.axis, RATE_HZ, limb.rng)
            told = multiply_quaternions(multiply_quaternions(world, wrong), mount)
            away = distance_deg(limb.measured, told)
            length = LENGTHS_M[chosen[limb.name]]
            truths = {
                "turned": np.asarray(distance_deg(wrong, own) > WRONG_DEG),
                "seen": end_moved_m(own, wrong, limb.axis, length) > SEEN_M,
            }
            found = find_errors(wrong, limb.measured, RATE_HZ, (DEFAULT,))[DEFAULT]
            for name, truth in truths.items():
                for row, limit in enumerate(THRESHOLDS):
                    marked = away > limit
                    of[name][row] += (marked & truth).sum(), marked.sum(), truth.sum()
                tally = Tally()
                tally.add(found, truth)
                of["ours", name] += tally.counts
    return result


class _Walk(NamedTuple):
    """The walk's limbs, their joints (m, z up), and what the sensors read."""

    turns: dict[str, Floats]
    axes: dict[str, Floats]
    joints: dict[str, Floats]
    fused: dict[str, Floats]
    gyr: dict[str, Floats]
    acc: dict[str, Floats]


def _read_walk(folder: Path) -> _Walk:
    motion = read(folder / "S02-Trial-Walk-1.bvh").cut(WALK.start, WALK.stop)
    limbs, places = track_limbs(motion), motion.generic_positions()
    upright = np.tile(SENSORS_FROM_TRACKING, (len(places), 1))
    sensors = {one.name: one for one in read_sensors(folder / "imu")}
    gyr, acc = {}, {}
    for name, _ in WORN.values():
        one = sensors[name]
        assert one.gyr is not None
        assert one.acc is not None
        gyr[name], acc[name] = one.gyr[WALK], one.acc[WALK]
    return _Walk(
        limbs.turns,
        limbs.axes,
        {
            joint: rotate(upright, places[:, GENERIC_JOINTS.index(joint)])
            for _, joint in WORN.values()
        },
        {name: orient(sensors[name])[WALK] for name, _ in WORN.values()},
        gyr,
        acc,
    )


def _as_measured(
    walk: _Walk, limb: str, wrong: Floats, places: Floats
) -> tuple[Floats, Floats, Floats]:
    """Angle to the sensor, degrees, and rates and forces it would read if the tracking were right.

    Calibrated on the walk as it is; smoothed below 15 Hz, as is usual before derivatives.
    """
    name, _ = WORN[limb]
    fit = calibrate(walk.turns[limb], walk.fused[name])
    in_world = multiply_quaternions(fit.world, wrong)
    there = rotate(np.broadcast_to(fit.world, in_world.shape), places)
    smooth = replace(IDEAL, lowpass_hz=15.0)
    told = simulate_sensor(in_world, there, rate_hz=100.0, mount=fit.mount, settings=smooth)
    return distance_deg(walk.fused[name], fit.predict(wrong)), told.gyr, told.acc


def _example(walk: _Walk) -> Results:
    """Rates and accelerations of a leg that is taken for the other for two seconds (7.13)."""
    times = np.arange(len(walk.turns["lshank"])) / 100
    # A tracker slides into an error and out of it.
    edges = np.minimum(times - WRONG_S[0], WRONG_S[1] - times) / SLIDING_S
    share = np.clip(edges, 0, 1)[:, None]
    wrong = slerp(walk.turns["lshank"], walk.turns["rshank"], share)
    places = (1 - share) * walk.joints["lankle"] + share * walk.joints["rankle"]
    angle, rates, forces = _as_measured(walk, "lshank", wrong, places)
    return {
        "angle_deg": angle[::5],
        "rates": {"sensor": np.degrees(walk.gyr[SENSOR][::5]), "tracked": np.degrees(rates[::5])},
        "forces": {"sensor": walk.acc[SENSOR][::5], "tracked": forces[::5]},
    }


def _kinds(walk: _Walk) -> Results:
    """F per frame at the best limit of each kind of data, over planted errors of all legs."""
    values: dict[str, list[Floats]] = {kind: [] for kind in DATA_KINDS}
    truths = []
    for seed in range(3):
        rng = np.random.default_rng([SEED, seed])
        for kind in ERRORS:
            for limb, (name, joint) in WORN.items():
                wrong = plant(kind, walk.turns, limb, walk.axes[limb], 100.0, rng)
                truths.append(distance_deg(wrong, walk.turns[limb]) > WRONG_DEG)
                angle, rates, forces = _as_measured(walk, limb, wrong, walk.joints[joint])
                values["orientation"].append(angle)
                values["rate of turn"].append(np.linalg.norm(rates - walk.gyr[name], axis=1))
                values["acceleration"].append(np.linalg.norm(forces - walk.acc[name], axis=1))
    truth = np.concatenate(truths)
    return {kind: _best(np.concatenate(of), truth) for kind, of in values.items()}


def _best(values: Floats, truth: NDArray[np.bool_]) -> Results:
    """The limit with the largest F per frame; how many runs it cuts the true ones into."""
    limits = np.quantile(values, np.linspace(0, 0.999, 200))
    scores = [
        _frame_scores(np.array([(values > x)[truth].sum(), (values > x).sum(), truth.sum()]))
        for x in limits
    ]
    best = int(np.argmax([score[2] for score in scores]))
    marked = values > limits[best]
    return {
        "limit": limits[best],
        "scores": scores[best],
        "runs": len(find_runs(marked)),
        "true_runs": len(find_runs(truth)),
    }


def _offsets() -> Results:
    """Distances with right and with wrong offsets, on a synthetic sequence (7.14)."""
    rng = np.random.default_rng(SEED)
    keys = rotation_vectors_to_quaternions(rng.normal(size=(12, 3)) * 0.8)
    measured = resample_orientations(keys, np.linspace(0, 11, 640))
    angle = np.zeros(640)
    angle[50:201] = np.linspace(0, 70, 151)
    angle[400:601] = 110 * np.sin(np.linspace(0, np.pi, 201))
    axes = np.where(np.arange(640)[:, None] < 300, [0.0, 0.6, 0.8], [0.8, -0.6, 0.0])
    turn = rotation_vectors_to_quaternions(np.radians(angle)[:, None] * axes)
    tracked = multiply_quaternions(measured, turn)
    one, other = (
        rotation_vectors_to_quaternions(np.radians(size) * draw_quaternion(rng)[1:])
        for size in (90, 130)
    )
    world_only = multiply_quaternions(one, tracked)
    curves = {
        "both offsets right": distance_deg(measured, tracked),
        "one offset wrong": distance_deg(measured, world_only),
        "both offsets wrong": distance_deg(measured, multiply_quaternions(world_only, other)),
    }
    seen = multiply_quaternions(multiply_quaternions(one, measured), other)
    curves["both offsets unknown, calibrated"] = calibrate(tracked, seen, ANY).residual_deg
    right, wrong = angle == 0, angle > WRONG_DEG
    return {
        name: {
            "curve": curve[::4],
            "level": float(np.median(curve[right])),
            "spread": float(np.ptp(curve[right])),
            "at_200": float(abs(curve[200] - np.median(curve[right]))),
            "hidden": float((curve[wrong] < curve[right].max()).mean()),
        }
        for name, curve in curves.items()
    }


def draw(results: Results) -> "dict[str, Figure]":
    """Figures 7.12 to 7.14."""
    return {
        "figures_2012_limits": _draw_limits(results["limits"]),
        "figures_2012_example": _draw_example(results["example"]),
        "figures_2012_offsets": _draw_offsets(results["offsets"]),
    }


def _draw_limits(limits: Results) -> "Figure":
    names = {"turned": "turned by more than 20°", "seen": "joints off by more than 100 mm"}
    panels = [
        Panel(
            f"{group}: {measure_}",
            {
                names[truth]: (THRESHOLDS, [row[k] for row in limits[group][truth]["curve"]])
                for truth in TRUTHS
            },
            "limit (degrees)",
            measure_ if group == "legs" else "",
            (0, 1.02),
        )
        for group in GROUPS
        for k, measure_ in enumerate(("precision", "recall", "F"))
    ]

    def mark(axes: Any, number: int) -> None:
        axes.axvline(LIMIT, color=BLACK, lw=0.6, alpha=0.6)

    return draw_panels(panels, columns=3, decorate=mark)


@house_style()
def _draw_example(example: Results) -> "Figure":
    figure, axes = new_figure(7, 1, (7.2, 6.2), sharex=True)
    times = np.arange(len(example["angle_deg"])) * 0.05
    names = [f"{one} ({unit})" for one, unit in (("rate", "°/s"), ("force", "m/s²"))]
    for row in range(7):
        ax = axes[row]
        ax.axvspan(*WRONG_S, color=ORANGE, alpha=0.2, lw=0)
        if row == 6:
            ax.plot(times, example["angle_deg"], color=BLACK, lw=1)
            ax.axhline(LIMIT, color=BLACK, lw=0.5, ls=":")
            ax.set_ylabel("angle (°)")
            continue
        of = example["rates" if row < 3 else "forces"]
        for who, colour in (("tracked", BLACK), ("sensor", VERMILLION)):
            ax.plot(times, np.array(of[who])[:, row % 3], color=colour, lw=0.8, label=who)
        ax.set_ylabel(f"{'xyz'[row % 3]}\n{names[row // 3]}" if row % 3 == 1 else "xyz"[row % 3])
    axes[0].legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=2, frameon=False)
    figure.align_ylabels(axes)
    axes[-1].set_xlabel("seconds")
    return figure


@house_style()
def _draw_offsets(offsets: Results) -> "Figure":
    figure, axes = new_figure(len(offsets), 1, (7.2, 5.0), sharex=True, sharey=True)
    frames = np.arange(160) * 4
    for ax, (name, one) in zip(axes, offsets.items(), strict=True):
        for part in ((50, 200), (400, 600)):
            ax.axvspan(*part, color=ORANGE, alpha=0.2, lw=0)
        ax.plot(frames, one["curve"], color=BLUE, lw=1.2)
        ax.set_title(name)
        ax.set_ylabel("degrees")
    axes[-1].set_xlabel("frame")
    return figure
