"""The pose database that ships: `python -m recipes.poses [--without-people P ...]`.

Made of CMU's recordings alone, with their mirror images; people on whom tracking is reported are
always left out. The same files give the same poses on one machine with the same versions of
packages.
"""

import argparse
import hashlib
import os
import sys
from collections.abc import Collection
from io import BytesIO
from pathlib import Path

import numpy as np

from motionary.depth.poses import PoseDatabase, build_database, database_to_arrays
from motionary.io import read

HOME = Path(__file__).parents[1] / "src" / "motionary" / "io" / "assets" / "poses"
FOLDERS = ("cmu", "cmu_everyday")
#: People of CMU whose recordings tracking is reported on.
REPORTED = ("13", "86")
PROVENANCE = (
    "CMU Graphics Lab Motion Capture Database (mocap.cs.cmu.edu, funded by NSF EIA-0196217)"
)
LICENCE = "CMU: free for any use, not to be sold as it is; this selection: Apache-2.0"


def list_files(folder: Path, without: Collection[str] = ()) -> list[Path]:
    """CMU's recordings at hand, but for those of some people."""
    left_out = {*REPORTED, *without}
    return [
        path
        for part in FOLDERS
        for path in sorted((folder / part).glob("*.amc"))
        if path.name.split("_")[0] not in left_out
    ]


def build(folder: Path, without: Collection[str] = ()) -> PoseDatabase:
    """The database of these recordings."""
    paths = list_files(folder, without)
    hashes = [f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}" for path in paths]
    return build_database(
        (read(path) for path in paths),
        provenance={
            "source": PROVENANCE,
            "recordings": len(paths),
            "people": sorted({path.name.split("_")[0] for path in paths}),
            "sha256": hashlib.sha256("\n".join(hashes).encode()).hexdigest(),
        },
        licence=LICENCE,
    )


def main(arguments: list[str]) -> int:
    """Write the database where the package looks for it, or elsewhere."""
    parser = argparse.ArgumentParser(description="The pose database that ships.")
    parser.add_argument("--without-people", nargs="*", default=[], metavar="P")
    parser.add_argument("--output", default=str(HOME / "poses.npz"), metavar="NPZ")
    given = parser.parse_args(arguments)
    folder = os.environ.get("MOTIONARY_DATA", "")
    if not folder:
        raise SystemExit("MOTIONARY_DATA must name the folder of the recordings")
    database = build(Path(folder), given.without_people)
    content = BytesIO()
    np.savez_compressed(content, **database_to_arrays(database))  # type: ignore[arg-type]
    Path(given.output).write_bytes(content.getvalue())
    digest = hashlib.sha256(content.getvalue()).hexdigest()
    sys.stdout.write(f"{len(database)} poses, SHA-256 {digest}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
