"""Page and pictures of learned queries, from their record."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from evidence.common.drawing import Panel, draw_panels
from evidence.common.pages import number, picture, share, table
from evidence.query_learning_words import (
    DECISIONS,
    INTRODUCTION,
    MATERIAL,
    MISSING,
    SEEN_BEFORE,
    TIMED,
    WAYS,
)
from motionary.plots.style import BLUE, VERMILLION, house_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Results = dict[str, Any]
Rows = list[dict[str, Any]]

GROUPS = {"mm, tr": ("mm", "tr"), "bd, bk, dg": ("bd", "bk", "dg"), "all five": None}
SHOWN = ("f2", "f1", "precision", "recall", "frames left", "recall lost", "precision left")
GENERATIONS = (1, 10, 20, 40, 60, 80, 100)
MEASURES = ("fitness", "precision", "recall")
ORIGINS = {
    "nothing": "none, everywhere",
    "learned": "learned",
    "picked": "chosen",
    "manual": "by hand",
}
STIFF = 0.8


def write(results: Results) -> str:
    """Body of the page."""
    rows = results["left_out"]
    parts = [INTRODUCTION, _targets(results), SEEN_BEFORE, "## An actor never seen", WAYS]
    parts += [_unseen(title, actors, rows) for title, actors in GROUPS.items()]
    parts += [_classes(rows), _generations(results["generations"]), _stiffness(rows)]
    parts += [_speed(results["speed"]), DECISIONS, MISSING]
    return "\n\n".join(parts)


def _of(rows: Rows, way: str, key: str) -> float:
    return float(np.mean([row["ways"][way][key] for row in rows]))


def _targets(results: Results) -> str:
    rows = results["left_out"]
    ratios = [
        ways["nothing"]["seconds"] / ways["learned"]["seconds"]
        for name, ways in results["speed"]["ways"].items()
        if name.startswith("weighed")
    ]
    measured = [
        ("F2 of clips found, one actor left out", _of(rows, "committee", "f2"), 0.9, True),
        ("recall of clips found", _of(rows, "committee", "recall"), 0.9, True),
        ("recall lost at τ = .06", _of(rows, "committee", "recall lost"), 0.02, False),
        ("precision at τ = .1", _of(rows, "committee", "precision left"), 0.9, True),
        ("frames left", _of(rows, "committee", "frames left"), 0.15, False),
        ("annotation is faster by", min(ratios), 6.0, True),
    ]
    return table(
        ["aim", "measured", "wanted", "reached"],
        [
            [
                what,
                share(value, 3) if limit < 1 else number(value),
                ("at least " if more else "at most ")
                + (share(limit) if limit < 1 else f"{limit:g}"),
                "yes" if (value >= limit) == more or value == limit else "no",
            ]
            for what, value, limit, more in measured
        ],
    )


def _unseen(title: str, actors: tuple[str, ...] | None, rows: Rows) -> str:
    mine = [row for row in rows if actors is None or row["unseen"] in actors]
    settings = sorted(
        {
            f"{row['unseen']}: {row['setting']['votes']} of {row['setting']['queries']}, "
            f"copies {row['setting']['copies']}"
            for row in mine
        }
    )
    body = table(
        ["queries", *SHOWN],
        [[name, *(share(_of(mine, way, key), 3) for key in SHOWN)] for way, name in NAMES.items()],
    )
    return (
        f"### Unseen: {title} ({len(mine)} classes and actors)\n\n{body}\n"
        f"Settings chosen without the actor: {'; '.join(settings)}. The template alone has "
        f"recall {share(_of(mine, 'committee', 'recall of the template'), 3)} at .06 and precision "
        f"{share(_of(mine, 'committee', 'precision of the template'), 3)} at .1. A published run "
        f"asks for {_entries(mine, 'published'):.0f} relations, a simplified one for "
        f"{_entries(mine, 'simplified'):.0f}."
    )


NAMES = {
    "random": "random search, one run",
    "published": "as published, one run",
    "combined": "as published, runs combined",
    "one run": "simplified, one run",
    "usual": "3 of 5 agree, the default",
    "committee": "setting chosen without the actor",
    "picked": "one query, chosen and not bred",
    "manual": "by hand (authors, all actors seen)",
}


def _entries(rows: Rows, way: str) -> float:
    return float(np.mean([row["entries"][way] for row in rows]))


def _classes(rows: Rows) -> str:
    body = []
    for name in sorted({row["class"] for row in rows}):
        mine = [row for row in rows if row["class"] == name]
        body.append(
            [
                name,
                share(_of(mine, "published", "f2")),
                *(share(_of(mine, "committee", key)) for key in SHOWN if key != "f1"),
            ]
        )
    head = ["class", "published, F2", *(key for key in SHOWN if key != "f1")]
    return (
        "### By class\n\nWith the setting chosen without the actor, means over the five "
        f"actors.\n\n{table(head, body)}"
    )


def _generations(followed: dict[str, Any]) -> str:
    body = []
    for generation in GENERATIONS:
        for way in followed:
            for clips in ("examples", "verification"):
                row = followed[way][clips][generation - 1]
                cells = [f"{mean:.2f} ({spread:.2f})" for mean, spread in row]
                body.append([str(generation), way, clips, *cells])
    best = "; ".join(
        f"{way}, {clips} {share(one['mean'], 3)} ({share(one['spread'], 3)})"
        for way, both in followed.items()
        for clips, one in both["best"].items()
    )
    return f"""## By generation

