"""Tables and figures of `query_learning.md`, from the records of `query_learning.py`.

python evidence/query_learning_page.py > evidence/query_learning/tables.md
"""

import json
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

from motionary.query_learning.fitness import weighted_f

mpl.use("agg")

FOLDER = Path(__file__).resolve().parent / "query_learning"
SHARES = {"bd, bk, dg": ("bd", "bk", "dg"), "mm, tr": ("mm", "tr"), "all five": None}
COMMITTEES = ((3, 2), (5, 3), (10, 6), (10, 7), (20, 12), (20, 14))
MEASURES = ("fitness", "precision", "recall")
GENERATIONS = (1, 10, 20, 40, 60, 80, 100)


INTRODUCTION = """# Queries that are learned, and people never seen

HDM05: eleven classes, 288 clips, five actors (bd, bk, dg, mm, tr); words of 40 relations at
30 Hz. A clip counts once. F2 weighs recall twice as much as precision, as in the thesis.
`python evidence/query_learning.py` makes the records in `query_learning/`,
`python evidence/query_learning_page.py` this page. All runs have seed 0.

**What was wrong.** As published, an evolved query asks for about 80 relations at once (three
to four keyframes of a strict template): fit on the examples to 1.00, it is missed by the next
person. Three actors give verification fitness .66 on the other two (second part of the page),
random search with as many evaluations is no worse there: what the evolution gains on the
examples is not about the class.

**What closes the gap.** (1) Each entry costs .001 of fitness (`parsimony`). (2) The fittest
query is *simplified*: entries go one by one in random order, gaps are widened, as long as
fitness does not fall on the examples and two varied copies of every counter-example (tempo
within 1.25, each relation up to 3 frames early or late). About eight entries are left; recall
on unseen actors rises from .81 to .96, precision falls to .83. (3) Five such queries vote;
three must agree. They rest on different details, so their mistakes do not coincide.

What did not help: fitness of the worst actor instead of all, copies of positives in the
evolution, accumulated runs (Fig. 4.2; they keep what all runs overfit to).

**How settings were chosen.** On bd, bk and dg alone: two learn, the third is unseen. F2 there
(means over 33 classes and actors): as published .71 a run; with parsimony .84 a run, .90 if 3
of 10 agree; simplified .85 a run, .91 (3 of 5), .93 (6 of 10), .93 (12 of 20); on varied
counter-examples .87, .92, .93, .93; larger shifts and tempo, and at least 14 or 20 entries
kept, are the same within .01. Mm and tr were looked at once, after that: their rows are the
result; those of bd, bk and dg are kinder, since their clips took part in choosing. More
queries than five gain little and each costs time, so that five is the default. These tries
are not remade by the script.

**Before a template** (third part). A tenth of the frames is left, which is what the class
itself takes of these clips; precision at .1 rises from .67 to .99; recall at .06 loses .029
on mm and tr. The thesis' speed-up of 15 is *not*
reached, nor one of 6: compiled matching takes half a millisecond to a millisecond for 42 586
frames where the authors had seconds, so that five queries of 0.1 ms each are no longer small
beside it. At 10^6 frames the factor is 2.6. Annotation, which searches the words without an
index, is not faster at all; it loses no recall and gains precision (last part).

**Time.** One run as published on clips repeated to 42 586 frames takes .11 to .17 s of one
processor (AMD EPYC, NumPy alone; `python bench/run.py query_learning`), simplified .20 to
.26 s; the authors: roughly 10 s. An individual is evaluated in .03 to .08 ms. A hundred runs
take 19.9 s of processor time in one process, 21.8 s in two; on a busy machine two finished
them 1.6 times as fast.

**Decisions.** A gap's bound is moved by up to half of its width, *one frame at least*: with
half a frame at least, rounding would keep every gap of width 0 or 1 for ever. A keyframe
that is removed leaves the sum of its gaps, so that no hit is lost. An added keyframe takes a
column that the individual does not have.

**What is missing.** Eleven of the thesis' 69 classes. Clips are cut: that a clip ends soon is
known to a query whose last keyframe asks for nothing but time, and worthless in a long
recording. Jogging and sneaking are weakest: their templates depend on the step a clip begins
with, and two to four clips of an actor move a mean by .05. `left-out.json` was made before
such keyframes were dropped where they make no difference to the clips that are found.
"""


