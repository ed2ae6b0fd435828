"""Fitness of individuals: clips that they retrieve, and varied copies of the clips.

The fitness is the weighted F-measure of the retrieved clips (Baak 2012, eqs 4.9 to 4.11).

A clip counts once, whatever its hits (Algorithm 3): only whether there is a hit is asked,
and of all clips at once. A bitmap over the frames of all clips is one Python integer: at
tens of thousands of frames its AND and shift cost a microsecond, less than a call of NumPy
on top of its work, and no run has to be followed.

Augmentation makes copies of a clip as another person might have done it: slower or faster,
each feature a little earlier or later than the others. What separates the class from varied
others, too, does not rest on coincidences of the few examples.

Conventions: bit p of a bitmap is position p of the `PostingIndex`; later frames are higher.
Nothing retrieved has precision 0, and so fitness 0.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.features import FeatureSequence
from motionary.models.keyframes import PostingIndex
from motionary.models.query_learning.individuals import Individual
from motionary.packing import pack
from motionary.recording import Recording

Bits = NDArray[np.bool_]

#: Keyframes remembered; at 42 586 frames they take 25 MB.
_MOST_REMEMBERED = 4096


class Score(NamedTuple):
    """Measures of an individual, each in [0, 1]."""

    fitness: float
    precision: float
    recall: float


def weighted_f(precision: float, recall: float, *, beta: float) -> float:
    """F-measure in which recall weighs `beta` times as much as precision; 0 if both are 0."""
    weighted = beta * beta * precision + recall
    return (1.0 + beta * beta) * precision * recall / weighted if weighted > 0.0 else 0.0


class Fitness(NamedTuple):
    """Fitness from retrieved clips, the positives before the negatives."""

    n_positives: int
    beta: float

    def score(self, retrieved: NDArray[np.bool_]) -> Score:
        """Fitness, precision and recall of retrieved clips, shape (clips,)."""
        n_right = np.count_nonzero(retrieved[: self.n_positives])
        if n_right == 0:
            return Score(0.0, 0.0, 0.0)
        precision = float(n_right / np.count_nonzero(retrieved))
        recall = float(n_right / self.n_positives)
        return Score(weighted_f(precision, recall, beta=self.beta), precision, recall)


class Clips:
    """Bitmaps of the clips of an index, each a sequence, and of keyframes that were asked for."""

    def __init__(self, index: PostingIndex) -> None:
        self.n_clips = index.n_sequences
        self._index = index
        self._planes = [int.from_bytes(row.tobytes(), "little") for row in index.planes]
        self._n_bytes = index.planes.shape[1] * 8
        self._clip_of_byte = index.layout.of_byte
        self._longest = int(index.lengths.max())
        self._shown: dict[tuple[int, int], int] = {}
        self._inside: dict[int, int] = {}

    def retrieved(self, individual: Individual) -> NDArray[np.bool_]:
        """Which clips hold a hit, shape (clips,)."""
        found = self._first_frames(individual)
        hit = np.zeros(self.n_clips, dtype=np.bool_)
        if found:
            in_bytes = np.frombuffer(found.to_bytes(self._n_bytes, "little"), dtype=np.uint8)
            hit[self._clip_of_byte[np.flatnonzero(in_bytes)]] = True
        return hit

    def _first_frames(self, individual: Individual) -> int:
        """Frames of the first keyframe that begin a hit."""
        shown = []
        for keyframe in zip(individual.values, individual.fixed, strict=True):
            shown.append(self._keyframe(*keyframe))
            if not shown[-1]:
                return 0
        found = shown.pop()
        for least, most in zip(reversed(individual.least), reversed(individual.most), strict=True):
            found = shown.pop() & self._reach_back(found, least, most)
            if not found:
                return 0
        return found

    def _keyframe(self, value: int, fixed: int) -> int:
        """Frames that show a keyframe."""
        key = value & fixed, fixed
        bitmap = self._shown.get(key)
        if bitmap is None:
            first, *others = self._index.rows(*key)
            bitmap = self._planes[first]
            for row in others:
                bitmap &= self._planes[row]
                if not bitmap:
                    break
            if len(self._shown) >= _MOST_REMEMBERED:
                self._shown.clear()
            self._shown[key] = bitmap
        return bitmap

    def _reach_back(self, found: int, least: int, most: int) -> int:
        """Frames with a found frame from `least` to `most` frames later in the same clip."""
        if least >= self._longest:
            return 0
        width = min(most, self._longest) - least
        covered = 0
        while covered < width:
            step = min(covered + 1, width - covered)
            found |= (found >> step) & self._followed(step)
            covered += step
        return (found >> least) & self._followed(least) if least else found

    def _followed(self, step: int) -> int:
        """Frames whose clip goes on for at least `step` frames."""
        bitmap = self._inside.get(step)
        if bitmap is None:
            layout = self._index.layout
            marks = np.zeros(self._n_bytes * 8 + 1, dtype=np.int8)
            long_enough = self._index.lengths > step
            marks[layout.starts[long_enough]] += 1
            marks[layout.stops[long_enough] - step] -= 1
            packed = np.packbits(np.cumsum(marks[:-1], dtype=np.int8), bitorder="little")
            bitmap = int.from_bytes(packed.tobytes(), "little")
            self._inside[step] = bitmap
        return bitmap


class Evaluator:
    """Scores of individuals on clips, each computed once."""

    def __init__(self, clips: Clips, fitness: Fitness) -> None:
        self.clips = clips
        self.fitness = fitness
        self._scores: dict[Individual, Score] = {}

    def __call__(self, individual: Individual) -> Score:
        """Fitness, precision and recall."""
        score = self._scores.get(individual)
        if score is None:
            score = self.fitness.score(self.clips.retrieved(individual))
            self._scores[individual] = score
        return score


@dataclass(frozen=True, slots=True)
class Augmentation:
    """Settings of varied copies of clips.

    Attributes
    ----------
    copies, negative_copies : of each positive and each negative
    shift : frames by which a feature may come early or late
    tempo : a copy may be so many times slower or faster; 1 keeps the speed
    """

    copies: int = 0
    negative_copies: int = 2
    shift: int = 3
    tempo: float = 1.25

    def __post_init__(self) -> None:
        least = min(self.copies, self.negative_copies, self.shift)
        if least < 0 or not 1.0 <= self.tempo <= 10.0:
            raise InvalidInput(
                "copies need numbers and a shift of at least 0 and a tempo of 1 to 10, "
                f"got {self.copies}, {self.negative_copies}, {self.shift} and {self.tempo}"
            )


def augment_clip(
    clip: FeatureSequence, augmentation: Augmentation, rng: np.random.Generator
) -> FeatureSequence:
    """A copy of a clip at another tempo, its features shifted against each other."""
    features, known = clip.features.view(np.bool_), clip.known_features.view(np.bool_)
    features, known = augment(features, known, augmentation, rng)
    return FeatureSequence(pack(features), pack(known), clip.feature_set, Recording(clip.source))


def augment(
    features: Bits, known: Bits, augmentation: Augmentation, rng: np.random.Generator
) -> tuple[Bits, Bits]:
    """Features and known ones of the copy, shape (other frames, features); the ends are held."""
    n_frames, n_features = features.shape
    speed = augmentation.tempo ** rng.uniform(-1.0, 1.0)
    n_copied = max(1, round(n_frames / speed))
    times = np.minimum((np.arange(n_copied) * speed).astype(np.intp), n_frames - 1)
    shifts = rng.integers(-augmentation.shift, augmentation.shift, size=n_features, endpoint=True)
    at = np.clip(times[:, None] + shifts, 0, n_frames - 1)
    columns = np.arange(n_features)
    return features[at, columns], known[at, columns]
