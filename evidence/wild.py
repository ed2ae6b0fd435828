"""Files of strangers: what was read of each, and whose positions it was held against.

What is right was decided by hand, file by file, and stands in `tests/io/test_wild.py`. Positions
are those of `other_readers`; of TRC they are columns of the table, by pandas.
"""

import importlib
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np

from evidence.common.recordings import Recordings, Results
from evidence.common.running import ROOT
from evidence.other_readers import (
    TOLERANCE_M,
    Theirs,
    by_bvhsdk,
    by_ezc3d,
    by_pybvh,
    by_ufbx,
    difference,
    quietly,
    takes_of,
)
from motionary.errors import MotionaryError
from motionary.features import compute_features
from motionary.io import read
from motionary.motion import Motion

TITLE = "Files of strangers"
SPLIT = "nothing is learned or chosen"
SEED = 0
DATA = (
    (
        "files of 20 public repositories, each under its own licence, and small ones made to show "
        "a fault",
        lambda recordings: _extent(recordings.folder),
    ),
)


def measure(recordings: Recordings) -> Results:
    """A row for each file."""
    # Cases of the tests stand beside them.
    sys.path.insert(0, str(ROOT / "tests"))
    cases, known = (importlib.import_module(x) for x in ("tests.io.test_wild", "reading_cases"))
    rows = [_row(recordings.folder, one, known) for one in cases.WILD]
    return {"rows": sorted(rows, key=lambda row: (row["source"] == "made", row["source"]))}


def _row(data: Path, one: Any, known: Any) -> dict[str, Any]:
    path = data / one.file
    origin = (path.parent / "README").read_text("utf-8").splitlines()[0]
    _, licence = origin.partition("licence: ")[::2]
    is_made = path.parent.name.startswith("_")
    row: dict[str, Any] = {
        "file": path.name,
        "source": "made" if is_made else path.parent.name.replace("+", "/"),
        "licence": "" if is_made else licence.split(":")[-1].strip()[:70],
    }
    try:
        known.check_case(data, one)
        problem = ""
    except AssertionError as error:
        problem = str(error)
    try:
        motion = read(path)
    except MotionaryError as error:
        return row | {"refused": str(error)[:300], "problem": problem}
    return row | {"problem": problem, **_describe(motion, one, known), **_check(path)}


def _describe(motion: Motion, one: Any, known: Any) -> dict[str, Any]:
    """Numbers of a recording, and the notes without which it would not be right."""
    features = 0
    if motion.mapping is not None:
        features = int(compute_features(motion).known_features.any(axis=0).sum())
    asked = [pattern for right in one.right for pattern in getattr(right, "notes", ())]
    notes = [
        note
        for note in known.all_notes(motion)
        if any(re.search(pattern, note) for pattern in asked)
    ]
    return {
        "frames": motion.n_frames, "joints": len(motion.names), "rate_hz": motion.rate_hz,
        "skeleton": motion.mapping.name if motion.mapping else "unknown", "features": features,
        "told": [note[:200] for note in notes],
    }  # fmt: skip


def _check(path: Path) -> dict[str, Any]:
    """Whose positions, and how far ours are from them at most."""
    failed: list[str] = []
    for way in WAYS.get(path.suffix, ()):
        by = way.__name__.removeprefix("by_")
        try:
            takes = enumerate(takes_of(path), start=1)
            apart_m = max(difference(quietly(way, path, one, i), one)[0] for i, one in takes)
        except Exception:
            failed.append(by)
            continue
        # As text: records keep four decimals.
        agree = apart_m <= TOLERANCE_M
        notes = [] if agree else [note[:300] for note in read(path).notes]
        row = {"by": by, "apart_m": f"{apart_m:.1e}", "agree": agree, "notes": notes}
        return row | {"failed": failed}
    return {"by": "", "failed": failed}


def by_pandas(path: Path, motion: Motion, take: int) -> Theirs:
    """Columns of a table in file units, three a name; unknown places are empty."""
    import pandas

    lines = path.read_text("utf-8", errors="replace").splitlines()
    heads = next(i for i, line in enumerate(lines) if line.startswith("Frame#"))
    names = [cell.strip() for cell in lines[heads].split("\t")[2:] if cell.strip()]
    first = next(i for i, line in enumerate(lines) if i > heads and line[:1].isdigit())
    # Lines may have cells behind the columns that are named.
    columns = range(max(line.count("\t") for line in lines) + 1)
    table = pandas.read_csv(path, sep="\t", names=columns, skiprows=first)
    cells = table.iloc[:, 2 : 2 + 3 * len(names)].to_numpy(dtype=np.float64)
    return Theirs(names, cells.reshape(len(cells), -1, 3))


#: In their order: the next one where one cannot read the file.
WAYS = {
    ".bvh": (by_pybvh, by_bvhsdk), ".c3d": (by_ezc3d,), ".fbx": (by_ufbx,), ".trc": (by_pandas,),
}  # fmt: skip


def _extent(data: Path) -> tuple[int, float]:
    paths = [path for path in (data / "wild").rglob("*.*") if path.is_file()]
    motions = [read(path) for path in paths]
    return len(paths), round(sum(motion.duration_s for motion in motions) / 60, 2)
