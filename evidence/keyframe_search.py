"""What the authors' keyframe queries leave of recordings, and how fast.

Table 2 of Baak, Müller and Seidel (2008); the stiffness of their gaps (thesis, Fig. 3.9);
and what another stiffness loses or adds (2008, Fig. 11).
"""

import statistics
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from evidence.common.drawing import BLUE, VERMILLION, house_style, new_figure
from evidence.common.queries import RETRIEVAL_2008, index_of, manual_records, query_of
from evidence.common.recordings import EVERYTHING, Clip, Recordings, Results, clips_packed
from motionary.io import QueryRecord
from motionary.models.keyframes import KeyframeQuery, PostingIndex, search_query, select_in_index

TITLE = "Keyframe search, beside table 2 and figure 11 of 2008"
SPLIT = "none: the queries were written by the authors, who had seen the clips"
SEED = 0
DATA = EVERYTHING

#: Frames of 3.5 hours at 30 Hz.
PUBLISHED_FRAMES = 378_000
ROUNDS = 9
STIFFNESS = {"as written": None, "1": 1.0, "0.6": 0.6, "0": 0.0}


def measure(recordings: Recordings) -> Results:
    """Frames left and milliseconds of the 57 queries; the classes at hand by stiffness."""
    records = manual_records(recordings, RETRIEVAL_2008)
    names = recordings.golden("keyframe_confusion_recall.json")["classes"]
    sequences = clips_packed(recordings.clips) + list(recordings.others.values())
    n_frames = sum(map(len, sequences))
    small = index_of(sequences)
    large = index_of(sequences * (PUBLISHED_FRAMES // n_frames + 1))
    return {
        "frames": {"at hand": small.n_frames, "repeated": large.n_frames},
        "queries": {name: _query(records[name], small, large) for name in names},
        "stiffness": [value for name in names for value in records[name].stiffness],
        "classes": {
            name: _by_stiffness(records[name], name, recordings.clips)
            for name in recordings.classes
        },
    }


def _query(record: QueryRecord, small: PostingIndex, large: PostingIndex) -> dict[str, float]:
    query = query_of(record)
    around = select_in_index([query], record.template_length, small)
    return {
        "keyframes": len(query),
        "ranges": search_query(query, small).n_frames / small.n_frames,
        "around": around.n_frames / small.n_frames,
        "ms": _milliseconds(query, small),
        "ms, repeated": _milliseconds(query, large),
    }


def _milliseconds(query: KeyframeQuery, index: PostingIndex) -> float:
    """Median processor time of some runs, without a compiler."""
    seconds = []
    for _ in range(ROUNDS):
        start = time.process_time()
        search_query(query, index, engine="numpy")
        seconds.append(time.process_time() - start)
    return 1e3 * statistics.median(seconds)


def _by_stiffness(
    record: QueryRecord, name: str, clips: Sequence[Clip]
) -> dict[str, dict[str, Any]]:
    """Clips that are found with every gap as stiff as given."""
    index = index_of(clips_packed(clips))
    of_class = sum(clip.motion_class == name for clip in clips)
    result = {}
    for given, stiffness in STIFFNESS.items():
        ranges = search_query(query_of(record, stiffness=stiffness), index)
        found = [clips[i].motion_class for i in ranges.hit_sequences]
        right = found.count(name)
        result[given] = {
            "recall": right / of_class,
            "precision": right / len(found) if found else None,
            "frames": ranges.n_frames / index.n_frames,
            "false": dict(Counter(other for other in found if other != name).most_common(2)),
        }
    return result


def mean_of_classes(classes: Mapping[str, Any], given: str) -> dict[str, float]:
    """Means over the classes at a stiffness, and how many of them have no hit."""
    rows = [row[given] for row in classes.values()]
    return {
        key: float(np.mean([row[key] for row in rows if row[key] is not None]))
        for key in ("recall", "precision", "frames")
    } | {"missing": sum(row["recall"] == 0 for row in rows)}


def most_confused(classes: Mapping[str, Any], given: str) -> list[tuple[int, str, str]]:
    """The two most frequent mistakes: number, class of the query, class of the clips."""
    false = [
        (n, name, other)
        for name, row in classes.items()
        for other, n in row[given]["false"].items()
    ]
    return sorted(false, reverse=True)[:2]


def draw(results: Results) -> dict[str, Any]:
    """Histogram of the stiffness; recall and precision by class."""
    return {
        "keyframe_search_stiffness": _draw_histogram(results),
        "keyframe_search_recall": _draw_classes(results),
    }


@house_style()
def _draw_histogram(results: Results) -> Any:
    figure, axes = new_figure(1, 1, (4.2, 2.0))
    tenths = np.round(10 * np.array(results["stiffness"])).astype(int)
    axes[0].bar(np.arange(11) / 10, np.bincount(tenths, minlength=11), width=0.07, color=BLUE)
    axes[0].set(xlabel="stiffness", ylabel="gaps", xlim=(-0.05, 1.05), xticks=np.arange(11) / 10)
    return figure


@house_style()
def _draw_classes(results: Results) -> Any:
    figure, axes = new_figure(1, 2, (6.4, 2.4), sharey=True)
    places = np.arange(len(STIFFNESS))
    for ax, key, color in zip(axes, ("recall", "precision"), (BLUE, VERMILLION), strict=True):
        for row in results["classes"].values():
            values = [row[given][key] for given in STIFFNESS]
            ax.plot(places, [np.nan if v is None else v for v in values], color=color, alpha=0.35)
        mean = [mean_of_classes(results["classes"], given)[key] for given in STIFFNESS]
        ax.plot(places, mean, color=color, linewidth=2.4, marker="o", markersize=4)
        ax.set_xticks(places, STIFFNESS)
        ax.set_title(f"{key} of clips", loc="left", pad=3)
        ax.set(xlabel="stiffness of all gaps", ylim=(0, 1.04))
    return figure
