"""Each class of the library that ships: from whom, how good, what it is taken for."""

from collections import Counter
from functools import partial

from recipes.everyday import build_whole
from recipes.judging import judge_people
from recipes.sources import FOLDERS, read_sources

from evidence.common.recordings import Recordings, Results
from evidence.common.running import read_record
from motionary.models.library import load_everyday, thresholds_for

TITLE = "Classes of the library that ships"
SPLIT = "every person of HDM05, UI-PRMD and CMU is labelled by a library that learned without them"
SEED = 0
DATA = (("HDM05, UI-PRMD, CMU: all that the library is learned from", (424, 48.9)),)
_MOST = 3


def measure(recordings: Recordings) -> Results:
    """Of each class: templates, precision and recall by leaving people out, confusions."""
    library = load_everyday()
    sources = read_sources(recordings.folder, jobs=2)
    judged = judge_people(sources, partial(build_whole, sources), jobs=2)
    least = dict(zip(library.names, thresholds_for(library).tolist(), strict=True))
    classes = []
    for one in library:
        own = [p for p in one.prototypes if not p.mirror_of]
        right, wrong, taken, missed = 0, 0, Counter[str](), Counter[str]()
        shown = found = 0
        for item in judged:
            labels = [x for x in item.labels if x.score >= least[x.name]]
            mine = [x for x in labels if x.name == one.name]
            right += sum(x.is_right for x in mine)
            wrong += sum(not x.is_right for x in mine)
            taken[item.shows] += sum(not x.is_right for x in mine)
            if item.asked == one.name:
                shown += 1
                found += any(x.is_right for x in mine)
                missed += Counter({x.name for x in labels if not x.is_right})
        classes.append({
            "name": one.name, "kind": one.kind, "licence": one.licence,
            "least": least[one.name],
            "templates": [[p.name, p.template.provenance, p.template.n_columns / 30] for p in own],
            "right": right, "wrong": wrong, "shown": shown, "found": found,
            "taken": _most(taken), "missed": _most(missed),
        })  # fmt: skip
    people = {part: sorted({x.person for x in judged if x.part == part}) for part in FOLDERS}
    return {"classes": classes, "people": people, "minutes": sum(x.minutes for x in judged)}


def elsewhere(name: str) -> dict[str, list[int]]:
    """Files right and files of a class in each other set, as the page of the sets has them."""
    return {
        title: row
        for title, rows in read_record("everyday")["results"]["by_class"].items()
        for content, row in rows.items()
        if name in content.split(" or ")
    }


def _most(counts: Counter[str]) -> list[list[object]]:
    return [[name, n] for name, n in counts.most_common(_MOST) if n]
