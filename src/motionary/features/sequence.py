"""What are the words of one recording, and where in the file do they stand?

Conventions: word i describes the moment i / 30 s after the recording's first frame; parts
are half-open; the file's own frame numbers are inclusive, as people look them up.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.features.feature_set import FeatureSet
from motionary.packing import PackedFeatures, count_integers, unpack
from motionary.recording import Recording, Segment

SEQUENCE_HZ = 30.0


@dataclass(frozen=True, slots=True, eq=False)
class FeatureSequence:
    """Words of one recording.

    Attributes
    ----------
    words : array, shape (frames, n_words), uint64, at 30 Hz; unknown relations are 0
    known : array of the same shape: which relations are known
    feature_set : what the bits mean
    recording : what they are of; where it has no rate or number of frames, the file's are
        those of the sequence
    """

    packed: PackedFeatures
    known: PackedFeatures
    feature_set: FeatureSet
    recording: Recording = field(default_factory=Recording)

    def __post_init__(self) -> None:
        n_integers = count_integers(len(self.feature_set))
        shape = self.packed.shape
        if len(shape) != 2 or shape[1] != n_integers or self.known.shape != shape:
            raise InvalidInput(
                f"feature set {self.feature_set.name!r} needs words and known of shape "
                f"(frames, {n_integers}), got {shape} and {self.known.shape}"
            )
        own = self.recording
        if not (own.rate_hz and own.n_frames):
            rate_hz = own.rate_hz or SEQUENCE_HZ
            n_frames = own.n_frames or round(len(self) / SEQUENCE_HZ * rate_hz)
            whole = replace(own, rate_hz=rate_hz, n_frames=n_frames)
            object.__setattr__(self, "recording", whole)

    def __len__(self) -> int:
        return int(self.packed.shape[0])

    @property
    def rate_hz(self) -> float:
        """Words per second."""
        return SEQUENCE_HZ

    @property
    def source(self) -> str:
        """Name of the recording."""
        return self.recording.name

    @property
    def duration_s(self) -> float:
        """Length of the recording in seconds."""
        return self.recording.duration_s

    @property
    def features(self) -> NDArray[np.uint8]:
        """Relations, shape (frames, features), 0/1; unknown ones are 0."""
        return unpack(self.packed, len(self.feature_set)).view(np.uint8)

    @property
    def known_features(self) -> NDArray[np.uint8]:
        """Which relations are known, shape (frames, features), 0/1."""
        return unpack(self.known, len(self.feature_set)).view(np.uint8)

    def seconds(self, frame: int) -> float:
        """Time at which a word begins; of the end, the recording's length at most."""
        return min(frame / SEQUENCE_HZ, self.duration_s)

    def segment(self, start: int, stop: int) -> Segment:
        """The time of words start to stop (half-open)."""
        return Segment(self.seconds(start), self.seconds(stop))

    def renamed(self, name: str) -> "FeatureSequence":
        """The sequence under another name of its recording."""
        return replace(self, recording=self.recording.renamed(name))

    def part(self, start: int, stop: int) -> "FeatureSequence":
        """Words start to stop (half-open); times then count from `start`."""
        if not 0 <= start < stop <= len(self):
            raise InvalidInput(
                f"{self.source}: a part needs 0 <= start < stop <= {len(self)} words, "
                f"got {start} to {stop}"
            )
        rate_hz = self.recording.rate_hz
        first = round(start / SEQUENCE_HZ * rate_hz)
        last = min(round(stop / SEQUENCE_HZ * rate_hz), self.recording.n_frames)
        return replace(
            self,
            packed=self.packed[start:stop],
            known=self.known[start:stop],
            recording=self.recording.part(first, last),
        )
