"""One piece of evidence is made: recordings, results, record, pictures, page.

A script is a module of `evidence` with

- TITLE: of its page;
- SPLIT: what is learned from and what is tested on, in a sentence;
- SEED: of all that is drawn at random;
- DATA: what was used, as `recordings.describe` takes it;
- measure(recordings): results, plain numbers and text, which become the record;
- draw(results), if it has pictures: figures by name, from the record alone;
- SYNTHETIC, True if it needs no recordings: it gets none;
- draw_recordings(recordings, results), if further pictures need recordings.

Its page is `pages/NAME.md`. A record names data, split, seed, commit and machine beside the
results, so that a number can be made again. It holds no paths and no names of machines.
"""

import importlib
import json
import os
import platform
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from evidence.common.pages import render
from evidence.common.recordings import Recordings, describe, load
from motionary.batch import Failure, map_ordered
from motionary.plots import save

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "docs" / "evidence"

Item = TypeVar("Item")
Result = TypeVar("Result")

JOBS = 2


def script_of(name: str) -> ModuleType:
    """The script of a name."""
    return importlib.import_module(f"evidence.{name}")


def make(name: str) -> None:
    """Measure, and write record, pictures and page."""
    script = script_of(name)
    is_synthetic = getattr(script, "SYNTHETIC", False)
    recordings = Recordings(Path(), (), {}) if is_synthetic else load(jobs=JOBS)
    began = time.perf_counter()
    results = script.measure(recordings)
    seconds = time.perf_counter() - began
    record = rounded(
        {
            "name": name,
            "title": script.TITLE,
            "command": f"python -m evidence.run {name}",
            "data": describe(recordings, script.DATA),
            "split": script.SPLIT,
            "seed": script.SEED,
            "commit": _commit(),
            "machine": _machine(),
            "seconds": seconds,
            "results": results,
        }
    )
    text = json.dumps(record, indent=1, ensure_ascii=False, allow_nan=False)
    _record(name).write_text(text + "\n", "utf-8")
    show(name, recordings)
    sys.stdout.write(f"{name}: {seconds:.0f} s\n")
    sys.stdout.flush()


def show(name: str, recordings: Recordings | None = None) -> None:
    """Write page and pictures of the record that is there."""
    script, record = script_of(name), read_record(name)
    if hasattr(script, "draw"):
        _save(script.draw(record["results"]))
    if recordings is not None and hasattr(script, "draw_recordings"):
        _save(script.draw_recordings(recordings, record["results"]))
    (FOLDER / f"{name}.md").write_text(render(record, script), "utf-8")


def read_record(name: str) -> dict[str, Any]:
    """A record as it was written."""
    content: dict[str, Any] = json.loads(_record(name).read_text("utf-8"))
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


def compute_all(function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
    """Results in their order, by several processes; the first failure is raised."""
    results = []
    for result in map_ordered(function, items, jobs=JOBS):
        if isinstance(result, Failure):
            raise result.error
        results.append(result)
    return results


def timed(call: Callable[[], Result]) -> tuple[Result, float]:
    """A result, and the seconds of processor time that it took."""
    began = time.process_time()
    return call(), time.process_time() - began


def _record(name: str) -> Path:
    return FOLDER / "records" / f"{name}.json"


def _save(figures: "Mapping[str, Figure]") -> None:
    for name, figure in figures.items():
        save(figure, FOLDER / "pictures" / f"{name}.png")


def _machine() -> dict[str, Any]:
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "numpy": np.__version__,
    }


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text(errors="replace").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or "unknown processor"


def _commit() -> str:
    """Commit, and whether code differs from it."""
    commit = _git("rev-parse", "--short=12", "HEAD") or "unknown"
    changed = _git("status", "--porcelain", "--", "src", "evidence")
    return f"{commit} with local changes" if changed else commit


def _git(*arguments: str) -> str:
    try:
        done = subprocess.run(
            ["git", "-C", str(ROOT), *arguments], capture_output=True, text=True, check=False
        )
    except OSError:
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""
