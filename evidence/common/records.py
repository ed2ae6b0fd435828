"""What is written down of a run, and where?

A record names data, split, seed, commit and machine beside the results, so that a number
can be made again. It holds no paths and no names of machines.
"""

import json
import os
import platform
import subprocess
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "docs" / "evidence"
RECORDS = FOLDER / "records"
PICTURES = FOLDER / "pictures"

KEYS = ("name", "title", "command", "data", "split", "seed", "commit", "machine", "seconds",
        "results")  # fmt: skip


def describe_machine() -> dict[str, Any]:
    """Processor, cores, system, Python, NumPy."""
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "numpy": np.__version__,
    }


def describe_commit() -> str:
    """Commit, and whether code differs from it."""
    commit = _git("rev-parse", "--short=12", "HEAD") or "unknown"
    changed = _git("status", "--porcelain", "--", "src", "evidence")
    return f"{commit} with local changes" if changed else commit


def write_record(record: dict[str, Any]) -> None:
    """Write a record, rounded to what is meant."""
    RECORDS.mkdir(parents=True, exist_ok=True)
    text = json.dumps(rounded(record), indent=1, ensure_ascii=False, allow_nan=False)
    (RECORDS / f"{record['name']}.json").write_text(text + "\n", "utf-8")


def read_record(name: str) -> dict[str, Any]:
    """A record as it was written."""
    content: dict[str, Any] = json.loads((RECORDS / f"{name}.json").read_text("utf-8"))
    return content


def rounded(value: Any) -> Any:
    """Plain JSON of four decimals; infinite and undefined numbers are null."""
    if isinstance(value, dict):
        return {str(key): rounded(item) for key, item in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [rounded(item) for item in value]
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, int | np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return round(float(value), 4) if np.isfinite(value) else None
    return value


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text(errors="replace").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or "unknown processor"


def _git(*arguments: str) -> str:
    try:
        done = subprocess.run(
            ["git", "-C", str(ROOT), *arguments], capture_output=True, text=True, check=False
        )
    except OSError:
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""
