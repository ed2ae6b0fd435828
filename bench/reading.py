"""Speed of reading recordings, and the memory that two hours take.

Speed: megabytes of file per second of whole `read`, with joint positions, medians of
interleaved runs, one thread; AMC beside a loop over its lines that keeps nothing but the
numbers, BVH beside pybvh (which stops at the angles), C3D beside ezc3d. Memory: two hours at
120 Hz, made from a recording again and again, each read in a process of its own; what stays
is the motion (positions, and rotations of rigs). The bound holds if the peak is a small
multiple of file and motion together, whatever is read. Checks: what the signs that something
is wrong with a recording take of a whole `read`.
"""

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from motionary.io import read, write
from motionary.io.normalise.quality import check_quality
from motionary.motion import Motion
from motionary.recording import Recording
from timing import compare

RUNS = 5
HOURS, RATE_HZ = 2, 120
N_FRAMES = HOURS * 3600 * RATE_HZ

PEAK = """
import resource, sys
from motionary.io import read
options = dict(part.split("=", 1) for part in sys.argv[2:])
motion = read(sys.argv[1], **options)
arrays = [motion.positions] + ([] if motion.rotations is None else [motion.rotations])
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
peak /= 1e6 if sys.platform == "darwin" else 1e3
print(motion.n_frames, sum(a.nbytes for a in arrays) / 1e6, peak)
"""


def main() -> None:
    folder = os.environ.get("MOTIONARY_DATA", "")
    if not folder:
        print("  skipped: MOTIONARY_DATA is not set, there are no recordings")
        return
    data = Path(folder)
    report_speed("AMC", data / "cmu" / "86_01.amc", {"line loop": loop_over_lines})
    report_speed("BVH", data / "cmu" / "01_01.bvh", {"pybvh": read_by_pybvh})
    report_speed("C3D", data / "hdm05_takes" / "HDM_mm_01-02_03_120.c3d", {"ezc3d": read_by_ezc3d})
    with tempfile.TemporaryDirectory() as place:
        report_memory(data, Path(place))


def report_speed(name: str, path: Path, others: dict[str, Callable[[Path], object]]) -> None:
    """Megabytes per second of our reader and the others."""
    ways: dict[str, Callable[[], object]] = {"motionary": lambda: read(path)}
    for other, way in others.items():
        try:
            way(path)
        except Exception as error:
            print(f"  {name:<4} {other:<12} cannot read {path.name}: {error!r}"[:100])
            continue
        ways[other] = lambda way=way: way(path)
    megabytes = path.stat().st_size / 1e6
    motion = read(path)
    medians = compare({**ways, "checks": lambda: check_quality(motion)}, runs=RUNS)
    checks = medians.pop("checks") / medians["motionary"]
    print(f"  {name:<4} checks are {checks:.0%} of reading {path.name}")
    for way, seconds in medians.items():
        speed = f"{megabytes / seconds:7.1f} MB/s"
        beside = ", ".join(f"{medians[o] / seconds:.1f} x {o}" for o in medians if o != way)
        print(f"  {name:<4} {way:<12} {speed}  {beside}   {path.name}, {megabytes:.1f} MB")


def loop_over_lines(path: Path) -> list[list[float]]:
    numbers = []
    with path.open(encoding="latin-1") as lines:
        for line in lines:
            cells = line.split()
            if len(cells) > 1 and not line.startswith(("#", ":")):
                numbers.append([float(cell) for cell in cells[1:]])
    return numbers


def read_by_pybvh(path: Path) -> object:
    import pybvh

    return pybvh.read_bvh_file(str(path))


def read_by_ezc3d(path: Path) -> object:
    import ezc3d

    return ezc3d.c3d(str(path))


def report_memory(data: Path, place: Path) -> None:
    print(f"  {HOURS} hours at {RATE_HZ} Hz, {N_FRAMES} frames: file, motion in memory, peak")
    for suffix, path in long_files(data, place):
        options = [f"asf={data / 'cmu' / '86.asf'}"] if suffix == ".amc" else []
        command = [sys.executable, "-c", PEAK, str(path), *options]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        frames, motion, peak = (float(number) for number in done.stdout.split())
        size = path.stat().st_size / 1e6
        print(
            f"  {suffix:<5} {size:8.0f} MB {motion:8.0f} MB {peak:8.0f} MB"
            f"   peak / (file + motion) {peak / (size + motion):.2f}, {frames:.0f} frames, "
            f"{1e3 * peak / frames:.1f} kB a frame"
        )
        path.unlink()


def long_files(data: Path, place: Path):
    """Two hours in each format, one after the other."""
    source = data / "cmu" / "86_01.amc"
    lines = source.read_text("latin-1").split("\n1\n", 1)
    body = ("1\n" + lines[1]).rstrip("\n").split("\n")
    per_frame = 1 + next(i for i, line in enumerate(body[1:]) if line.strip().isdigit())
    n = len(body) // per_frame
    path = place / "long.amc"
    with path.open("w", encoding="latin-1") as file:
        file.write(lines[0] + "\n")
        for frame in range(N_FRAMES):
            start = per_frame * (frame % n)
            file.write(f"{frame + 1}\n" + "\n".join(body[start + 1 : start + per_frame]) + "\n")
    yield ".amc", path
    head, _, rows = (data / "cmu" / "01_01.bvh").read_text().partition("Frame Time:")
    time, _, rows = rows.partition("\n")
    kept = [row for row in rows.split("\n") if row.strip()]
    path = place / "long.bvh"
    with path.open("w") as file:
        file.write(head.replace(f"Frames: {len(kept)}", f"Frames: {N_FRAMES}"))
        file.write(f"Frame Time:{time}\n")
        file.writelines(f"{kept[frame % len(kept)]}\n" for frame in range(N_FRAMES))
    yield ".bvh", path
    motion = read(data / "hdm05_takes" / "HDM_mm_01-02_03_120.c3d")
    frames = np.arange(N_FRAMES) % motion.n_frames
    motion = Motion(
        motion.names, motion.positions[frames], Recording(rate_hz=RATE_HZ), motion.mapping
    )
    path = place / "long.c3d"
    write(motion, path)
    yield ".c3d", path


if __name__ == "__main__":
    main()
