"""All tables and figures are made anew: `python -m evidence.run [--page] [NAME ...]`.

Each in a process of its own. With --page from the records that are there, without recordings.
"""

import subprocess
import sys
from pathlib import Path

from evidence.common.running import make, show

#: In this order: a later page may rest on an earlier record.
SCRIPTS = (
    "retrieval_2006", "learning_curve", "classification", "distractors", "masking",
    "baselines_2006", "figures_2006", "keyframe_search", "keyframe_choice", "joined_query",
    "preselection", "growing_choice", "judging_choice", "find_by_example", "crafting", "streams",
    "true_recordings", "figures_2009", "thresholds", "generation_metrics", "same_trial",
    "other_readers", "wild", "variants", "query_learning_choice", "query_learning",
    "query_learning_generations", "query_learning_speed", "exercises", "everyday",
    "everyday_classes", "inertial", "simulated_sensors", "figures_2012",
    "body", "depth", "stream_decisions", "corrections", "styles", "elsewhere", "kills",
    "multiview", "multiview_priors", "real_views", "regions", "live", "live_day", "archives",
    "cluster_kills",
)  # fmt: skip
#: Scripts whose pages are not in the documentation yet; run by name alone.
FURTHER: tuple[str, ...] = ()


def main(arguments: list[str]) -> int:
    """Run the named scripts, all by default; 1 if one of them failed, 2 for a wrong name."""
    page = "--page" in arguments
    names = [name for name in arguments if name != "--page"]
    unknown = sorted(set(names) - {*SCRIPTS, *FURTHER})
    if unknown:
        print(f"no evidence {', '.join(unknown)}; there are {', '.join(SCRIPTS)}")
        return 2
    if page or len(names) == 1:
        for name in names or SCRIPTS:
            (show if page else make)(name)
        return 0
    failed = []
    for name in names or SCRIPTS:
        print(f"== {name}", flush=True)
        command = [sys.executable, "-m", "evidence.run", name]
        if subprocess.run(command, cwd=Path(__file__).parents[1], check=False).returncode:
            failed.append(name)
    if failed:
        print(f"failed: {', '.join(failed)}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
