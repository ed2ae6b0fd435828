"""Which tables and figures are there, and how are they all made anew?

Runs each script as a program of its own: `python evidence/run.py [NAME ...]`.
"""

import subprocess
import sys
from pathlib import Path

SCRIPTS = (
    "retrieval_2006",
    "learning_curve",
    "classification",
    "distractors",
    "masking",
    "baselines_2006",
    "figures_2006",
    "keyframe_search",
    "keyframe_choice",
    "joined_query",
    "preselection",
    "growing_choice",
    "judging_choice",
    "find_by_example",
    "crafting",
    "streams",
    "true_recordings",
    "figures_2009",
    "thresholds",
    "generation_metrics",
    "same_trial",
    "other_readers",
    "variants",
    "query_learning_choice",
    "query_learning",
    "query_learning_generations",
    "query_learning_speed",
)


def main(names: list[str]) -> int:
    """Run the named scripts, all by default; 1 if one of them failed, 2 for a wrong name."""
    unknown = sorted(set(names) - set(SCRIPTS))
    if unknown:
        print(f"no evidence {', '.join(unknown)}; there are {', '.join(SCRIPTS)}")
        return 2
    root = Path(__file__).resolve().parents[1]
    failed = []
    for name in names or SCRIPTS:
        print(f"== {name}", flush=True)
        run = subprocess.run([sys.executable, "-m", f"evidence.{name}"], cwd=root, check=False)
        if run.returncode:
            failed.append(name)
    if failed:
        print(f"failed: {', '.join(failed)}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
