"""Labels of streams by scores, beside the decision by costs that was the default before."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from recipes.sources import read_sources

from evidence.common.labelling import Labelled
from evidence.common.labelling import measure as measure_labels
from evidence.common.recordings import Recordings, Results, examples
from evidence.common.streams import AMC_SEGMENTS, Stream, make_streams
from motionary.evaluation import LabelledSegment
from motionary.features import FeatureSequence
from motionary.models.library import ClassLibrary, learn
from motionary.retrieval.annotation import annotate

TITLE = "Labels of streams: by scores, and by costs"
SPLIT = (
    "HDM05's bd, bk, dg train, streams of mm and tr are labelled; other motion between is of "
    "CMU's 01, 49, 86, 135 and Bandai's active and old styles; motion in general is of CMU's 02, "
    "05, 07, 16, 35"
)
SEED = 12
DATA = ("clips", "cmu", "bandai")
TEACHERS, TESTED = ("bd", "bk", "dg"), ("mm", "tr")
#: CMU's people of whom settings were chosen.
DEVELOPMENT = ("02", "05", "07", "16", "35")
N_STREAMS, N_DRAWS, N_KNOWN = 2, 3, 6
#: Ways to label: of which library, and how.
WAYS: Mapping[str, tuple[str, dict[str, Any]]] = {
    "by scores, default": ("plain", {"assignment": "scores"}),
    "by scores, a template of each person beside, least score 6.5": (
        "by person", {"assignment": "scores", "threshold": 6.5},
    ),
    "by costs by self-information, .06 (default before)": (
        "plain", {"assignment": "published"},
    ),
    "by costs by self-information, .08": ("plain", {"assignment": "published", "threshold": 0.08}),
    "by costs all alike, .06, as published": ("equal", {"assignment": "published"}),
    "by costs all alike, .03": ("equal", {"assignment": "published", "threshold": 0.03}),
}  # fmt: skip


def measure(recordings: Recordings) -> Results:
    """F of frames and segments, and false labels a minute: all eleven known, and six."""
    sources = read_sources(recordings.folder, jobs=2)
    takes = sources.sequences["cmu_everyday"]
    general = [take for name, take in takes.items() if name[:2] in DEVELOPMENT]
    streams = _streams(recordings)
    rng = np.random.default_rng(SEED)
    classes = recordings.classes
    draws = [tuple(sorted(rng.permutation(classes)[:N_KNOWN].tolist())) for _ in range(N_DRAWS)]
    return {
        "all 11": _measure(recordings, streams, [tuple(classes)], general),
        "6 of 11": _measure(recordings, streams, draws, general),
        "draws": draws,
        "seconds": [round(stream.seconds) for stream in streams],
        "clips": [len(stream.truth) for stream in streams],
    }


def _streams(recordings: Recordings) -> list[Stream]:
    """Streams of the tested people between motion of people who set nothing."""
    others = {name: x for name, x in recordings.others.items() if "_normal_" not in name}
    chosen = {name for name, *_ in AMC_SEGMENTS if Path(name).name[:2] in DEVELOPMENT}
    reported = replace(recordings, others=others)
    return [
        stream
        for seed in range(SEED, SEED + N_STREAMS)
        for stream in make_streams(reported, TESTED, seed=seed, without=chosen).values()
    ]


def _measure(
    recordings: Recordings,
    streams: Sequence[Stream],
    draws: Sequence[Sequence[str]],
    general: Sequence[FeatureSequence],
) -> Results:
    labelled: dict[str, list[Labelled]] = {way: [] for way in WAYS}
    for names in draws:
        clips = [c for c in recordings.of(actors=TEACHERS) if c.motion_class in names]
        plain = learn(examples(clips), negatives=general)
        libraries = {
            "plain": plain,
            "equal": learn(examples(clips), negatives=general, by_self_information=False),
            "by person": learn(
                examples(clips), negatives=general, groups="HDM_(..)_", per_group=True
            ),
        }
        for way, (kind, options) in WAYS.items():
            labelled[way] += [_label(stream, names, libraries[kind], options) for stream in streams]
    return {way: measure_labels(own) for way, own in labelled.items()}


def _label(
    stream: Stream, names: Sequence[str], library: ClassLibrary, options: dict[str, Any]
) -> Labelled:
    track = annotate(stream.packed, library, **options)
    found = [LabelledSegment(x.name, x.start_s, x.end_s) for x in track]
    return Labelled(found, stream.known_to(names), stream.seconds)
