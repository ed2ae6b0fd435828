"""The same motion in different files: across rigs and rates, cut, mirrored.

Features show where to look: landmarks propose pairs of recordings and an offset, the bits of
what they share measure how much that means. Then the files themselves are compared, since a motion
that is repeated well changes its features in the same sequence. Compared is at equal tempo;
recordings in which hardly anything changes cannot be distinguished and are left out.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.batch import Failure, Workers, map_ordered
from motionary.errors import InvalidInput
from motionary.features import SEQUENCE_HZ, FeatureSequence
from motionary.motion import Motion
from motionary.recording import Recording, Segment
from motionary.retrieval.duplicate_evidence import (
    CURVE_HZ,
    MIRROR_ORDER,
    Candidates,
    Changes,
    Evidence,
    Signs,
    agreement,
    changes_of,
    curves_of,
    find_candidates,
    mirrored,
    rates_of,
    weigh,
)
from motionary.retrieval.index import Collection


@dataclass(frozen=True, slots=True)
class Comparing:
    """When two segments are the same motion.

    Attributes
    ----------
    least_bits : self-information of the changes that both show
    least_agreement : of the changes of acceleration; chosen on HDM05, CMU and Bandai, where
        two performances reach .71 and one by two systems .80 to 1
    least_s : length of what both show; within less, two performances may agree
    least_votes : landmarks at one offset
    """

    least_bits: float = 50.0
    least_agreement: float = 0.76
    least_s: float = 0.75
    least_votes: int = 6


class Occurrence(NamedTuple):
    """Where in a recording a motion is."""

    recording: Recording
    segment: Segment


@dataclass(frozen=True, slots=True)
class Duplicate:
    """One motion in two recordings.

    Attributes
    ----------
    left, right : where it is
    is_mirrored : whether one is the mirror image of the other
    bits : self-information of the changes of features that both show
    shared : fraction of the changes that both show
    agreement : of the changes of acceleration, at most 1
    """

    left: Occurrence
    right: Occurrence
    is_mirrored: bool
    bits: float
    shared: float
    agreement: float


@dataclass(frozen=True, slots=True)
class DuplicateResult:
    """Duplicates and what was not one.

    Attributes
    ----------
    duplicates : most bits first
    n_alike : pairs whose features change alike, but that are performances of their own
    still : recordings in which too little changes to tell them apart
    failures : pairs of recordings that could not be compared, and why
    """

    duplicates: tuple[Duplicate, ...]
    n_alike: int = 0
    still: tuple[str, ...] = ()
    failures: tuple[Failure[str], ...] = field(default=())


# So many pairs are weighed at a time.
_PORTION = 64


class _Pair(NamedTuple):
    """Two sequences with the best evidence for them."""

    left: int
    right: int
    offset: int
    is_mirrored: bool
    evidence: Evidence


def find_duplicates(
    left: Collection,
    right: Collection | None = None,
    *,
    read: Callable[[str], Motion],
    read_right: Callable[[str], Motion] | None = None,
    comparing: Comparing | None = None,
    locate: Callable[[str], Any] = str,
    locate_right: Callable[[str], Any] | None = None,
    jobs: Workers = 1,
) -> DuplicateResult:
    """The same motion in different recordings.

    Parameters
    ----------
    left : recordings
    right : others to compare them with; among themselves if left out
    read : reads a recording by what `locate` gives; called once for each that may have a copy
    read_right : the same for the others; by default as for the first
    comparing : settings
    locate, locate_right : what is handed over of a recording of that name; the name by default
    jobs : who compares: processes, or a cluster, to which `read` is sent; a function of a module,
        or `functools.partial` of one. The result does not depend on it

    Raises
    ------
    InvalidInput
        If the collections are over different features.
    """
    settings = comparing or Comparing()
    if right is not None and right.feature_set.name != left.feature_set.name:
        raise InvalidInput("both collections need features of one feature set")
    sides = _Sides(left, right)
    pairs = sides.propose(settings, jobs)
    names = [sides.names(pair) for pair in pairs]
    left_names, right_names = ([pair[side] for pair in names] for side in (0, 1))
    if read_right is None and locate_right is None:
        curves = others = _read_all(left_names + right_names, read, locate, jobs)
    else:
        curves = _read_all(left_names, read, locate, jobs)
        others = _read_all(right_names, read_right or read, locate_right or locate, jobs)
    duplicates, failures, n_alike = [], [], 0
    for pair, (one, other) in zip(pairs, names, strict=True):
        read_of_both = curves[one], others[other]
        unread = next((item for item in read_of_both if isinstance(item, Failure)), None)
        if unread is not None:
            failures.append(Failure(f"{one} and {other}", unread.error))
            continue
        found = _compare(pair, sides, *read_of_both)
        if found.agreement >= settings.least_agreement:
            duplicates.append(found)
        else:
            n_alike += 1
    return DuplicateResult(tuple(duplicates), n_alike, sides.still(settings), tuple(failures))


def _read_all(
    names: Sequence[str], read: Callable[[Any], Motion], locate: Callable[[str], Any], jobs: Workers
) -> dict[str, Any]:
    """Curves of recordings by name; of those that cannot be read the failure."""
    each = list(dict.fromkeys(names))
    work = partial(_read_curves, read=read)
    return dict(zip(each, map_ordered(work, map(locate, each), jobs=jobs), strict=True))


def _read_curves(place: Any, *, read: Callable[[Any], Motion]) -> NDArray[np.float64]:
    return curves_of(read(place))


class _Sides:
    """Features and changes of the recordings on both sides; the same ones if there is one side."""

    def __init__(self, left: Collection, right: Collection | None) -> None:
        self.is_one = right is None
        self.left = list(left.sequences)
        self.right = self.left if right is None else list(right.sequences)
        feature_set = left.feature_set
        self.n_features = len(feature_set)
        self.mirror_order = feature_set.mirror_order
        self.left_changes = self._changes(self.left)
        self.right_changes = self.left_changes if self.is_one else self._changes(self.right)
        counts = np.zeros(2 * self.n_features, dtype=np.int64)
        for changes in (self.left_changes, self.right_changes):
            counts += np.bincount(changes.symbols, minlength=len(counts))
        n_frames = sum(map(len, self.left)) + sum(map(len, self.right))
        self.rates = rates_of(counts, n_frames)

    def _changes(self, sequences: Sequence[FeatureSequence]) -> Changes:
        if not sequences:
            raise InvalidInput("there is no readable recording to compare")
        packed, known = [s.packed for s in sequences], [s.known for s in sequences]
        return changes_of(packed, known, self.n_features)

    def names(self, pair: _Pair) -> tuple[str, str]:
        return self.left[pair.left].source, self.right[pair.right].source

    def propose(self, settings: Comparing, jobs: Workers) -> list[_Pair]:
        """Pairs with enough evidence, most bits first; each pair of recordings once."""
        best: dict[tuple[int, int], _Pair] = {}
        for is_mirrored in (False, True):
            right = self.right_changes
            if is_mirrored:
                right = mirrored(right, self.mirror_order)
            found = find_candidates(
                self.left_changes, right, n_features=self.n_features,
                n_right=len(self.right), least_votes=settings.least_votes,
            )  # fmt: skip
            for pair in self._weigh(found, is_mirrored, jobs):
                key = (pair.left, pair.right)
                if key not in best or pair.evidence.bits > best[key].evidence.bits:
                    best[key] = pair
        enough = [
            pair
            for pair in best.values()
            if pair.evidence.bits >= settings.least_bits
            and pair.evidence.stop - pair.evidence.start >= settings.least_s * SEQUENCE_HZ
        ]
        return sorted(enough, key=lambda p: (-p.evidence.bits, p.left, p.right))

    def still(self, settings: Comparing) -> tuple[str, ...]:
        """Recordings whose changes could not make enough bits."""
        names = []
        sides = [(self.left, self.left_changes), (self.right, self.right_changes)]
        worth = -np.log2(np.minimum(self.rates, 1.0))
        for sequences, changes in sides[: 1 if self.is_one else 2]:
            weights = worth[changes.symbols]
            bits = np.bincount(changes.sequences, weights=weights, minlength=len(sequences))
            names += [sequences[i].source for i in np.flatnonzero(bits < settings.least_bits)]
        return tuple(names)

    def _weigh(self, found: Candidates, is_mirrored: bool, jobs: Workers) -> Iterator[_Pair]:
        proposed: dict[tuple[int, int, int], None] = {}
        for left, right, offset, _ in np.stack(found, axis=1).tolist():
            if self.is_one and left > right:
                # The mirror image of one beside the other is the other's beside the one.
                left, right, offset = right, left, -offset
            if not (self.is_one and left == right):
                proposed[left, right, offset] = None
        each = list(proposed)
        portions = [each[i : i + _PORTION] for i in range(0, len(each), _PORTION)]
        items = (self._portion(portion, is_mirrored) for portion in portions)
        work = partial(_weigh_portion, n_features=self.n_features, rates=self.rates)
        weighed = map_ordered(work, items, jobs=jobs)
        for portion, evidence in zip(portions, weighed, strict=True):
            if isinstance(evidence, Failure):
                raise evidence.error
            for place, one in zip(portion, evidence, strict=True):
                yield _Pair(*place, is_mirrored, one)

    def _portion(self, places: Sequence[tuple[int, int, int]], is_mirrored: bool) -> "_Portion":
        left = {n: self._changes_of(self.left_changes, self.left, n) for n, _, _ in places}
        right = {n: self._changes_of(self.right_changes, self.right, n) for _, n, _ in places}
        if is_mirrored:
            right = {
                number: one._replace(features=self.mirror_order[one.features])
                for number, one in right.items()
            }
        return _Portion(places, left, right)

    def _changes_of(
        self, changes: Changes, sequences: Sequence[FeatureSequence], number: int
    ) -> "_ChangesOfOne":
        first, stop = np.searchsorted(changes.sequences, [number, number + 1])
        symbols = changes.symbols[first:stop]
        return _ChangesOfOne(
            len(sequences[number]), changes.frames[first:stop], symbols // 2, symbols % 2
        )


class _ChangesOfOne(NamedTuple):
    """Changes of one sequence: frames, features, and whether each begins to hold."""

    n_frames: int
    frames: NDArray[np.int64]
    features: NDArray[np.int64]
    begins: NDArray[np.int64]

    def signs(self, n_features: int) -> Signs:
        """The changes as a matrix."""
        signs = np.zeros((self.n_frames, n_features), dtype=np.int8)
        signs[self.frames, self.features] = np.where(self.begins, 1, -1)
        return signs


class _Portion(NamedTuple):
    """Pairs to be weighed (left, right, offset), and the changes of their sequences."""

    places: Sequence[tuple[int, int, int]]
    left: dict[int, _ChangesOfOne]
    right: dict[int, _ChangesOfOne]


def _weigh_portion(
    portion: _Portion, *, n_features: int, rates: NDArray[np.float64]
) -> list[Evidence]:
    return [
        weigh(
            portion.left[left].signs(n_features),
            portion.right[right].signs(n_features),
            offset,
            rates,
        )
        for left, right, offset in portion.places
    ]


def _compare(
    pair: _Pair, sides: _Sides, left: NDArray[np.float64], right: NDArray[np.float64]
) -> Duplicate:
    """Compare the files of a pair where their features agree."""
    per_frame = round(CURVE_HZ / SEQUENCE_HZ)
    start, stop = pair.evidence.start, pair.evidence.stop + 1
    if pair.is_mirrored:
        right = right[:, MIRROR_ORDER]
    here = left[start * per_frame : stop * per_frame]
    offset = (pair.offset - start) * per_frame
    value, at = agreement(here, right, offset, within=2 * per_frame)
    shift_s = start / SEQUENCE_HZ + at / CURVE_HZ
    start_s, end_s = start / SEQUENCE_HZ, stop / SEQUENCE_HZ
    there = Segment(max(start_s - shift_s, 0.0), end_s - shift_s)
    return Duplicate(
        Occurrence(sides.left[pair.left].recording, Segment(start_s, end_s)),
        Occurrence(sides.right[pair.right].recording, there),
        pair.is_mirrored, pair.evidence.bits, pair.evidence.shared, value,
    )  # fmt: skip
