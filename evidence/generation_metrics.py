"""Features of dance generation, as published and corrected.

FID_g and Dist_g of generated dance rest on 32 fractions of frames by a code that is widespread
and depends on the rate; `motionary.generation_metrics` computes them as published, and
corrected.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evidence.common.drawing import BLUE, RULE, VERMILLION, house_style
from evidence.common.recordings import Recordings, Results
from motionary.features import FULL_BODY
from motionary.generation_metrics import (
    PUBLISHED_COLUMNS,
    Mode,
    diversity,
    frechet_distance,
    motion_features,
    published_features,
)
from motionary.motion import Motion

TITLE = "The features of dance generation, as published and corrected"
SPLIT = "nothing is learned; motions of three actors stand for the real set"
SEED = 0
DATA = ("clips", ("published features of three excerpts of {cmu} and one of HDM05", (4, 0.5)))

Floats = NDArray[np.float64]

MODES: tuple[Mode, ...] = ("published", "corrected")
RATES = (120, 60, 40, 30, 20)
GOLDEN = ("86_01_kick", "01_01_jump", "49_18_dance", "bd_throw")
#: Who stands for the real motions, and who for the generated ones.
REAL, OTHERS = ("bd", "bk", "dg"), ("mm", "tr")


def measure(recordings: Recordings) -> Results:
    """Golden motions, the same motions at several rates, FID and diversity of both modes."""
    motions = [recordings.motion(clip.name) for clip in recordings.clips]
    features = {
        mode: {rate: np.array([_at_rate(m, rate, mode) for m in motions]) for rate in RATES}
        for mode in MODES
    }
    real = np.array([clip.actor in REAL for clip in recordings.clips])
    return {
        "golden": {name: _golden(recordings, name) for name in GOLDEN},
        "motions": len(motions),
        "real": int(real.sum()),
        "means": {
            mode: {str(rate): values.mean(axis=0) for rate, values in by_rate.items()}
            for mode, by_rate in features.items()
        },
        "change": {
            mode: {str(rate): _change(by_rate[60], by_rate[rate]) for rate in RATES if rate != 60}
            for mode, by_rate in features.items()
        },
        "sets": {
            mode: {str(rate): _sets(mode, by_rate, rate, real) for rate in RATES}
            for mode, by_rate in features.items()
        },
        # Published columns that no real motion varies.
        "constant": int((features["published"][60][real].std(axis=0) < 1e-9).sum()),
        "dearest": {
            mode: _highest_cost(mode, by_rate[60], real) for mode, by_rate in features.items()
        },
    }


def _at_rate(motion: Motion, rate: int, mode: Mode) -> Floats:
    """Features of a motion of which only every so many frames are kept."""
    every = round(motion.rate_hz / rate)
    recording = replace(motion.recording, rate_hz=float(rate))
    thinned = motion.positions[::every]
    recording = replace(motion.recording, rate_hz=float(rate))
    return motion_features(
        replace(motion, positions=thinned, rotations=None, events=(), recording=recording),
        mode=mode,
    )


def _change(one: Floats, other: Floats) -> dict[str, float]:
    difference = np.abs(one - other)
    return {"mean": float(difference.mean()), "column": float(difference.mean(axis=0).max()),
            "largest": float(difference.max())}  # fmt: skip


def _sets(
    mode: Mode, by_rate: Mapping[int, Floats], rate: int, real: NDArray[np.bool_]
) -> dict[str, float]:
    """The same people at another rate, other people at this rate, and diversity."""
    reference = by_rate[60][real]
    return {
        "same motions": frechet_distance(by_rate[rate][real], reference, mode=mode),
        "other people": frechet_distance(by_rate[rate][~real], reference, mode=mode),
        "diversity": diversity(by_rate[rate][real], reference, mode=mode),
    }


def _highest_cost(mode: Mode, values: Floats, real: NDArray[np.bool_]) -> dict[str, Any]:
    """The feature without which other people are nearest, and their distance then."""
    names = PUBLISHED_COLUMNS if mode == "published" else FULL_BODY.names
    left = [
        frechet_distance(kept[~real], kept[real], mode=mode)
        for kept in (np.delete(values, i, axis=1) for i in range(len(names)))
    ]
    return {"relation": names[int(np.argmin(left))], "without": min(left)}


def _golden(recordings: Recordings, name: str) -> dict[str, float]:
    """How far both modes are from the published numbers, and from themselves at half the rate."""
    with np.load(recordings.golden_path("generation_features.npz")) as file:
        positions = file[f"{name}_60hz_positions"].astype(np.float64)
        published = {rate: file[f"{name}_{rate}hz_features"] for rate in (60, 30)}
    halved = positions[::2]
    ours = {60: published_features(positions), 30: published_features(halved)}
    right = [
        motion_features(array, rate_hz=rate) for array, rate in ((positions, 60.0), (halved, 30.0))
    ]
    known = np.isfinite(right[0])
    return {
        "frames": len(positions),
        "off": max(float(np.abs(ours[rate] - published[rate]).max()) for rate in (60, 30)),
        "published mean": float(np.abs(ours[60] - ours[30]).mean()),
        "published largest": float(np.abs(ours[60] - ours[30]).max()),
        "corrected mean": float(np.abs(right[0] - right[1])[known].mean()),
        "corrected largest": float(np.abs(right[0] - right[1])[known].max()),
    }


@house_style()
def draw(results: Results) -> dict[str, Any]:
    """Fractions at two rates."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.2, 3.5), layout="constrained")
    for axes, mode, color in zip(figure.subplots(1, 2), MODES, (VERMILLION, BLUE), strict=True):
        x, y = (np.array(results["means"][mode][rate]) for rate in ("60", "30"))
        names = PUBLISHED_COLUMNS if mode == "published" else FULL_BODY.names
        axes.plot([0, 1], [0, 1], color=RULE, linewidth=0.8, zorder=0)
        axes.scatter(x, y, s=16, color=color, linewidths=0)
        for i in np.argsort(-np.abs(x - y))[:4]:
            if abs(x[i] - y[i]) > 0.02:
                axes.annotate(names[i], (x[i], y[i]), (-4, 3), textcoords="offset points",
                              ha="right", fontsize=7)  # fmt: skip
        axes.set(title=f"{mode}: {len(x)} features", xlabel="fraction of frames at 60 Hz",
                 ylabel="fraction of frames at 30 Hz", xlim=(-0.02, 1), ylim=(-0.02, 1),
                 aspect="equal")  # fmt: skip
    return {"generation_metrics": figure}
