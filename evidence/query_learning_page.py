"""Page and pictures of learned queries, from their record."""

from typing import TYPE_CHECKING, Any

import numpy as np

from evidence.common.pages import fraction, picture, table
from evidence.common.recordings import ACTORS
from evidence.query_learning_tasks import Rows, head
from evidence.query_learning_words import (
    DECISIONS,
    INTRODUCTION,
    MISSING,
    SEEN_BEFORE,
    WAYS,
)
from motionary.plots.style import BLUE, VERMILLION, house_style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Results = dict[str, Any]

GROUPS = {"mm, tr": ("mm", "tr"), "bd, bk, dg": ("bd", "bk", "dg"), "all five": ACTORS}
SHOWN = ("f2", "f1", "precision", "recall", "frames left", "recall lost", "precision left")
STIFF = 0.8


def write(results: Results) -> str:
    """Body of the page."""
    rows = results["left_out"]
    parts = [INTRODUCTION, _targets(rows), SEEN_BEFORE, "## An actor never seen", WAYS]
    parts += [_unseen(title, actors, rows) for title, actors in GROUPS.items()]
    parts += [_classes(rows), _stiffness(rows), DECISIONS, MISSING]
    return "\n\n".join(parts)


def _of(rows: Rows, way: str, key: str) -> float:
    return float(np.mean([row["ways"][way][key] for row in rows]))


#: Measure, what it is called, what is wanted, and whether more is better.
AIMS = (
    ("f2", "F2 of clips found", 0.9, True),
    ("recall", "recall of clips found", 0.9, True),
    ("recall lost", "recall lost at τ = .06", 0.02, False),
    ("precision left", "precision at τ = .1", 0.9, True),
    ("frames left", "frames left", 0.15, False),
)


def _targets(rows: Rows) -> str:
    last_two = [row for row in rows if row["unseen"] in GROUPS["mm, tr"]]
    lines = []
    for key, what, limit, more in AIMS:
        value = _of(rows, "committee", key)
        lines.append(
            [
                what,
                fraction(value, 3),
                fraction(_of(last_two, "committee", key), 3),
                ("at least " if more else "at most ") + fraction(limit),
                "yes" if (value >= limit if more else value <= limit) else "no",
            ]
        )
    return "One actor left out, committee chosen without that actor:\n\n" + table(
        ["aim", "all five in turn", "mm and tr alone", "wanted", "all five reach it"], lines
    )


def _unseen(title: str, actors: tuple[str, ...], rows: Rows) -> str:
    mine = [row for row in rows if row["unseen"] in actors]
    settings = sorted({f"{row['unseen']}: {row['committee']}" for row in mine})
    body = table(
        ["queries", *map(head, SHOWN)],
        [
            [name, *(fraction(_of(mine, way, key), 3) for key in SHOWN)]
            for way, name in NAMES.items()
        ],
    )
    return (
        f"### Unseen: {title} ({len(mine)} classes and actors)\n\n{body}\n"
        f"Chosen without the actor: {'; '.join(settings)}. The template alone has "
        f"recall {fraction(_of(mine, 'committee', 'recall of the template'), 3)} at .06 and precision "
        f"{fraction(_of(mine, 'committee', 'precision of the template'), 3)} at .1. A published run "
        f"asks for {_entries(mine, 'published'):.0f} relations, a simplified one for "
        f"{_entries(mine, 'simplified'):.0f}."
    )


NAMES = {
    "random": "random search, one run",
    "published": "as published, one run",
    "combined": "as published, runs combined",
    "one run": "simplified, one run",
    "usual": "3 of 5 agree, the default",
    "committee": "committee chosen without the actor",
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
                fraction(_of(mine, "published", "f2")),
                *(fraction(_of(mine, "committee", key)) for key in SHOWN if key != "f1"),
            ]
        )
    titles = ["class", "published, F2", *(head(key) for key in SHOWN if key != "f1")]
    return (
        "### By class\n\nWith the committee chosen without the actor, means over the five "
        f"actors.\n\n{table(titles, body)}"
    )


def _stiffness(rows: Rows) -> str:
    fractions = []
    for name in ("published", "simplified"):
        counts = np.sum([row["stiffness"][name] for row in rows], axis=0)
        at_most = counts[: round(STIFF * len(counts))].sum() / counts.sum()
        fractions.append(f"{name} {fraction(float(at_most))}")
    return f"""## Stiffness of the gaps

{picture("query_learning_stiffness", "Stiffness of the gaps of all queries (thesis, Fig. 4.4)")}
Share of the gaps of at most .8: {", ".join(fractions)}; thesis: more than .87."""


def draw(results: Results) -> "dict[str, Figure]":
    """Like Fig. 4.4 of the thesis."""
    return {"query_learning_stiffness": _draw_stiffness(results["left_out"])}


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
