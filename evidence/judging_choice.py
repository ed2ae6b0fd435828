"""How much should a wrong hit tell? Chosen apart from what is reported."""

from dataclasses import replace
from typing import Any

import numpy as np

from evidence.common.drawing import Panel, draw_panels
from evidence.common.examples import score_judged
from evidence.common.pages import claim, fraction, picture, table
from evidence.common.recordings import Recordings
from evidence.common.running import Evidence, Results, main
from evidence.growing_choice import SEED, choose_queries, describe_data, worlds_of
from motionary.retrieval.search import QueryExpansion

#: How much wrong hits tell; by a negative number they tell nothing.
PRIORS = {"right ones alone": -1.0, "3": 3.0, "10": 10.0, "30": 30.0}
JUDGED = 10
RIGHT = {"few": 8, "few and far": 4}


def measure(recordings: Recordings) -> Results:
    """Every prior in every world."""
    settings = {told: replace(QueryExpansion(), prior=prior) for told, prior in PRIORS.items()}
    worlds = worlds_of(recordings, choose_queries(recordings), RIGHT)
    return {name: score_judged(world, settings, n_hits=JUDGED) for name, world in worlds.items()}


def write(results: Results) -> str:
    """Body of the page."""
    return f"""
The first {JUDGED} hits of an example are judged by the truth (`--good`, `--bad`). The template is
learned from the right ones; an entry weighs by its surprise among the frames of the wrong ones,
beside which some frames of the collection at large are counted: how many is chosen here, with the
examples and worlds of [how far an example grows](growing_choice.md), none of which
[are reported](find_by_example.md). *Few* has {RIGHT["few"]} right recordings here, *few and far*
{RIGHT["few and far"]}. Over all recordings, as a person sees the next answer:

{_table(results, "all")}
{_finding(results)} On the recordings that were not judged, where anything right is left among them:

{_table(results, "left")}
{
        picture(
            "judging_choice",
            "Mean average precision over all recordings, by the frames of the collection at large",
        )
    }
The numbers were seen in a trial on the same examples before the measure over all recordings was
settled on: on what is left, where few queries count, more frames at large do as well.
"""


def _mean(results: Results, part: str, told: str) -> float:
    return float(np.mean([list(world[part][told].values()) for world in results.values()]))


def _table(results: Results, part: str) -> str:
    rows = [
        [told,
         *(fraction(world[part][told][key], 3) for world in results.values()
           for key in ("average_precision", "r_precision")),
         fraction(_mean(results, part, told), 3)]
        for told in ("before", *PRIORS)
    ]  # fmt: skip
    head = ["frames at large"]
    for name, world in results.items():
        queries = world["of"] if part == "all" else world["queries"]
        head += [f"{name}, {queries} queries: mAP", "R-precision"]
    return table([*head, "mean"], rows)


def _finding(results: Results) -> str:
    best = max(PRIORS, key=lambda told: _mean(results, "all", told))
    return claim(
        PRIORS[best] == QueryExpansion().prior,
        f"The best mean is that of {best}, the default; where much is right it does not matter, "
        "as hardly any hit is wrong.",
    )


def draw(results: Results) -> dict[str, Any]:
    """Average precision by the prior."""
    priors = [told for told, prior in PRIORS.items() if prior > 0]
    panels = [
        Panel(
            name,
            {
                what: (
                    [PRIORS[told] for told in priors],
                    [world["all"][told]["average_precision"] for told in chosen],
                )
                for what, chosen in {
                    "right and wrong ones told": priors,
                    "right ones alone": ["right ones alone"] * len(priors),
                    "before": ["before"] * len(priors),
                }.items()
            },
            "frames at large",
            "mean average precision",
            (0.7, 1.01),
        )
        for name, world in results.items()
    ]
    return {"judging_choice": draw_panels(panels, columns=3, size=(2.4, 1.8))}


EVIDENCE = Evidence(
    name="judging_choice",
    title="How much a wrong hit tells",
    split="clips that are no queries of the report; each is sought among other actors' clips",
    seed=SEED,
    describe_data=describe_data,
    measure=measure,
    write=write,
    draw=draw,
)

if __name__ == "__main__":
    main(EVIDENCE)
