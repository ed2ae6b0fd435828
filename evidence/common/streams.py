"""Streams: clips of actors that nothing was learned from, between other motion.

Clips of two unseen actors alternate with motion that holds none of the classes: one
stream with segments of CMU (AMC), one with whole files of Bandai Namco (BVH). Features
are computed per recording before it is cut or joined, so that joins make no spikes.

Conventions: frames are those of features, 30 Hz; segments in seconds, half-open; seeded.
"""

import itertools
from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from evidence.common.recordings import ACTORS, Clip, Recordings, join
from motionary.evaluation import LabelledSegment
from motionary.features import FeatureSequence

PAIRS = tuple(itertools.combinations(ACTORS, 2))
#: Settings are chosen on these (every actor twice), and reported on the other five.
CHOOSING = (("bd", "bk"), ("bk", "dg"), ("dg", "mm"), ("mm", "tr"), ("bd", "tr"))
REPORTING = tuple(pair for pair in PAIRS if pair not in CHOOSING)

#: Segments of CMU, seconds, each looked at as stick figures: none shows one of the classes.
AMC_SEGMENTS: tuple[tuple[str, float, float, str], ...] = (
    ("cmu/01_01.amc", 8.4, 10.0, "turns around between jumps"),
    ("cmu/01_01.amc", 16.2, 17.5, "turns around between jumps"),
    ("cmu/07_01.amc", 0.0, 2.6, "walks"),
    ("cmu/07_04.amc", 0.0, 3.7, "walks slowly"),
    ("cmu/35_01.amc", 0.0, 3.0, "walks"),
    ("cmu/49_08.amc", 0.0, 4.79, "two cartwheels"),
    ("cmu/49_18.amc", 0.0, 9.2, "stands on one leg, arms spread, a dancer's pose"),
    ("cmu/86_01.amc", 0.0, 4.2, "stands, walks, begins to turn"),
    ("cmu/86_01.amc", 9.9, 26.3, "turns, walks, turns, boxes, walks"),
    ("cmu/86_01.amc", 34.1, 38.1, "boxes"),
    ("cmu/135_06.amc", 0.0, 27.2, "a karate form: stances, blocks, thrusts of the hands, no kick"),
)
#: Files of Bandai Namco that are used as a whole: names that begin so.
BVH_KINDS = ("bow_", "bye", "guide", "call", "respond", "dataset-2_wave")
#: Files that are in no stream, and hold none of the classes either: to choose thresholds by.
NEGATIVE_KINDS = ("walk", "punch", "slash", "dance-short", "dataset-2_raise", "dataset-2_walk")
#: Segments are cut to at most so much.
LONGEST_S = 6.0
KINDS = ("amc", "bvh")


class Stream(NamedTuple):
    """Features of a stream, and what is where.

    Attributes
    ----------
    packed : of all parts, one after the other
    truth : clips
    others : motion without the classes
    """

    packed: FeatureSequence
    truth: tuple[LabelledSegment, ...]
    others: tuple[LabelledSegment, ...]

    @property
    def seconds(self) -> float:
        """Length."""
        return len(self.packed) / 30

    def known_to(self, names: Sequence[str]) -> tuple[LabelledSegment, ...]:
        """Truth of some classes only: clips of the others are motion like any other."""
        return tuple(s for s in self.truth if s.name in names)


class Part(NamedTuple):
    """A piece of a stream; `name` is the class of a clip, or a recording."""

    name: str
    packed: FeatureSequence