def main() -> None:
    print(INTRODUCTION)
    rows = json.loads((FOLDER / "left-out.json").read_text("utf-8"))
    for title, actors in SHARES.items():
        chosen = [row for row in rows if actors is None or row["unseen"] in actors]
        say_unseen(title, chosen)
    say_classes(rows)
    say_preselection(json.loads((FOLDER / "preselection.json").read_text("utf-8")))
    say_stiffness(rows)
    followed = json.loads((FOLDER / "generations.json").read_text("utf-8"))
    say_generations(followed)
    say_annotation(json.loads((FOLDER / "annotation.json").read_text("utf-8")))
    draw_generations(followed)
    draw_stiffness(rows)


def say_unseen(title: str, rows: list[dict[str, Any]]) -> None:
    """Measures on the actor that took no part in learning, means over classes and actors."""
    print(f"\n### Unseen actor: {title} ({len(rows)} classes and actors)\n")
    print("| queries | F2 | F1 | precision | recall |\n|---|---|---|---|---|")
    say_row("as published, one run", [row["published"] for row in rows])
    say_row("as published, runs combined", [row["published, combined"] for row in rows])
    say_row("simplified, one run", [row["one run"] for row in rows])
    for number, votes in COMMITTEES:
        found = [voted(row, number, votes) for row in rows]
        say_row(f"simplified, {votes} of {number} agree", found)


def say_row(name: str, found: list[dict[str, float]]) -> None:
    values = [np.mean([one[key] for one in found]) for key in ("f2", "f1", "precision", "recall")]
    print(f"| {name} | " + " | ".join(f"{value:.3f}" for value in values) + " |")


def voted(row: dict[str, Any], number: int, votes: int) -> dict[str, float]:
    """Measures of documents in which so many of the first queries have a hit."""
    found = [document for hits in row["found"][:number] for document in hits]
    documents = np.flatnonzero(np.bincount(np.array(found, dtype=np.int64)) >= votes)
    right = int(np.count_nonzero(documents < row["n_positives"]))
    precision, recall = right / max(len(documents), 1), right / row["n_positives"]
    f = {f"f{beta}": weighted_f(precision, recall, beta=float(beta)) for beta in (1, 2)}
    return f | {"precision": precision, "recall": recall}


def say_classes(rows: list[dict[str, Any]]) -> None:
    print("\n### By class, 3 of 5 agree, mean over the five unseen actors\n")
    print(
        "| class | published F2 | one run F2 | F2 | precision | recall |\n|---|---|---|---|---|---|"
    )
    for name in sorted({row["class"] for row in rows}):
        mine = [row for row in rows if row["class"] == name]
        found = [voted(row, 5, 3) for row in mine]
        singles = [np.mean([row[key]["f2"] for row in mine]) for key in ("published", "one run")]
        values = [np.mean([one[key] for one in found]) for key in ("f2", "precision", "recall")]
        print(f"| {name} | " + " | ".join(f"{value:.2f}" for value in (*singles, *values)) + " |")


