"""The time that queries save in annotation, and what labels lose.

As in Müller, Baak and Seidel (2009), section 6: features are there, classes and queries are
learned; timed is `annotate` as a whole: queries (searched in the packed features, without an
index), distance functions, matches, label assignment. Processor time of one process, the least
of several calls.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evidence.common.queries import (
    RETRIEVAL_2008,
    Committee,
    by_choosing,
    lesson_of,
    manual,
    with_queries,
)
from evidence.common.recordings import Recordings, Results, examples, join
from evidence.common.running import JOBS, timed
from motionary.features import SEQUENCE_HZ, FeatureSequence
from motionary.models.keyframes import select_in_sequence
from motionary.models.library import ClassLibrary, TrainingOptions, learn_classes, learn_queries
from motionary.models.query_learning import weighted_f
from motionary.retrieval.annotation import annotate
from motionary.retrieval.labelling import class_distance

TITLE = "Labels with and without keyframe queries: time and quality"
SPLIT = "the clips of bd, bk, dg and mm train; those of tr among other recordings are labelled"
SEED = 0
DATA = ("clips", "cmu", "bandai")

UNSEEN = "tr"
#: As long as the authors' evaluation database.
MINUTES = 74
ROUNDS = 2
#: No cost is so low: queries and distance functions alone are timed.
NO_MATCH = -1.0
SOURCES = {"all": ("cmu", "bandai"), "gestures": ("bandai",)}


class Material(NamedTuple):
    """A long recording, and the class of each frame; empty for other motion."""

    packed: FeatureSequence
    truth: NDArray[np.str_]


def measure(recordings: Recordings) -> Results:
    """Time and quality of labels, without queries and with those of several origins."""
    clips = [clip for clip in recordings.clips if clip.actor != UNSEEN]
    trained = examples(clips)
    classes = learn_classes(trained, training=TrainingOptions()).classes
    by_hand = manual(recordings, RETRIEVAL_2008)
    committees = {
        "picked": {
            one.name: by_choosing(
                lesson_of(clips, one.name)._replace(template=one.prototypes[0].template)
            )
            for one in classes
        },
        "manual": {one.name: Committee((by_hand[one.name],)) for one in classes},
    }
    libraries = {
        "nothing": ClassLibrary(classes),
        "learned": learn_queries(ClassLibrary(classes), trained, seed=SEED, jobs=JOBS).library,
    } | {way: ClassLibrary(with_queries(classes, own)) for way, own in committees.items()}
    materials = {name: make_material(recordings, sources) for name, sources in SOURCES.items()}
    result: dict[str, Any] = {}
    # Counted costs come last: their compiled kernel stays once it is loaded.
    for costs, names in (("weighed", SOURCES), ("counted", ["all"])):
        for name in names:
            material = materials[name]
            result[f"{costs}, {name}"] = {
                way: _time_and_score(_costs(one, costs), material) for way, one in libraries.items()
            }
    lengths = {name: len(material.packed) for name, material in materials.items()}
    fractions = {name: float(np.mean(m.truth != "")) for name, m in materials.items()}
    return {"ways": result, "frames": lengths, "of the classes": fractions}


def make_material(recordings: Recordings, sources: Sequence[str]) -> Material:
    """Clips of the unseen actor and all other motion, shuffled, over and over."""
    parts = [(clip.motion_class, clip.packed) for clip in recordings.clips if clip.actor == UNSEEN]
    parts += [
        ("", packed)
        for name, packed in sorted(recordings.others.items())
        if name.split("/")[0] in sources
    ]
    total = sum(len(packed) for _, packed in parts)
    parts *= int(np.ceil(MINUTES * 60 * SEQUENCE_HZ / total))
    order = np.random.default_rng(SEED).permutation(len(parts))
    chosen = [parts[i] for i in order]
    packed = join([part for _, part in chosen], "clips and other motion")
    truth = np.repeat([name for name, _ in chosen], [len(part) for _, part in chosen])
    return Material(packed, truth)


def _costs(library: ClassLibrary, costs: str) -> ClassLibrary:
    """Costs weighed by self-information, the default, or entries counted, as published."""
    if costs == "weighed":
        return library
    return ClassLibrary(tuple(replace(one, background=()) for one in library))


def _time_and_score(library: ClassLibrary, material: Material) -> dict[str, float]:
    packed = material.packed
    return _score(library, material) | {
        "frames left": float(np.mean([_fraction_left(one, packed) for one in library])),
        "seconds": _shortest(lambda: annotate(packed, library, assignment="published")),
        "seconds of matching": _shortest(
            lambda: [class_distance(packed, one, threshold=NO_MATCH) for one in library]
        ),
    }


def _fraction_left(one: Any, packed: FeatureSequence) -> float:
    (prototype,) = one.prototypes
    if not prototype.queries:
        return 1.0
    ranges = select_in_sequence(
        prototype.queries, prototype.template.n_columns, packed.packed, packed.known,
        votes=prototype.votes,
    )  # fmt: skip
    return ranges.n_frames / len(packed)


def _score(library: ClassLibrary, material: Material) -> dict[str, float]:
    """Precision of labelled frames, recall of the frames of the classes."""
    right = labelled = 0
    hit = np.zeros(len(material.truth), dtype=np.bool_)
    for label in annotate(material.packed, library, assignment="published"):
        span = slice(round(label.start_s * SEQUENCE_HZ), round(label.end_s * SEQUENCE_HZ))
        same = material.truth[span] == label.name
        right += int(np.count_nonzero(same))
        labelled += len(same)
        hit[span] |= same
    precision = right / max(labelled, 1)
    recall = int(np.count_nonzero(hit)) / int(np.count_nonzero(material.truth != ""))
    return {"precision": precision, "recall": recall, "f1": weighted_f(precision, recall, beta=1.0)}


def _shortest(call: Callable[[], object]) -> float:
    return min(timed(call)[1] for _ in range(ROUNDS))
