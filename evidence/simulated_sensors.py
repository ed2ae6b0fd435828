"""Simulated sensors on real motion: planted errors found, and false alarms (thesis, chapter 7)."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evidence.common.recordings import CMU, HDM05, Recordings, Results
from evidence.common.running import compute_all
from evidence.common.sensors import (
    DEFAULT,
    ERRORS,
    JUMP_DEG,
    RATE_HZ,
    RULES,
    WRONG_DEG,
    SensedLimb,
    Tally,
    describe_takes,
    find_errors,
    find_takes,
    plant,
    sense_limbs,
)
from motionary.errors import InvalidInput
from motionary.inertial import calibrate_drifting
from motionary.inertial.orientations import distance_deg

TITLE = "Simulated sensors on recordings"
SPLIT = (
    f"limits, and the {JUMP_DEG:.0f} degrees from which a recording's own turn is an error, were "
    "chosen on HDM05 bd, bk, dg and CMU 02, 05, 07, 16, 35, 86; reported on all others at hand"
)
SEED = 0
DATA = (
    (
        f"sensors are simulated on {CMU}; {HDM05}",
        lambda recordings: describe_takes(recordings.folder),
    ),
)

#: Groups of limbs that are told apart.
GROUPS = {
    "trunk": ("root", "chest"),
    "legs": ("lthigh", "rthigh", "lshank", "rshank", "lfoot", "rfoot"),
    "forearms": ("lforearm", "rforearm"),
    "hands": ("lhand", "rhand"),
}
#: From so many seconds on a filter may have found the bias of a gyroscope.
LONG_S = 25
#: Seeds of clean takes; errors are planted with the first.
CLEAN_SEEDS = 2


def measure(recordings: Recordings) -> Results:
    """All tables of the page."""
    folder = recordings.folder
    return {
        "development": _clean(folder, development=True),
        "report": _clean(folder, development=False),
        "errors": _planted(folder),
    }


def _clean(folder: Path, *, development: bool) -> Results:
    """What rules find in clean takes."""
    paths = find_takes(folder, development=development)
    items = [(path, SEED + seed) for path in paths for seed in range(CLEAN_SEEDS)]
    return _sum_clean(compute_all(_count_clean, items))


def _planted(folder: Path) -> Results:
    parts = compute_all(_count_planted, find_takes(folder, development=False))
    groups = [*GROUPS, "all"]
    tallies = {kind: {rule: {of: Tally() for of in groups} for rule in RULES} for kind in ERRORS}
    for counts in parts:
        for (kind, rule, group), one in counts.items():
            for of in (group, "all"):
                tallies[kind][rule][of].counts += one
    return {
        kind: {
            rule: {of: tally.scores() for of, tally in by.items() if tally.counts.any()}
            for rule, by in rules.items()
        }
        for kind, rules in tallies.items()
    }


def _sum_clean(parts: list[list[dict[str, Any]]]) -> Results:
    """False alarms of all limbs without a jump of the recording's own; jumps that were found."""
    rows = [row for part in parts for row in part]
    clean = [row for row in rows if not row["n_jumps"]]
    minutes = sum(row["minutes"] for row in clean)
    jumping = [row for row in rows if row["n_jumps"]]
    fits = np.array([row["fusing"] for row in clean])
    long = np.array([row["minutes"] * 60 >= LONG_S for row in clean])
    trunk = np.concatenate([row["trunk"] for row in clean])
    return {
        "limbs": len(clean),
        "limb_minutes": minutes,
        "alarms": {rule: sum(row["alarms"][rule] for row in clean) for rule in RULES},
        "alarms_per_10_min": {
            rule: 10 * sum(row["alarms"][rule] for row in clean) / minutes for rule in RULES
        },
        "by_group": {
            group: 10 * sum(row["alarms"][DEFAULT] for row in of) / sum(r["minutes"] for r in of)
            for group in GROUPS
            if (of := [row for row in clean if row["group"] == group])
        },
        "refused": sum(row["refused"] for row in clean),
        "jumping": {
            "limbs": len(jumping),
            "takes": len({row["take"] for row in jumping}),
            "found": {rule: sum(row["jumps_found"][rule] for row in jumping) for rule in RULES},
        },
        "fused_deg": [np.nanmedian(fits[:, 0]), np.nanmax(fits[:, 0])],
        "bias_deg_s": {
            name: [len(of), np.median(of[:, 1]), np.median(of[:, 2])]
            for name, of in (("below", fits[~long]), ("above", fits[long]))
        },
        "trunk_deg": [trunk.mean(), trunk.std()],
    }


def _count_clean(item: tuple[Path, int]) -> list[dict[str, Any]]:
    path, seed = item
    return [_judge_clean(path, limb) for limb in sense_limbs(path, seed=seed)]


def _count_planted(path: Path) -> dict[tuple[str, str, str], NDArray[np.float64]]:
    """Counts by kind of error, rule and group of limbs."""
    counts: dict[tuple[str, str, str], NDArray[np.float64]] = {}
    for limb in sense_limbs(path, seed=SEED):
        if len(limb.jumps):
            continue
        own, group = limb.tracked[limb.name], _group_of(limb.name)
        for kind in ERRORS:
            if kind == "swapped" and group == "trunk":
                continue
            wrong = plant(kind, limb.tracked, limb.name, limb.axis, RATE_HZ, limb.rng)
            truth = np.asarray(distance_deg(wrong, own) > WRONG_DEG)
            for rule, found in find_errors(wrong, limb.measured, RATE_HZ).items():
                tally = Tally()
                tally.add(found, truth)
                key = kind, rule, group
                counts[key] = counts.get(key, np.zeros(7)) + tally.counts
    return counts


def _judge_clean(path: Path, limb: SensedLimb) -> dict[str, Any]:
    """What rules find in a limb that is tracked with noise only."""
    tracked = limb.tracked[limb.name]
    found = find_errors(tracked, limb.measured, RATE_HZ)
    refused, trunk = False, np.zeros(0)
    try:
        fit = calibrate_drifting(tracked, limb.measured, RATE_HZ).calibration
        if limb.name == "chest":
            trunk = fit.residual_deg[np.isfinite(fit.residual_deg)]
    except InvalidInput:
        refused = True
    near = 0.2 * RATE_HZ
    return {
        "take": path.stem,
        "group": _group_of(limb.name),
        "minutes": len(tracked) / RATE_HZ / 60,
        "alarms": {rule: len(of) for rule, of in found.items()},
        "refused": refused,
        "n_jumps": len(limb.jumps),
        "jumps_found": {
            rule: any(
                first - near <= jump <= stop + near for first, stop in of for jump in limb.jumps
            )
            for rule, of in found.items()
        },
        "fusing": limb.fusing,
        "trunk": trunk,
    }


def _group_of(limb: str) -> str:
    return next(group for group, limbs in GROUPS.items() if limb in limbs)