Learned from bd, bk, dg as published, verified on mm and tr, 30 runs a class: mean over the
population (and its standard deviation), means over runs and classes; beside random search with
as many evaluations.

{picture("query_learning_generations", CAPTION)}
{table(["generation", "way", "clips", *MEASURES], body)}
Fitness of the best of each run (spread over the runs of a class): {best}. What the evolution
gains on the examples over random search, it does not keep on other people."""


CAPTION = (
    "Fitness, precision and recall by generation, mean over the population of all runs and "
    "classes; band: standard deviation within a population (thesis, Fig. 4.3)"
)


def _stiffness(rows: Rows) -> str:
    shares = []
    for name in ("published", "simplified"):
        counts = np.sum([row["stiffness"][name] for row in rows], axis=0)
        at_most = counts[: round(STIFF * len(counts))].sum() / counts.sum()
        shares.append(f"{name} {share(float(at_most))}")
    return f"""## Stiffness of the gaps

{picture("query_learning_stiffness", "Stiffness of the gaps of all queries (thesis, Fig. 4.4)")}
Share of the gaps of at most .8: {", ".join(shares)}; thesis: more than .87."""


def _speed(speed: Results) -> str:
    body = []
    for name, ways in speed["ways"].items():
        costs, material = name.split(", ")
        for way, row in ways.items():
            ratios = [ways["nothing"][key] / row[key] for key in ("seconds", "seconds of matching")]
            body.append(
                [
                    f"{costs}, {MATERIAL[material]}" if way == "nothing" else "",
                    ORIGINS[way],
                    *(share(row[key], 3) for key in ("frames left", "precision", "recall", "f1")),
                    f"{row['seconds']:.2f} s",
                    number(ratios[0]),
                    number(ratios[1]),
                ]
            )
    head = ["costs, material", "queries", "frames left", "precision", "recall", "F1", "annotate",
            "faster", "without reading matches"]  # fmt: skip
    frames = ", ".join(
        f"{MATERIAL[name]}: {n} frames, {share(speed['of the classes'][name])} of them of a class"
        for name, n in speed["frames"].items()
    )
    return f"## Labels: time and quality\n\n{TIMED} {frames}.\n\n{table(head, body)}"


def draw(results: Results) -> "dict[str, Figure]":
    """Like Figs 4.3 and 4.4 of the thesis."""
    return {
        "query_learning_generations": _draw_generations(results["generations"]),
        "query_learning_stiffness": _draw_stiffness(results["left_out"]),
    }


def _draw_generations(followed: dict[str, Any]) -> "Figure":
    panels = []
    for clips in ("examples", "verification"):
        for k, measure in enumerate(MEASURES):
            curves = {
                name: _curve(followed[way][clips], k)
                for way, name in (("published", "evolution"), ("random", "random search"))
            }
            panels.append(
                Panel(f"{measure}, {clips}", curves, x_label="generation", y_limits=(0.4, 1.02))
            )
    return draw_panels(panels, columns=3, decorate=_without_markers)


def _curve(table: Sequence[Any], k: int) -> tuple[Sequence[float], ...]:
    means = np.array(table)[:, k, 0]
    spread = np.array(table)[:, k, 1]
    generations = np.arange(1, len(means) + 1)
    return tuple(column.tolist() for column in (generations, means, means - spread, means + spread))


def _without_markers(axes: "Axes", index: int) -> None:
    for line in axes.get_lines():
        line.set_marker("")


@house_style()
def _draw_stiffness(rows: Rows) -> "Figure":
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.6, 2.3), layout="constrained")
    for axes, name, colour in zip(
        figure.subplots(1, 2), ("published", "simplified"), (BLUE, VERMILLION), strict=True
    ):
        counts = np.sum([row["stiffness"][name] for row in rows], axis=0)
        width = 1 / len(counts)
        axes.bar((np.arange(len(counts)) + 0.5) * width, counts, width * 0.85, color=colour)
        axes.axvline(STIFF, color="black", linewidth=0.8, linestyle=(0, (4, 2)))
        axes.set_title(f"{name} ({counts.sum()} gaps)", loc="left", pad=3)
        axes.set(xlabel="stiffness", ylabel="gaps", xlim=(0, 1))
        axes.spines[["top", "right"]].set_visible(False)
    return figure
