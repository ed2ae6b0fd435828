"""What are the words of one recording, and where in the file do they stand?

Conventions: word i describes the moment i / 30 s after the recording's first frame; parts
are half-open; the file's own frame numbers are inclusive, as people look them up.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.features.feature_set import FeatureSet
from motionary.packing import PackedFeatures, count_integers, unpack

SEQUENCE_HZ = 30.0

# A time that was computed from a frame number must find that frame again.
_SLACK = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class FeatureSequence:
    """Words of one recording.

    Attributes
    ----------
    words : array, shape (frames, n_words), uint64, at 30 Hz; unknown relations are 0
    known : array of the same shape: which relations are known
    feature_set : what the bits mean
    source : name of the recording
    file_rate_hz, file_frames, first_frame : rate, length and first frame number of the
        file; without `file_frames` the file is as long as the words
    """

    packed: PackedFeatures
    known: PackedFeatures
    feature_set: FeatureSet
    source: str = ""
    file_rate_hz: float = SEQUENCE_HZ
    file_frames: int = 0
    first_frame: int = 0

    def __post_init__(self) -> None:
        n_integers = count_integers(len(self.feature_set))
        shape = self.packed.shape
        if len(shape) != 2 or shape[1] != n_integers or self.known.shape != shape:
            raise InvalidInput(
                f"feature set {self.feature_set.name!r} needs words and known of shape "
                f"(frames, {n_integers}), got {shape} and {self.known.shape}"
            )
        if not self.file_frames:
            frames = round(len(self) / SEQUENCE_HZ * self.file_rate_hz)
            object.__setattr__(self, "file_frames", frames)

    def __len__(self) -> int:
        return int(self.packed.shape[0])

    @property
    def rate_hz(self) -> float:
        """Words per second."""
        return SEQUENCE_HZ

    @property
    def duration_s(self) -> float:
        """Length of the recording in seconds."""
        return self.file_frames / self.file_rate_hz

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

    def file_frame(self, time_s: float) -> int:
        """The file's number of the frame shown at a time, within the recording."""
        index = math.floor(time_s * self.file_rate_hz + _SLACK)
        return self.first_frame + min(max(index, 0), max(self.file_frames - 1, 0))

    def last_file_frame(self, end_s: float) -> int:
        """The file's number of the last frame before a time, within the recording."""
        index = math.ceil(end_s * self.file_rate_hz - _SLACK) - 1
        return self.first_frame + min(max(index, 0), max(self.file_frames - 1, 0))

    def part(self, start: int, stop: int) -> "FeatureSequence":
        """Words start to stop (half-open); times then count from `start`."""
        if not 0 <= start < stop <= len(self):
            raise InvalidInput(
                f"{self.source}: a part needs 0 <= start < stop <= {len(self)} words, "
                f"got {start} to {stop}"
            )
        first = round(start / SEQUENCE_HZ * self.file_rate_hz)
        last = min(round(stop / SEQUENCE_HZ * self.file_rate_hz), self.file_frames)
        return FeatureSequence(
            packed=self.packed[start:stop],
            known=self.known[start:stop],
            feature_set=self.feature_set,
            source=self.source,
            file_rate_hz=self.file_rate_hz,
            file_frames=last - first,
            first_frame=self.first_frame + first,
        )
