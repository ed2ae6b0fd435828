"""Ranking by an example between people and styles: windows of ranked quantities.

The example is cut into windows of 2 s every second; each is looked for by itself in the features
of `load_everyday_set`, played up to three times as fast or as slow. A hit costs the mean over
the windows, each where it fits best within three lengths of the example. To that comes what
the published features say: the template of query expansion, where the windows fit best.
Where the example goes through the room throughout, how it goes counts for three tenths, and
the published features, which know no direction, for little. Recordings in which windows from
anywhere in the collection fit well are put further off (hubs). Settings were chosen on
recordings that docs/evidence/styles.md does not report.

Conventions: windows are compared at 10 Hz (`matching.corpus`), hits are given at 30 Hz.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter1d

from motionary.batch import Failure, Workers, map_ordered
from motionary.features import SEQUENCE_HZ, FeatureSequence, load_everyday_set
from motionary.features.everyday import TRAVEL
from motionary.matching import Alignment, Pattern, align, distance_function
from motionary.matching.corpus import (
    LONGEST_STEP,
    THINNING,
    FeatureWindow,
    ThinCorpus,
    window_distance,
    window_path,
)
from motionary.packing import PackedFeatures, pack
from motionary.retrieval.index import Collection, Shard, StoredShard

Floats = NDArray[np.float64]
Single = NDArray[np.float32]

#: Of the frames of an example that goes throughout, so many go faster than most everyday motion.
_TRAVELS_FROM = 0.85
# Distances of the windows of more frames than that would fill the memory.
_KEPT_FRAMES = 1 << 26
_TRAVELS_BY = "body goes along the floor over 0.5 s>60"


@dataclass(frozen=True, slots=True)
class WindowSettings:
    """How an example is compared by windows.

    Attributes
    ----------
    window_s, hop_s : length of a window, and from one to the next
    most_cost : what a window costs that fits nowhere
    reach : windows of a hit lie within so many lengths of the example
    travel : part of root velocity and turning, where the example goes throughout
    published, published_travelling : weight of the published features beside the windows', 1;
        the second where the example goes throughout
    candidates : recordings, best first, in which the published features are compared
    hub, samples : power of the correction of recordings in which many windows fit, and how many
        windows of the collection say so
    """

    window_s: float = 2.0
    hop_s: float = 1.0
    most_cost: float = 0.6
    reach: float = 3.0
    travel: float = 0.3
    published: float = 0.5
    published_travelling: float = 0.2
    candidates: int = 300
    hub: float = 0.5
    samples: int = 16


class Place(NamedTuple):
    """Where the windows fit in a recording.

    Attributes
    ----------
    number : of the recording in its collection
    start, stop : frames at 30 Hz, half-open
    cost : mean of the windows
    """

    number: int
    start: int
    stop: int
    cost: float


def travels(example: FeatureSequence) -> bool:
    """Whether the body goes through the room throughout."""
    column = example.feature_set.ids.index(_TRAVELS_BY)
    seen = example.known_features[:, column].astype(np.bool_)
    going = example.features[seen, column]
    return len(going) > 0 and float(going.mean()) >= _TRAVELS_FROM


def windows_of(
    examples: Sequence[FeatureSequence], *, travelling: bool, settings: WindowSettings
) -> list[FeatureWindow]:
    """Windows of examples over the everyday set."""
    groups = np.array([feature.group == TRAVEL for feature in load_everyday_set().features])
    heavy = pack(groups[np.newaxis])[0]
    extra = 0.0
    if travelling:
        n_heavy, n_light = np.count_nonzero(groups), np.count_nonzero(~groups)
        extra = settings.travel / (1 - settings.travel) * n_light / n_heavy - 1
    width = round(settings.window_s * SEQUENCE_HZ / THINNING)
    hop = round(settings.hop_s * SEQUENCE_HZ / THINNING)
    return [
        FeatureWindow(packed[a : a + width], known[a : a + width], heavy, extra)
        for packed, known in ((e.packed[::THINNING], e.known[::THINNING]) for e in examples)
        for a in _starts(len(packed), width, hop)
    ]


def sample_windows(
    collection: Collection, *, travelling: bool, settings: WindowSettings
) -> list[tuple[int, FeatureWindow]]:
    """Windows evenly spread over a collection, each with the number of its recording."""
    lengths = np.zeros(len(collection), dtype=np.int64)
    for part in collection.parts:
        lengths[part.numbers] = part.shard.lengths
    ends, width = np.cumsum(lengths), round(settings.window_s * SEQUENCE_HZ)
    sampled = []
    for at in ((np.arange(settings.samples) + 0.5) / settings.samples * ends[-1]).astype(np.int64):
        number = int(np.searchsorted(ends, at, side="right"))
        n_frames = int(lengths[number])
        start = max(min(int(at - ends[number]) + n_frames, n_frames - width), 0)
        part_of = collection.sequences[number].part(start, min(start + width, n_frames))
        (window,) = windows_of([part_of], travelling=travelling, settings=settings)
        sampled.append((number, window))
    return sampled


def smallest_costs(window: FeatureWindow, collection: Collection) -> Floats:
    """Cost of a window where it fits best in each recording, shape (recordings,); at most 1."""
    smallest = np.empty(len(collection))
    for part in collection.parts:
        thin = part.shard.thinned
        smallest[part.numbers] = _least(window_distance(window, thin), thin, most=1.0)
    return smallest


def _least(distance: Single, thin: ThinCorpus, *, most: float) -> Single:
    """Smallest distance in each sequence, or `most`, shape (sequences,)."""
    # Sequences without frames begin past the end.
    padded = np.append(np.minimum(distance, np.float32(most)), np.float32(most))
    return np.minimum.reduceat(padded, thin.starts)


class _Curves(NamedTuple):
    """Distances of windows in some sequences.

    Attributes
    ----------
    thin : the sequences
    distances : of each window, at most what one costs that fits nowhere
    """

    thin: ThinCorpus
    distances: Sequence[Single]

    @classmethod
    def of(cls, windows: Sequence[FeatureWindow], thin: ThinCorpus, most: float) -> "_Curves":
        return cls(thin, [np.minimum(window_distance(w, thin), most) for w in windows])

    def curve(self, place: int, reach: int, most: float) -> Floats:
        """Cost by the frame at which a place ends, in one sequence."""
        inside = slice(self.thin.starts[place], self.thin.starts[place] + self.thin.lengths[place])
        total = np.zeros(int(self.thin.lengths[place]))
        for distance in self.distances:
            total += _before(distance[inside], reach, most)
        return total / len(self.distances)

    def smallest(self, reach: int, most: float) -> Floats:
        """Cost of the best place of every sequence."""
        least = np.zeros(len(self.thin.starts))
        for distance in self.distances:
            least += _least(distance, self.thin, most=most)
        least /= len(self.distances)
        # Where windows may lie too far apart, the place has to be looked for.
        for i in np.flatnonzero((self.thin.lengths > reach) & (len(self.distances) > 1)):
            least[i] = self.curve(int(i), reach, most).min(initial=least.max())
        return least


def _before(distance: Single, reach: int, most: float) -> Single:
    """Smallest distance at a frame or within reach before it."""
    size = min(reach, len(distance))
    if size <= 1:
        return distance
    result: Single = minimum_filter1d(
        distance, size, origin=(size - 1) // 2, mode="constant", cval=most
    )
    return result


def _smallest_in(
    shard: Shard | StoredShard, *, windows: Sequence[FeatureWindow], reach: int, most: float
) -> Floats:
    return _Curves.of(windows, shard.open().thinned, most).smallest(reach, most)


class WindowMatches:
    """Costs of windows in a collection, computed once for any ranking.

    Parameters
    ----------
    windows : at least one
    collection : over the everyday set
    n_frames : of the example, at 30 Hz
    settings : of the comparison
    jobs : who compares; only where this process does, and the collection is not too large for
        that, all distances are kept, and otherwise computed again where they are needed
    """

    def __init__(
        self,
        windows: Sequence[FeatureWindow],
        collection: Collection,
        *,
        n_frames: int,
        settings: WindowSettings,
        jobs: Workers = 1,
    ) -> None:
        self._windows, self._collection, self._settings = windows, collection, settings
        self._example = -(-n_frames // THINNING)
        self._most = settings.most_cost
        self._reach = 1 if len(windows) == 1 else max(1, round(settings.reach * self._example))
        self._jobs = jobs
        self._keeps = jobs == 1 and collection.n_frames <= _KEPT_FRAMES
        # By the number of a part where distances are kept, otherwise of a recording.
        self._curves: dict[int, _Curves] = {}

    @cached_property
    def smallest(self) -> Floats:
        """Cost of the best place of every recording, shape (recordings,); at most `most_cost`."""
        smallest = np.full(len(self._collection), self._most)
        parts = self._collection.parts
        if self._keeps:
            for number, part in enumerate(parts):
                curves = self._curves_of_part(number)
                smallest[part.numbers] = curves.smallest(self._reach, self._most)
            return smallest
        work = partial(_smallest_in, windows=self._windows, reach=self._reach, most=self._most)
        shards = [part.shard.handle() for part in parts]
        for part, found in zip(parts, map_ordered(work, shards, jobs=self._jobs), strict=True):
            if isinstance(found, Failure):
                raise found.error
            smallest[part.numbers] = found
        return smallest

    def _curves_of_part(self, number: int) -> _Curves:
        if number not in self._curves:
            thin = self._collection.parts[number].shard.thinned
            self._curves[number] = _Curves.of(self._windows, thin, self._most)
        return self._curves[number]

    def _curves_at(self, number: int) -> tuple[_Curves, int]:
        """Distances in a recording, and its place among their sequences."""
        part, place = self._collection.locate(number)
        if self._keeps:
            return self._curves_of_part(part), place
        if number not in self._curves:
            thin = self._collection.parts[part].shard.thin_one(place)
            self._curves[number] = _Curves.of(self._windows, thin, self._most)
        return self._curves[number], 0

    def region(self, number: int) -> tuple[int, int]:
        """Frames at 30 Hz, half-open, around the best place of a recording."""
        curve = self.curve(number)
        return self._region(int(np.argmin(curve)), len(self._collection.sequences[number]))

    def places(self, number: int) -> Iterator[Place]:
        """Places in a recording, the best first, that do not repeat each other."""
        curve = self.curve(number).copy()
        taken: list[Place] = []
        while len(curve) and curve.min() < self._settings.most_cost - 1e-6:
            end = int(np.argmin(curve))
            place = self._place(number, end, float(curve[end]))
            half = max((place.stop - place.start) // (2 * THINNING), 1)
            is_new = not any(repeats(place, other) for other in taken)
            reach = half if is_new else 1
            curve[max(end - reach, 0) : end + reach + 1] = np.inf
            if is_new:
                taken.append(place)
                yield place

    def curve(self, number: int) -> Floats:
        """Cost by the frame at 10 Hz at which a place ends."""
        curves, place = self._curves_at(number)
        return curves.curve(place, self._reach, self._most)

    def _region(self, end: int, n_frames: int) -> tuple[int, int]:
        first = end - self._reach - 3 * max(len(window) for window in self._windows)
        return max(THINNING * first, 0), min(THINNING * (end + self._example), n_frames)

    def _place(self, number: int, end: int, cost: float) -> Place:
        (thin, distances), place = self._curves_at(number)
        begin = int(thin.starts[place])
        earliest = max(begin, begin + end - self._reach + 1)
        first, last = begin + end, begin
        for window, distance in zip(self._windows, distances, strict=True):
            at = earliest + int(np.argmin(distance[earliest : begin + end + 1]))
            if distance[at] < self._settings.most_cost:
                # A path is at most so long.
                reached = max(begin, at - LONGEST_STEP * len(window))
                first = min(first, int(window_path(window, thin, reached, at)[0]))
                last = max(last, at)
        n_frames = len(self._collection.sequences[number])
        start, stop = THINNING * (first - begin), THINNING * (last - begin + 1)
        return Place(number, start, min(stop, n_frames), cost)


def published_path(pattern: Pattern, sequence: FeatureSequence, place: Place) -> Alignment:
    """How the published template meets the frames of a place.

    Where no path fits, as what is played at less than half the tempo, columns meet frames
    evenly.
    """
    start, stop = place.start, place.stop
    packed, known = sequence.packed[start:stop], sequence.known[start:stop]
    distance = distance_function(pattern, packed, known)
    end = int(np.argmin(distance))
    if np.isfinite(distance[end]):
        (path,) = align(pattern, packed, known, [end])
        return path.shifted(start)
    columns = np.arange(len(pattern))
    frames = np.linspace(start, stop - 1, len(pattern)).round().astype(np.intp)
    return Alignment(start, stop - 1, 1.0, np.column_stack([columns, frames]))


def find_equal(example: FeatureSequence, sequence: FeatureSequence, place: Place) -> Place | None:
    """Where a recording shows exactly what the example shows, near a place."""
    n = len(example)
    first = max(place.start - n, 0)
    starts = np.arange(first, min(place.stop, len(sequence) - n + 1))
    if not len(starts):
        return None
    rows: PackedFeatures = example.packed
    for at in starts[(sequence.packed[starts] == rows[0]).all(axis=1)].tolist():
        if (sequence.packed[at : at + n] == rows).all():
            return Place(place.number, at, at + n, 0.0)
    return None


def repeats(place: Place, other: Place) -> bool:
    """Whether more than half of the shorter of two places lies within the other."""
    shared = min(place.stop, other.stop) - max(place.start, other.start)
    return 2 * shared >= min(place.stop - place.start, other.stop - other.start)


def _starts(n_frames: int, width: int, hop: int) -> list[int]:
    if n_frames <= width:
        return [0]
    return sorted({*range(0, n_frames - width + 1, hop), n_frames - width})
