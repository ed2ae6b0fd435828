"""How fast are recordings read?

Whole `motionary.io.read`, with joint positions, beside other ways to the same file: pybvh
for BVH (which stops at the angles), and for AMC a plain loop over lines that keeps nothing
but the numbers. Needs recordings (MOTIONARY_DATA).
"""

import os
from pathlib import Path

from motionary.io import read
from timing import compare

FILES = {"AMC": "cmu/86_01.amc", "BVH": "cmu/01_01.bvh"}


def main() -> None:
    folder = os.environ.get("MOTIONARY_DATA")
    if not folder:
        print("reading is timed on recordings: set MOTIONARY_DATA")
        return
    for kind, name in FILES.items():
        path = Path(folder) / name
        ways = {"motionary.io.read": lambda path=path: read(path)}
        ways |= _pybvh(path) if kind == "BVH" else {"line loop, numbers only": _loop(path)}
        megabytes = path.stat().st_size / 1e6
        print(f"{kind}: {name}, {megabytes:.1f} MB")
        medians = compare(ways, runs=9)
        for way, seconds in medians.items():
            print(f"  {way:<26} {seconds * 1e3:8.1f} ms {megabytes / seconds:8.1f} MB/s")


def _pybvh(path: Path) -> dict[str, object]:
    try:
        import pybvh
    except ImportError:
        print("pybvh is not installed; pip install '.[bench]'")
        return {}
    return {"pybvh.read_bvh_file": lambda: pybvh.read_bvh_file(str(path))}


def _loop(path: Path):
    def run() -> list[list[float]]:
        numbers = []
        with path.open(encoding="latin-1") as lines:
            for line in lines:
                cells = line.split()
                if len(cells) > 1 and not line.startswith(("#", ":")):
                    numbers.append([float(cell) for cell in cells[1:]])
        return numbers

    return run


if __name__ == "__main__":
    main()
