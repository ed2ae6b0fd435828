"""Run all benchmarks of this folder, or those named: `python bench/run.py [NAME ...]`.

A benchmark is a module beside this one with a `main()` that measures, compares and
prints. The numbers are medians (see `timing`); the header says which machine and which
commit they belong to.
"""

import importlib
import os
import platform
import subprocess
import sys
import traceback
from pathlib import Path

FOLDER = Path(__file__).resolve().parent
NOT_BENCHMARKS = {"run", "timing"}

# One thread for everyone who is compared; libraries read this when they are imported.
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")


def main(arguments: list[str]) -> int:
    """Exit code: 0 when every benchmark ran, 1 when one failed, 2 for an unknown name."""
    available = sorted({path.stem for path in FOLDER.glob("*.py")} - NOT_BENCHMARKS)
    unknown = sorted(set(arguments) - set(available))
    if unknown:
        print(f"no benchmark {', '.join(unknown)}; there are {', '.join(available)}")
        return 2
    print(describe_machine())
    print(describe_commit(), flush=True)
    failed = [name for name in arguments or available if not run(name)]
    if failed:
        print(f"failed: {', '.join(failed)}")
    return 1 if failed else 0


def run(name: str) -> bool:
    """Whether the benchmark ran to its end; one that fails does not stop the others."""
    print(f"\n== {name}", flush=True)
    try:
        importlib.import_module(name).main()
    except Exception:
        traceback.print_exc(file=sys.stdout)
        return False
    finally:
        sys.stdout.flush()
    return True


def describe_machine() -> str:
    """One line: processor, cores, system, Python, NumPy."""
    import numpy as np

    parts = [
        processor(),
        f"{os.cpu_count()} cores",
        f"{platform.system()} {platform.machine()}",
        f"Python {platform.python_version()}",
        f"NumPy {np.__version__}",
    ]
    return "machine: " + ", ".join(parts)


def processor() -> str:
    """Name of the processor, as far as the system tells."""
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text(errors="replace").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or "unknown processor"


def describe_commit() -> str:
    """One line: commit, and whether files differ from it."""
    commit = git("rev-parse", "--short=12", "HEAD") or "unknown"
    changed = " with local changes" if git("status", "--porcelain") else ""
    return f"commit:  {commit}{changed}"


def git(*arguments: str) -> str:
    """What git prints, or an empty string where there is no git or no repository."""
    command = ["git", "-C", str(FOLDER), *arguments]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except OSError:
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
