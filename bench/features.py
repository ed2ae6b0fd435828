"""Time of the 40 features of 24 minutes.

24 minutes at 120 Hz, one thread, from joint positions in memory to sequences at 30 Hz. The
authors' programs took 137 s (Müller and Röder 2006, on a Pentium 4 of 3.6 GHz). Where the
time goes: bringing positions to the generic joints, features at 120 Hz, the rest.
"""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np

from motionary.features import FULL_BODY, compute_features, feature_matrix
from motionary.io import read
from motionary.motion import Motion
from motionary.samples import SYNTHETIC_CLASSES, synthetic_stream
from timing import compare, print_ratios

RATE_HZ, MINUTES = 120, 24
N_FRAMES = MINUTES * 60 * RATE_HZ
AUTHORS_S, WANTED_S = 137.0, 1.4


def main() -> None:
    motion, source = long_motion()
    generic = motion.generic_positions()
    print(f"{MINUTES} minutes at {RATE_HZ} Hz, {N_FRAMES} frames, {source}")
    medians = compare(
        {
            "compute_features": lambda: compute_features(motion),
            "  generic joints": motion.generic_positions,
            "  features": lambda: feature_matrix(generic, FULL_BODY),
        },
        runs=9,
    )
    whole = medians.pop("compute_features")
    reference = f"authors' programs ({AUTHORS_S:.0f} s)"
    print_ratios({"compute_features": whole}, reference=reference, seconds=AUTHORS_S)
    for part, seconds in medians.items():
        print(f"  {part:<16}  {seconds * 1e3:12.3f} ms  {100 * seconds / whole:7.0f} % of it")
    print(f"  {N_FRAMES / whole:,.0f} frames a second; wanted at most {WANTED_S} s")


def long_motion() -> tuple[Motion, str]:
    """A recording again and again for 24 minutes; a synthetic stream without recordings."""
    path = Path(os.environ.get("MOTIONARY_DATA", "")) / "cmu" / "86_01.amc"
    if "MOTIONARY_DATA" in os.environ and path.is_file():
        motion, source = read(path), "CMU 86_01 again and again"
    else:
        motion, _ = synthetic_stream(SYNTHETIC_CLASSES, seed=0, rate_hz=RATE_HZ)
        source = "a synthetic stream again and again"
    frames = np.arange(N_FRAMES) % motion.n_frames
    return replace(motion, positions=motion.positions[frames], rotations=None), source
