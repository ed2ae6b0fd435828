"""What one example of other sets finds in everything: ACCAD and rigs as queries.

Recordings are ranked by their smallest cost, never the example's own.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from recipes.judging import SHOWN
from recipes.sources import CLIPS, EXERCISES, FOLDERS, GAITS, read_rows

from evidence.common.contents import BANDAI, RIGS, accad_contents, named_contents
from evidence.common.recordings import Recordings, Results
from motionary.features import FeatureSequence, load_everyday_set, read_features
from motionary.io import name_recordings
from motionary.retrieval.index import Collection
from motionary.retrieval.search import QueryExpansion, RelevanceFeedback
from motionary.retrieval.search.examples import ExampleMatches

TITLE = "One example of another set among everything"
SPLIT = (
    "examples are of ACCAD and the rigs, from whom nothing was learned; all sets are searched. "
    "Windows were chosen on ACCAD's Male1 among others, Male2 and the rigs set nothing"
)
SEED = 0
DATA = (
    ("HDM05, UI-PRMD, CMU: all that the library is learned from", (424, 48.9)),
    ("ACCAD Open Motion Project, CC BY 3.0, Male1 and Male2", (217, 18.7)),
    "bandai",
    ("two rigs of AnimatedDrawings, MIT", (2, 0.2)),
)
SETS = (*FOLDERS, "accad", "bandai", "rigs")
N_FIRST = 3
#: First recordings of other sets that the table calls wrong, as they look beside the example.
LOOKED = (
    ("Male1_B22_SideStepLeft", "HDM_tr_throwBasketball_012_120",
     "both stand most of the time and take one small step; the ball is thrown in between"),
    ("Male1_C24_QuickSideStepLeft", "jumping",
     "a leap aside out of a squat and into one; the rig squats, leaps up and squats"),
    ("Male2_C24_QuickSidestepLeft", "jumping", "the same, by the other man"),
    ("Male2_C25_QuickSidestepRight", "HDM_bk_kickLFront1Reps_010_120",
     "a wide step to the side and a long stand; a kick and a long stand on crossed feet"),
    ("Male2_E10_BodyHookRight", "walk-back_active_001",
     "fists before the chest throughout; the hands of who walks backwards are there too"),
    ("Male2_E10_SideStepRight", "kick_normal_001",
     "a small step within a boxer's guard; the kicks begin and end in such a guard"),
    ("Male2_E13_BodyCrossLeft", "dance-short_normal_001",
     "a low blow out of a lunge; a minute of dance holds lunges"),
    ("Male2_E15_BodyJabRight", "m04_s06", "guard and a lunge; side lunges with both fists up"),
    ("Male2_E5_HookLeft", "HDM_dg_kickLFront1Reps_013_120",
     "fists up throughout; the kick is done in a boxer's guard"),
    ("Male2_E9_SideStepLeft", "m04_s06", "steps in a guard; side lunges with both fists up"),
    ("Male2_G10_RoundhouseLeadingLeft", "punch_normal_001",
     "a third of the file is the kick, the rest a guard as that of the boxer"),
    ("Male2_G2_FrontKick", "walk-right_active_001",
     "half a second of kick between long guards; a fast walk with bent elbows"),
    ("Male2_G19_ReverseSpinCrescentLeft", "slash_normal_002",
     "a spin with a high leg between two guards; a sword held in both hands"),
    ("Male2_G7_Capoeira", "05_07", "hands on the floor, leg over the head; a dancer's leg as high"),
)  # fmt: skip


class Item(NamedTuple):
    """A recording, what it shows, and whether that is all that it shows."""

    part: str
    name: str
    sequence: FeatureSequence
    shows: frozenset[str]
    is_whole: bool


def measure(recordings: Recordings) -> Results:
    """The first recordings of each example: of all sets, and of the other sets alone."""
    items = read_all(recordings.folder)
    rows = [
        _row(item, [other for other in items if other is not item])
        for item in items
        if item.part in ("accad", "rigs") and item.is_whole
    ]
    return {
        "searched": Counter(item.part for item in items),
        "minutes": sum(len(item.sequence) for item in items) / 1800,
        "counts": {key: _count(rows, key) for key in ("everything", "other sets")},
        "rows": rows,
    }


def read_all(folder: Path) -> list[Item]:
    """Every recording that can be read, over the everyday set of features."""
    shown, items = _shown(folder), []
    for part in SETS:
        files = [
            (name, path)
            for name, path in name_recordings(folder / part).items()
            if not name.startswith("incorrect/")
        ]
        read = read_features(files, feature_set=load_everyday_set(), jobs=2)
        for (name, path), sequence in zip(files, read, strict=True):
            key = path.stem if part == "accad" else name
            if isinstance(sequence, FeatureSequence) and (part, key) in shown:
                items.append(Item(part, path.stem, sequence, *shown[part, key]))
    return items


def _shown(folder: Path) -> dict[tuple[str, str], tuple[frozenset[str], bool]]:
    """Contents of each recording in names of the library that ships."""
    found: dict[tuple[str, str], tuple[frozenset[str], bool]] = {}
    for name in name_recordings(folder / "hdm05"):
        clip = name.split("/")[0]
        found["hdm05", name] = _by_class(CLIPS.get(clip) or GAITS[clip][0])
    for row in read_rows(folder / "ui_prmd" / "repetitions.csv"):
        found["ui_prmd", row["recording"]] = _by_class(EXERCISES.get(row["label"], row["label"]))
    for row in read_rows(folder / "cmu_everyday" / "descriptions.csv"):
        found["cmu_everyday", f"{row['trial']}.amc"] = _by_class(row["description"])
    for name, contents in accad_contents(folder / "accad" / "contents.csv").items():
        names = frozenset(x for asked in contents.asked for x in asked)
        found["accad", name] = names, contents.is_whole
    for part, table in (("bandai", BANDAI), ("rigs", RIGS)):
        for name in name_recordings(folder / part):
            asked = named_contents(name, table).asked
            found[part, name] = frozenset(x for names in asked for x in names), True
    return found


def _by_class(shows: str) -> tuple[frozenset[str], bool]:
    return frozenset(SHOWN.get(shows, (shows,))), True


def _row(query: Item, others: Sequence[Item]) -> Results:
    feedback = RelevanceFeedback(query.sequence)
    collection = Collection(tuple(one.sequence for one in others), load_everyday_set())
    costs = ExampleMatches(feedback, collection, QueryExpansion()).smallest
    order = [others[i] for i in np.argsort(costs, kind="stable")]
    parts = {"everything": order, "other sets": [x for x in order if x.part != query.part]}
    return {"query": query.name, "part": query.part, "shows": sorted(query.shows)} | {
        key: {
            "relevant": sum(bool(one.shows & query.shows) for one in ranked),
            "of": len(ranked),
            "first": [
                [one.part, one.name, sorted(one.shows), bool(one.shows & query.shows)]
                for one in ranked[:N_FIRST]
            ],
        }
        for key, ranked in parts.items()
    }


def _count(rows: Sequence[Mapping[str, Results]], key: str) -> Results:
    """Of the examples that something right exists for: right ones in first places."""
    asked = [row[key] for row in rows if row["shows"] and row[key]["relevant"]]
    right = [[hit[3] for hit in own["first"]] for own in asked]
    return {
        "examples": len(asked),
        "first": sum(own[0] for own in right),
        "of_three": sum(map(sum, right)),
        "any_of_three": sum(map(any, right)),
        "chance": sum(own["relevant"] / own["of"] for own in asked) / max(len(asked), 1),
    }
