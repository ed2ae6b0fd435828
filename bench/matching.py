"""Times of a distance function, beside a general DTW from the same features.

60 columns against 100 000 frames (55 minutes at 30 Hz) of 40 features, steps (1, 1),
(1, 2), (2, 1), the last counted twice. The reference is `librosa.sequence.dtw` with its
cost matrix, which is one product of matrices of 0/1 features.
"""

import os
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from motionary.matching import Pattern, distance_function, score_patterns
from motionary.models.library import load_everyday
from motionary.packing import PackedFeatures, count, full_mask, pack, unpack
from timing import compare, print_ratios

N_COLUMNS, N_FRAMES, N_FEATURES = 60, 100_000, 40
STEPS, TIMES = np.array([[1, 1], [1, 2], [2, 1]]), np.array([1, 1, 2])
WANTED = {"NumPy": 12, "compiled": 60}
ENGINES = {"NumPy": "numpy", "compiled": "compiled"}
MINUTES = 74
REFERENCE = "librosa.sequence.dtw"


def main() -> None:
    packed, source = features_to_search()
    print(f"{N_COLUMNS} columns, {N_FRAMES} frames of {N_FEATURES} features, {source}")
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
    score_all_prototypes(packed)
    print("patterns and sequences of other kinds:")
    for kind, call in other_kinds(pattern, packed).items():
        twins = {name: partial(call, engine=engine) for name, engine in ENGINES.items()}
        check_bits(*(twin() for twin in twins.values()))
        print(kind)
        print_ratios(compare(twins, runs=9), reference="NumPy")


def score_all_prototypes(packed: PackedFeatures) -> None:
    """Seconds of scoring all prototypes of the library that ships in 74 minutes."""
    library = load_everyday()
    patterns = [pattern for one in library for _, pattern in one.patterns]
    ratios = [ratio for one in library for ratio in one.ratios]
    frames = np.resize(packed, (MINUTES * 1800, 1))
    ways = {
        name: partial(score_patterns, patterns, ratios, frames, engine=engine)
        for name, engine in ENGINES.items()
    }
    print(f"scores of {len(patterns)} prototypes in {MINUTES} minutes, wanted within 5 s")
    print_ratios(compare(ways, runs=3), reference="NumPy")


def features_to_search() -> tuple[PackedFeatures, str]:
    """Packed features of recordings, repeated; synthetic ones without recordings."""
    folder = Path(os.environ.get("MOTIONARY_DATA", "")) / "hdm05"
    if "MOTIONARY_DATA" in os.environ and folder.is_dir():
        from motionary.retrieval.index import collect

        packed = np.concatenate([s.packed for s in collect(folder).sequences])
        return np.resize(packed, (N_FRAMES, 1)), "from HDM05 clips"
    rng = np.random.default_rng(1)
    flips = rng.random((N_FRAMES, N_FEATURES)) < 0.02
    return pack(np.cumsum(flips, axis=0) % 2), "synthetic"


def pattern_from(packed: PackedFeatures) -> Pattern:
    """A segment of the features with a fifth of the cells free and weights as learned ones."""
    rng = np.random.default_rng(2)
    fixed = pack(rng.random((N_COLUMNS, N_FEATURES)) < 0.8)
    return Pattern(packed[5000 : 5000 + N_COLUMNS], fixed, rng.uniform(0.75, 1.5, N_COLUMNS))


def as_librosa(pattern: Pattern, packed: PackedFeatures) -> Callable[[], NDArray[np.float64]]:
    """The same with librosa; what is timed is the product and the DTW."""
    import librosa

    features = unpack(packed, N_FEATURES).astype(np.float32).T
    values, fixed = unpack(pattern.values, N_FEATURES), unpack(pattern.fixed, N_FEATURES)
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


def check_bits(ours: NDArray[np.float32], twin: NDArray[np.float32]) -> None:
    """Stop unless the twins give the same bits."""
    if ours.tobytes() != twin.tobytes():
        raise SystemExit("NumPy and the compiled twin differ")


def other_kinds(
    pattern: Pattern, packed: PackedFeatures
) -> dict[str, Callable[..., NDArray[np.float32]]]:
    """Unknown features, entries with weights (the default of a search), several integers."""
    rng = np.random.default_rng(3)
    known = full_mask(N_FRAMES, N_FEATURES) & ~pack(rng.random((N_FRAMES, N_FEATURES)) < 0.05)
    entries = rng.exponential(size=(N_COLUMNS, N_FEATURES))
    weighed = Pattern(pattern.values, pattern.fixed, pattern.weights, entries)
    two = Pattern(np.tile(pattern.values, 2), np.tile(pattern.fixed, 2), pattern.weights)
    return {
        "unknown features": partial(distance_function, pattern, packed, known),
        "entry weights": partial(distance_function, weighed, packed),
        "entry weights, unknown features": partial(distance_function, weighed, packed, known),
        "two integers a frame": partial(distance_function, two, np.tile(packed, 2)),
    }


if __name__ == "__main__":
    main()
