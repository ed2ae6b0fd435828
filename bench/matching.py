"""How long does a distance function take, beside a general DTW from the same features?

60 columns against 100 000 frames (55 minutes at 30 Hz) of 40 relations, steps (1, 1),
(1, 2), (2, 1), the last counted twice. The reference is `librosa.sequence.dtw` with its
cost matrix, which is one product of matrices of 0/1 features.
"""

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from motionary.matching import Pattern, distance_function
from motionary.packing import PackedFeatures, count, full_mask, pack, unpack
from timing import compare, print_ratios

N_COLUMNS, N_FRAMES, N_RELATIONS = 60, 100_000, 40
STEPS, TIMES = np.array([[1, 1], [1, 2], [2, 1]]), np.array([1, 1, 2])
WANTED = {"NumPy": 12, "compiled": 60}
REFERENCE = "librosa.sequence.dtw"


def main() -> None:
    packed, source = words_to_search()
    print(f"{N_COLUMNS} columns, {N_FRAMES} frames of {N_RELATIONS} relations, {source}")
    pattern = pattern_from(packed)
    reference = as_librosa(pattern, packed)
    ways: dict[str, Callable[[], object]] = {
        REFERENCE: reference,
        "NumPy": lambda: distance_function(pattern, packed, engine="numpy"),
        "compiled": lambda: distance_function(pattern, packed, engine="compiled"),
    }
    check_equal(reference(), distance_function(pattern, packed, engine="numpy"))
    medians = compare(ways, runs=11)
    print_ratios(medians, reference=REFERENCE)
    for name, wanted in WANTED.items():
        print(f"  {name}: {medians[REFERENCE] / medians[name]:.1f} x, wanted at least {wanted} x")
    print("patterns and documents of other kinds:")
    print_ratios(compare(other_kinds(pattern, packed), runs=9), reference="plain, NumPy")


def words_to_search() -> tuple[PackedFeatures, str]:
    """Words of recordings, one after the other again and again; synthetic without them."""
    folder = Path(os.environ.get("MOTIONARY_DATA", "")) / "hdm05"
    if "MOTIONARY_DATA" in os.environ and folder.is_dir():
        from motionary.retrieval.index import collect

        packed = np.concatenate([s.packed for s in collect(folder).sequences])
        return np.resize(packed, (N_FRAMES, 1)), "from HDM05 clips"
    rng = np.random.default_rng(1)
    flips = rng.random((N_FRAMES, N_RELATIONS)) < 0.02
    return pack(np.cumsum(flips, axis=0) % 2), "synthetic"


def pattern_from(packed: PackedFeatures) -> Pattern:
    """A stretch of the words with a fifth of the cells free and weights as learned ones."""
    rng = np.random.default_rng(2)
    fixed = pack(rng.random((N_COLUMNS, N_RELATIONS)) < 0.8)
    return Pattern(packed[5000 : 5000 + N_COLUMNS], fixed, rng.uniform(0.75, 1.5, N_COLUMNS))


def as_librosa(pattern: Pattern, packed: PackedFeatures) -> Callable[[], NDArray[np.float64]]:
    """The same with librosa; what is timed is the product and the DTW."""
    import librosa

    features = unpack(packed, N_RELATIONS).astype(np.float32).T
    values, fixed = unpack(pattern.values, N_RELATIONS), unpack(pattern.fixed, N_RELATIONS)
    unit = (pattern.column_weights / np.maximum(count(pattern.fixed), 1))[:, np.newaxis]
    if_set = (np.where(values, -unit, unit) * fixed).astype(np.float32)
    always = (values * unit).sum(axis=1, keepdims=True).astype(np.float32)

    def distance() -> NDArray[np.float64]:
        cost = if_set @ features
        cost += always
        total = librosa.sequence.dtw(
            C=cost, subseq=True, step_sizes_sigma=STEPS, weights_mul=TIMES, backtrack=False
        )
        last: NDArray[np.float64] = total[-1] / N_COLUMNS
        return last

    return distance


def check_equal(reference: NDArray[np.float64], ours: NDArray[np.float32]) -> None:
    """Stop unless both are finite in the same frames, and equal there to 1e-5."""
    finite = np.isfinite(reference)
    if not (finite == np.isfinite(ours)).all():
        raise SystemExit("the distance functions are finite in different frames")
    worst = float(np.abs(reference[finite] - ours[finite]).max())
    print(f"largest difference to {REFERENCE}: {worst:.1e}")
    if worst > 1e-5:
        raise SystemExit("the distance functions differ by more than 1e-5")


def other_kinds(pattern: Pattern, packed: PackedFeatures) -> dict[str, Callable[[], object]]:
    """Unknown relations, and entries with weights."""
    rng = np.random.default_rng(3)
    known = full_mask(N_FRAMES, N_RELATIONS) & ~pack(rng.random((N_FRAMES, N_RELATIONS)) < 0.05)
    entries = rng.exponential(size=(N_COLUMNS, N_RELATIONS))
    weighed = Pattern(pattern.values, pattern.fixed, pattern.weights, entries)
    return {
        "plain, NumPy": lambda: distance_function(pattern, packed, engine="numpy"),
        "unknown relations, NumPy": lambda: distance_function(
            pattern, packed, known, engine="numpy"
        ),
        "unknown relations, compiled": lambda: distance_function(
            pattern, packed, known, engine="compiled"
        ),
        "entry weights, NumPy": lambda: distance_function(weighed, packed),
        "entry weights, unknown relations, NumPy": lambda: distance_function(
            weighed, packed, known
        ),
    }