def make_streams(
    recordings: Recordings, pair: tuple[str, str], *, seed: int, without: Collection[str] = ()
) -> dict[str, Stream]:
    """Stream of each kind, whose other motion is of no recording in `without`.

    As many clips, class by class and actor by actor in turn, as fit into the length of the
    other motion; no clip is in both streams.
    """
    rng = np.random.default_rng([seed, *(ACTORS.index(actor) for actor in pair)])
    pool: dict[tuple[str, str], list[Clip]] = {}
    for clip in recordings.of(actors=pair):
        pool.setdefault((clip.motion_class, clip.actor), []).append(clip)
    pool = {key: [own[i] for i in rng.permutation(len(own))] for key, own in pool.items()}
    streams = {}
    for kind in KINDS:
        others = other_motion(recordings, kind, without=without)
        room = sum(len(part.packed) for part in others)
        clips = _take(pool, room, rng)
        streams[kind] = _join(
            [clips[i] for i in rng.permutation(len(clips))],
            [others[i] for i in rng.permutation(len(others))],
            f"{'+'.join(pair)}, {kind}",
        )
    return streams


def clips_alone(recordings: Recordings, pair: tuple[str, str], *, seed: int) -> dict[str, Stream]:
    """All clips of two actors, one after the other, nothing between."""
    rng = np.random.default_rng([seed, *(ACTORS.index(actor) for actor in pair)])
    clips = [Part(c.motion_class, c.packed) for c in recordings.of(actors=pair)]
    shuffled = [clips[i] for i in rng.permutation(len(clips))]
    return {"clips": _join(shuffled, [], f"{'+'.join(pair)}, clips")}


def other_motion(recordings: Recordings, kind: str, *, without: Collection[str] = ()) -> list[Part]:
    """Motion without the classes, in pieces."""
    if kind == "bvh":
        return _bandai(recordings, BVH_KINDS)
    pieces = []
    for name, start_s, end_s, _ in AMC_SEGMENTS:
        if name in without:
            continue
        packed = recordings.others[name]
        first, stop = round(start_s * 30), min(round(end_s * 30), len(packed))
        n_pieces = int(np.ceil((stop - first) / 30 / LONGEST_S))
        edges = np.linspace(first, stop, n_pieces + 1).astype(int).tolist()
        pieces += [Part(name, packed.part(a, b)) for a, b in itertools.pairwise(edges)]
    return pieces


def negatives(recordings: Recordings) -> list[FeatureSequence]:
    """Recordings that are in no stream, without the classes."""
    return [part.packed for part in _bandai(recordings, NEGATIVE_KINDS)]


def _bandai(recordings: Recordings, kinds: tuple[str, ...]) -> list[Part]:
    return [
        Part(name, packed)
        for name, packed in sorted(recordings.others.items())
        if name.startswith("bandai/") and name.split("/")[1].startswith(kinds)
    ]


def _take(
    pool: Mapping[tuple[str, str], list[Clip]], room: int, rng: np.random.Generator
) -> list[Part]:
    """Clips that fit, taken out of the pool."""
    taken: list[Part] = []
    keys = list(pool)
    more = True
    while more:
        more = False
        for i in rng.permutation(len(keys)):
            own = pool[keys[i]]
            if own and len(own[-1].packed) <= room:
                clip = own.pop()
                room -= len(clip.packed)
                taken.append(Part(clip.motion_class, clip.packed))
                more = True
    return taken


def _join(clips: Sequence[Part], others: Sequence[Part], source: str) -> Stream:
    """Other motion in its order, clips spread evenly between."""
    gaps: list[list[Part]] = [[] for _ in range(len(others) + 1)]
    for i, clip in enumerate(clips):
        gaps[i % len(gaps)].append(clip)
    parts: list[tuple[Part, bool]] = []
    for i, gap in enumerate(gaps):
        parts += [(clip, True) for clip in gap]
        parts += [(other, False) for other in others[i : i + 1]]
    truth: list[LabelledSegment] = []
    between: list[LabelledSegment] = []
    at = 0
    for part, is_clip in parts:
        segment = LabelledSegment(part.name, at / 30, (at + len(part.packed)) / 30)
        (truth if is_clip else between).append(segment)
        at += len(part.packed)
    packed = join([part.packed for part, _ in parts], source)
    return Stream(packed, tuple(truth), tuple(between))
