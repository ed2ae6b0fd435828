"""Time to learn a template.

The eleven training halves of HDM05 (`half_split.json`), 40 features, one thread; the
authors report 3 s for an average template in 2009, 7.5 s in 2006, on machines of their
time. Without recordings: matrices of the same sizes with runs of values like theirs.
"""

import json
import os
import statistics
from collections.abc import Callable
from pathlib import Path

import numpy as np

from motionary.features import FULL_BODY, compute_features
from motionary.io import read
from motionary.models.templates import learn_template
from timing import compare, print_ratios

RUNS = 9
AUTHORS_S = 3.0

# Number of examples and their mean length in columns, of the eleven training halves.
SIZES = {
    "depositFloorR": (16, 74),
    "squat1Reps": (26, 48),
    "throwBasketball": (7, 96),
    "elbowToKnee1RepsLelbowStart": (14, 39),
    "grabHighR": (15, 69),
    "hopBothLegs1hops": (18, 24),
    "jogLeftCircle4StepsRstart": (9, 61),
    "kickLFront1Reps": (15, 55),
    "lieDownFloor": (10, 166),
    "rotateArmsBothBackward1Reps": (8, 28),
    "sneak2StepsLStart": (8, 58),
}

Classes = dict[str, list[np.ndarray]]


def main() -> None:
    """Print the seconds of each class and the median over the classes, per engine."""
    named = os.environ.get("MOTIONARY_DATA", "")
    classes = recorded(Path(named)) if named else invented()
    print(f"learning a template, {'HDM05 training halves' if named else 'invented clips'}, ms")
    print(f"  {'class':<28} {'clips':>5} {'columns':>7} {'numpy':>8} {'compiled':>8}  beside numpy")
    medians: dict[str, list[float]] = {"numpy": [], "compiled": []}
    for name, matrices in classes.items():
        seconds = compare({engine: learner(matrices, engine) for engine in medians}, runs=RUNS)
        for engine, measured in seconds.items():
            medians[engine].append(measured)
        columns = learner(matrices, "numpy")()
        print(f"  {name:<28} {len(matrices):5} {columns:7} {beside_numpy(seconds)}")
    medians_of_all = {engine: statistics.median(values) for engine, values in medians.items()}
    print(f"  {'median of the classes':<42} {beside_numpy(medians_of_all)}")
    print_ratios(medians_of_all, reference="authors, 2009 (3 s)", seconds=AUTHORS_S)


def beside_numpy(seconds: dict[str, float]) -> str:
    times = " ".join(f"{seconds[engine] * 1e3:8.1f}" for engine in ("numpy", "compiled"))
    return f"{times}  {seconds['numpy'] / seconds['compiled']:5.1f} x numpy"


def learner(matrices: list[np.ndarray], engine: str) -> Callable[[], int]:
    """What learns the template and returns its number of columns."""

    def learn() -> int:
        template = learn_template(
            matrices, feature_names=FULL_BODY.names, feature_set=FULL_BODY.name, engine=engine
        )
        return template.n_columns

    return learn


def recorded(data: Path) -> Classes:
    """Features of the training halves."""
    golden = data.resolve().parent / "reference" / "golden"
    split = json.loads((golden / "half_split.json").read_text("utf-8"))
    paths = {path.stem: path for path in (data / "hdm05").rglob("*.amc")}
    return {
        name: [compute_features(read(paths[clip])).features for clip in halves["train"]]
        for name, halves in split.items()
    }


def invented() -> Classes:
    """Matrices of the same sizes, seeded."""
    rng = np.random.default_rng(1)
    return {name: invented_clips(rng, *size) for name, size in SIZES.items()}


def invented_clips(rng: np.random.Generator, n_clips: int, length: int) -> list[np.ndarray]:
    """One motion in runs of eight columns, each clip in its own tempo, with flaws."""
    motion = np.repeat(rng.integers(0, 2, (length // 8 + 1, len(FULL_BODY))), 8, axis=0)
    motion[:, rng.random(len(FULL_BODY)) < 0.4] = 0
    clips = []
    for _ in range(n_clips):
        tempo = rng.uniform(0.4, 1.6, int(length * rng.uniform(0.7, 1.3))).cumsum().astype(int)
        clip = motion[np.minimum(tempo, length - 1)]
        clips.append(clip ^ (rng.random(clip.shape) < 0.02))
    return clips


if __name__ == "__main__":
    main()
