"""Times of whole commands, from the start of the process to its end.

The help, beside an import of NumPy; labelling CMU 86_01 (38 s) with the eleven classes of
HDM05; a search by one example over all 288 clips of HDM05, which are read and measured
anew. Without recordings: the help alone.
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
    process(*learn)()
    print("whole commands")
    medians = compare(
        {
            START: process(*MOTIONARY, "--help"),
            "annotate 86_01, 11 classes and mirror images": process(*annotate),
            "search by example, 288 clips": process(*search),
            "search by example, 288 clips, --jobs 2": process(*search, "--jobs", "2"),
        },
        runs=RUNS,
    )
    print_ratios(medians, reference=START)


def process(*command: str) -> Callable[[], object]:
    """What runs a command to its end, its output thrown away."""
    return lambda: subprocess.run(command, check=True, capture_output=True)


if __name__ == "__main__":
    main()
