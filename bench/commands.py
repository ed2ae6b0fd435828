"""Times of whole commands, from the start of the process to its end.

The help, beside an import of NumPy; labelling CMU 86_01 (38 s) with the eleven classes of
HDM05; labelling one minute of BVH, made of CMU 01_01 forth and back, with the library that ships,
wanted within 1.2 s; a search by one example over all 288 clips of HDM05, which are read and
measured anew. Without recordings: the help alone.
"""

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from timing import compare, print_ratios

RUNS = 9
MOTIONARY = (sys.executable, "-m", "motionary")

START = "motionary --help"
MINUTE, MOST_S = "annotate one minute, the library that ships", 1.2
EXAMPLE = "squat1Reps/HDM_mm_squat1Reps_037_120.amc"


def main() -> None:
    """Print medians of whole processes, start and imports included."""
    print("the help, beside the import that every computing command needs")
    numpy = (sys.executable, "-c", "import numpy")
    help_ways = {"import numpy": process(*numpy), "motionary --help": process(*MOTIONARY, "--help")}
    print_ratios(compare(help_ways, runs=RUNS), reference="import numpy")
    named = os.environ.get("MOTIONARY_DATA", "")
    if not named:
        print("annotate and search: MOTIONARY_DATA is not set, not measured")
        return
    with tempfile.TemporaryDirectory() as folder:
        time_main_commands(Path(named), Path(folder, "library"))


def time_main_commands(data: Path, library: Path) -> None:
    """Annotate and search on real recordings."""
    clips = data / "hdm05"
    learn = (*MOTIONARY, "learn", str(clips), "-o", str(library), "--mirror")
    take = data / "cmu" / "86_01.amc"
    annotate = (*MOTIONARY, "annotate", str(take), "--library", str(library))
    search = (*MOTIONARY, "search", str(clips), "--like", str(clips / EXAMPLE))
    minute = make_minute(data / "cmu" / "01_01.bvh", library.with_name("minute.bvh"))
    process(*learn)()
    print("whole commands")
    medians = compare(
        {
            START: process(*MOTIONARY, "--help"),
            "annotate 86_01, 11 classes and mirror images": process(*annotate),
            MINUTE: process(*MOTIONARY, "annotate", str(minute)),
            "search by example, 288 clips": process(*search),
            "search by example, 288 clips, --jobs 2": process(*search, "--jobs", "2"),
        },
        runs=RUNS,
    )
    print_ratios(medians, reference=START)
    print(f"  {MINUTE}: {medians[MINUTE]:.2f} s, wanted at most {MOST_S} s on a quiet machine")


def make_minute(source: Path, target: Path) -> Path:
    """One minute at 120 Hz of the frames of a BVH file, forth and back."""
    head, _, body = source.read_text().partition("Frame Time:")
    time, *rows = (line for line in body.split("\n") if line.strip())
    n_frames = 60 * 120
    both = [*rows, *reversed(rows)]
    frames = (both[i % len(both)] for i in range(n_frames))
    head = head.replace(f"Frames: {len(rows)}", f"Frames: {n_frames}")
    target.write_text("\n".join([f"{head}Frame Time:{time}", *frames, ""]))
    return target


def process(*command: str) -> Callable[[], object]:
    """What runs a command to its end, its output thrown away."""
    # What pip installs has its bytecode; without it every start compiles the sources again.
    environment = {key: v for key, v in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
    return lambda: subprocess.run(command, check=True, capture_output=True, env=environment)


if __name__ == "__main__":
    main()
