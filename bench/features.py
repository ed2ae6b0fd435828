"""Time of the 40 features of 24 minutes, and of 10 000 short clips.

24 minutes at 120 Hz, one thread, from joint positions in memory to sequences at 30 Hz. The
authors' programs took 137 s (Müller and Röder 2006, on a Pentium 4 of 3.6 GHz). Where the
time goes: bringing positions to the generic joints, features at 120 Hz, the rest.
"""

import os
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from motionary.features import (
    FULL_BODY,
    compute_batch,
    compute_features,
    feature_matrix,
    read_features,
)
from motionary.io import name_recordings, read
from motionary.motion import GENERIC_JOINTS, Floats, Motion
from motionary.samples import SYNTHETIC_CLASSES, synthetic_stream
from motionary.skeletons import named_mapping
from timing import compare, print_ratios

RATE_HZ, MINUTES = 120, 24
N_FRAMES = MINUTES * 60 * RATE_HZ
AUTHORS_S, WANTED_S = 137.0, 1.4
N_CLIPS, WANTED_CLIPS_S = 10_000, 40.0


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
    for name, featured in (("arrays", from_arrays), ("a batch on disk", from_file)):
        print_batches(name, featured)


def print_batches(name: str, featured: Callable[[list[Floats], int], int]) -> None:
    """Wall and processor time of clips as HumanML3D has them, in one process and two."""
    motions = [synthetic_stream(["walk", one], seed=0, rate_hz=20)[0] for one in SYNTHETIC_CLASSES]
    order = named_mapping("humanml3d")
    joints = {name: joint for joint, source in order.weights.items() for name in source}
    columns = [GENERIC_JOINTS.index(joints.get(name, "belly")) for name in order.order]
    made = [np.resize(one.generic_positions()[:, columns], (196, 22, 3)) for one in motions]
    for jobs in (1, 2):
        n_clips = N_CLIPS // 10 * jobs
        clips = (made * (1 + n_clips // len(made)))[:n_clips]
        before, start = os.times(), time.perf_counter()
        n_frames = featured(clips, jobs)
        wall, after = time.perf_counter() - start, os.times()
        used = sum(after[:4]) - sum(before[:4])
        print(
            f"  {n_clips} clips from {name}, {n_frames} frames, {jobs} processes: "
            f"{1e3 * wall / n_clips:.1f} ms each, {1e3 * used / n_clips:.1f} ms of one core; "
            f"{N_CLIPS} take {wall * N_CLIPS / n_clips:.0f} s (wanted with two cores: "
            f"{WANTED_CLIPS_S:.0f} s); load {os.getloadavg()[0]:.1f}"
        )


def from_arrays(clips: list[Floats], jobs: int) -> int:
    """Number of frames of features of clips in memory."""
    batch = compute_batch(clips, rate_hz=20, skeleton="humanml3d", jobs=jobs)
    return sum(map(len, batch))


def from_file(clips: list[Floats], jobs: int) -> int:
    """The same of clips in one file, axes, unit and sides found for each."""
    with tempfile.TemporaryDirectory() as folder:
        np.save(Path(folder) / "clips.npy", np.array(clips, dtype=np.float32))
        files = name_recordings(folder).items()
        return sum(map(len, read_features(files, jobs=jobs)))


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