def say_preselection(rows: list[dict[str, Any]]) -> None:
    print(f"\n### Queries before a template: mm, tr ({len(rows)} classes and actors)\n")
    print(
        "| agree | frames left | recall at .06: template, lost by queries | precision at .1: "
        "template, with queries | speed-up, 42 586 frames | speed-up, 10^6 frames |"
        "\n|---|---|---|---|---|---|"
    )
    for name in (key for key in rows[0] if "/" in key):
        one = [row[name] for row in rows]
        mean = {key: np.mean([r[key] for r in one]) for key in one[0] if key != "seconds"}
        lost = mean["all, recall, 0.06"] - mean["preselected, recall, 0.06"]
        faster = [
            sum(r["seconds"][n]["all"] for r in one)
            / sum(r["seconds"][n]["preselected"] for r in one)
            for n in one[0]["seconds"]
        ]
        print(
            f"| {name.replace('/', ' of ')} | {mean['frames left']:.3f} | "
            f"{mean['all, recall, 0.06']:.3f}, {lost:.3f} | "
            f"{mean['all, precision, 0.1']:.3f}, {mean['preselected, precision, 0.1']:.3f} | "
            + " | ".join(f"{ratio:.1f}" for ratio in faster)
            + " |"
        )


def say_annotation(record: dict[str, Any]) -> None:
    print(f"\n### Annotation: clips of tr one behind the other, {record['frames']} frames\n")
    print("| looked for | precision of frames | recall | F1 | seconds |\n|---|---|---|---|---|")
    for name, title in (("template", "everywhere"), ("queries", "around hits of queries")):
        row = record[name]
        cells = " | ".join(f"{row[key]:.3f}" for key in ("precision", "recall", "f1", "seconds"))
        print(f"| {title} | {cells} |")


def say_stiffness(rows: list[dict[str, Any]]) -> None:
    print("\n### Stiffness of the gaps (thesis, Fig. 4.4: more than 87 % at most .8)\n")
    for name in ("published", "default"):
        counts = np.sum([row["stiffness"][name] for row in rows], axis=0)
        print(f"- {name}: {counts.tolist()}; {counts[:16].sum() / counts.sum():.0%} at most .8")


def say_generations(rows: list[dict[str, Any]]) -> None:
    print("\n### By generation: learned from bd, bk, dg; mean (spread) over the population\n")
    print("| generation | way | clips | " + " | ".join(MEASURES) + " |\n|---|---|---|---|---|---|")
    for generation in GENERATIONS:
        for way in ("published", "random"):
            for clips in ("examples", "verification"):
                table = np.mean([row[way][clips] for row in rows], axis=0)[generation - 1]
                cells = " | ".join(f"{mean:.2f} ({spread:.2f})" for mean, spread in table)
                print(f"| {generation} | {way} | {clips} | {cells} |")
    for way in ("published", "random"):
        for clips in ("examples", "verification"):
            best = np.array([row[way][f"best on {clips}"] for row in rows])
            print(
                f"\nBest of each run, {way}, {clips}: mean {best.mean():.3f}, spread over the "
                f"runs of a class {best.std(axis=1).mean():.3f}."
            )


def draw_generations(rows: list[dict[str, Any]]) -> None:
    """Like Fig. 4.3, random search dashed."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(9, 3.4), sharey=True, layout="constrained")
    for axis, clips in zip(axes, ("examples", "verification"), strict=True):
        for way, line in (("published", "-"), ("random", "--")):
            table = np.mean([row[way][clips] for row in rows], axis=0)
            for k, colour in enumerate(("tab:green", "black", "tab:red")):
                label = f"{MEASURES[k]}, {way}"
                axis.plot(
                    np.arange(1, len(table) + 1), table[:, k, 0], line, color=colour, label=label
                )
        axis.set(title=clips, xlabel="generation", ylim=(0, 1.02))
    axes[1].legend(fontsize=7)
    figure.savefig(FOLDER / "generations.png", dpi=110)


def draw_stiffness(rows: list[dict[str, Any]]) -> None:
    """Like Fig. 4.4."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(9, 2.8), layout="constrained")
    for axis, name in zip(axes, ("published", "default"), strict=True):
        counts = np.sum([row["stiffness"][name] for row in rows], axis=0)
        axis.bar(np.arange(20) / 20 + 0.025, counts, width=0.045)
        axis.set(title=name, xlabel="stiffness", ylabel="gaps")
    figure.savefig(FOLDER / "stiffness.png", dpi=110)


if __name__ == "__main__":
    main()
