"""How much time do queries save in annotation, and what do labels lose?

As in Müller, Baak and Seidel (2009), section 6: words are there, classes and queries are
learned; timed is `annotate` as a whole: queries (read from the words, without an index),
distance functions, reading of matches, decision between classes. Processor time of one
process, the least of several calls.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evidence.common.recordings import Clip, Recordings, examples
from evidence.query_learning_choice import breeding_of
from evidence.query_learning_tasks import split
from motionary.annotation import annotate, class_distance
from motionary.features import FULL_BODY, WORD_HZ, FeatureSequence
from motionary.keyframes import KeyframeQuery, choose_query, select_in_words
from motionary.library import ClassLibrary, Teaching, learn_classes, learn_queries
from motionary.query_learning.fitness import weighted_f

UNSEEN = "tr"
#: As long as the authors' evaluation database.
MINUTES = 74
ROUNDS = 3
#: No cost is so low: queries and distance functions alone are timed.
NO_MATCH = -1.0
SOURCES = {"all": ("cmu", "bandai"), "gestures": ("bandai",)}


class Material(NamedTuple):
    """A long recording, and the class of each frame; empty for other motion."""

    words: FeatureSequence
    truth: NDArray[np.str_]


def measure_speed(
    recordings: Recordings,
    setting: dict[str, int],
    manual: Mapping[str, KeyframeQuery],
    *,
    seed: int,
    jobs: int,
) -> dict[str, Any]:
    """Time and quality of labels, without queries and with those of several origins."""
    clips = [clip for clip in recordings.clips if clip.actor != UNSEEN]
    library = learn_classes(examples(clips), teaching=Teaching()).classes
    libraries = {
        "learned": _learned(ClassLibrary(library), clips, setting, seed=seed, jobs=jobs),
        "picked": _with(library, _picked(library, clips)),
        "manual": _with(library, manual),
    }
    materials = {
        name: make_material(recordings, sources, seed=seed) for name, sources in SOURCES.items()
    }
    result: dict[str, Any] = {}
    # Counted costs come last: their compiled kernel stays once it is loaded.
    for costs in ("weighed", "counted"):
        for name, material in materials.items():
            result[f"{costs}, {name}"] = {
                way: _time_and_score(_costs(one, costs), material)
                for way, one in {"nothing": ClassLibrary(library), **libraries}.items()
            }
    lengths = {name: len(material.words) for name, material in materials.items()}
    shares = {name: float(np.mean(m.truth != "")) for name, m in materials.items()}
    return {"ways": result, "frames": lengths, "of the classes": shares}


def make_material(recordings: Recordings, sources: Sequence[str], *, seed: int) -> Material:
    """Clips of the unseen actor and all other motion, shuffled, over and over."""
    parts = [(clip.motion_class, clip.words) for clip in recordings.clips if clip.actor == UNSEEN]
    parts += [
        ("", words)
        for name, words in sorted(recordings.others.items())
        if name.split("/")[0] in sources
    ]
    total = sum(len(words) for _, words in parts)
    parts *= int(np.ceil(MINUTES * 60 * WORD_HZ / total))
    order = np.random.default_rng(seed).permutation(len(parts))
    chosen = [parts[i] for i in order]
    words = FeatureSequence(
        np.concatenate([part.words for _, part in chosen]),
        np.concatenate([part.known for _, part in chosen]),
        FULL_BODY,
        "clips and other motion",
    )
    truth = np.repeat([name for name, _ in chosen], [len(part) for _, part in chosen])
    return Material(words, truth)


def _learned(
    library: ClassLibrary,
    clips: Sequence[Clip],
    setting: dict[str, int],
    *,
    seed: int,
    jobs: int,
) -> ClassLibrary:
    queried = learn_queries(
        library, examples(clips), breeding=breeding_of(setting["copies"]), seed=seed,
        runs=setting["queries"], jobs=jobs,
    ).library  # fmt: skip
    return ClassLibrary(
        tuple(
            replace(
                one, subclasses=tuple(replace(s, votes=setting["votes"]) for s in one.subclasses)
            )
            for one in queried
        )
    )


def _picked(library: Sequence[Any], clips: Sequence[Clip]) -> dict[str, KeyframeQuery]:
    """One query a class, chosen from the same examples without evolution."""
    queries = {}
    for one in library:
        taught = split(clips, one.name, {clip.actor for clip in clips})
        template = one.subclasses[0].template
        queries[one.name] = choose_query(template, taught.positives, taught.negatives).query
    return queries


def _with(library: Sequence[Any], queries: Mapping[str, KeyframeQuery]) -> ClassLibrary:
    return ClassLibrary(
        tuple(
            replace(
                one,
                subclasses=tuple(replace(s, queries=(queries[one.name],)) for s in one.subclasses),
            )
            for one in library
        )
    )


def _costs(library: ClassLibrary, costs: str) -> ClassLibrary:
    """Costs weighed by surprise, the package's default, or entries counted, as published."""
    if costs == "weighed":
        return library
    return ClassLibrary(tuple(replace(one, background=()) for one in library))


def _time_and_score(library: ClassLibrary, material: Material) -> dict[str, float]:
    words = material.words
    return _score(library, material) | {
        "frames left": float(np.mean([_share_left(one, words) for one in library])),
        "seconds": _shortest(lambda: annotate(words, library)),
        "seconds of matching": _shortest(
            lambda: [class_distance(words, one, threshold=NO_MATCH) for one in library]
        ),
    }


def _share_left(one: Any, words: FeatureSequence) -> float:
    (subclass,) = one.subclasses
    if not subclass.queries:
        return 1.0
    ranges = select_in_words(
        subclass.queries, subclass.template.n_columns, words.words, words.known,
        votes=subclass.votes,
    )  # fmt: skip
    return ranges.n_frames / len(words)


def _score(library: ClassLibrary, material: Material) -> dict[str, float]:
    """Precision of labelled frames, recall of the frames of the classes."""
    right = labelled = 0
    hit = np.zeros(len(material.truth), dtype=np.bool_)
    for label in annotate(material.words, library):
        span = slice(round(label.start_s * WORD_HZ), round(label.end_s * WORD_HZ))
        same = material.truth[span] == label.name
        right += int(np.count_nonzero(same))
        labelled += len(same)
        hit[span] |= same
    precision = right / max(labelled, 1)
    recall = int(np.count_nonzero(hit)) / int(np.count_nonzero(material.truth != ""))
    return {
        "precision": precision,
        "recall": recall,
        "f1": weighted_f(precision, recall, beta=1.0),
    }


def _shortest(call: Callable[[], object]) -> float:
    seconds = []
    for _ in range(ROUNDS):
        start = time.process_time()
        call()
        seconds.append(time.process_time() - start)
    return min(seconds)
