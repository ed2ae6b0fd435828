"""Keyframes with few hits or none, which are looked for in every shard of an archive.

The archives are made as those of `archives`, of which these are smaller ones.
"""

import tempfile
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from evidence import archives
from evidence.archives import Memory, make_archives, source_of
from evidence.common.drawing import RULE, STYLES, house_style, new_figure
from evidence.common.recordings import EVERYTHING, Recordings, Results
from motionary.batch import Failure, map_ordered
from motionary.models.keyframes import parse_queries
from motionary.retrieval.search import search

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TITLE = "Rare keyframes in an archive: every shard is read"
SPLIT = archives.SPLIT
SEED = archives.SEED
DATA = EVERYTHING

SIZES = (10**6, 10**7, 4 * 10**7)
_GAP = ", then within 0.1 s "
_UP, _DOWN = "right hand above neck", "not right hand above neck"
_BENT = ("right hand above neck, right knee bent", "not right hand above neck, not right knee bent")
KEYFRAMES = {
    "frequent": archives.KEYFRAMES["frequent"],
    "few": _GAP.join([*_BENT, _BENT[0]]),
    "none": _GAP.join([_UP, _DOWN] * 3),
}
AGAIN = 5


def measure(recordings: Recordings) -> Results:
    """Times of queries in archives of each size."""
    with tempfile.TemporaryDirectory() as temporary:
        place = Path(temporary)
        make_archives(place, source_of(recordings), SIZES)
        sizes = {}
        for size in SIZES:
            (found,) = map_ordered(partial(_search_all, place=place), [size], jobs=2)
            if isinstance(found, Failure):
                raise found.error
            sizes[str(size)] = found
    return {"frames": SIZES[-1], "sizes": sizes, "keyframes": KEYFRAMES}


def _search_all(size: int, *, place: Path) -> Results:
    """Times of each query, first and again, in a process of its own."""
    archives.drop_cache(archives.index_of(place, size))
    rows = {}
    with Memory() as memory:
        collection = archives.open_archive(place, size)
        for name, text in KEYFRAMES.items():
            ask = partial(search, parse_queries(text), collection)
            result, first = archives.timed(ask)
            again = [archives.timed(ask)[1] for _ in range(AGAIN)]
            rows[name] = {
                "first": first,
                "s": min(one["s"] for one in again),
                "core_s": min(one["core_s"] for one in again),
                "hits": len(result),
                "worst": result[-1].cost if result else None,
            }
    return {"shards": len(collection.parts), "most_mb": memory.most_mb, "queries": rows}


def draw(results: Results) -> "dict[str, Figure]":
    """Time against frames."""
    return {"archives_rare": _draw(results["sizes"])}


@house_style()
def _draw(sizes: Results) -> "Figure":
    figure, (ax,) = new_figure(1, 1, (3.6, 2.9))
    frames = [int(size) for size in sizes]
    for number, name in enumerate(KEYFRAMES):
        core_s = [sizes[str(size)]["queries"][name]["core_s"] for size in frames]
        style = STYLES[number % len(STYLES)]
        ax.plot(frames, core_s, markersize=3, linewidth=1.1, label=name, **style)
    last = sizes[str(frames[-1])]["queries"]["none"]["core_s"]
    line = [last * size / frames[-1] for size in frames]
    ax.plot(frames, line, color=RULE, linestyle="--", linewidth=0.8, zorder=0)
    ax.set(xscale="log", yscale="log", xlabel="million frames", ylabel="seconds of one core, warm")
    ax.set_xticks(frames, [f"{size / 1e6:g}" for size in frames], minor=False)
    ax.set(ylim=(0.001, 1.0))
    ax.set_yticks([0.001, 0.01, 0.1, 1.0], ["0.001", "0.01", "0.1", "1"], minor=False)
    ax.minorticks_off()
    ax.legend(frameon=False, fontsize=6)
    return figure
