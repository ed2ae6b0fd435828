"""What are the words of a recording?

Joint positions are brought to 120 Hz, relations measured and switched there, and every
fourth frame kept: words at 30 Hz, as the thresholds of the published work expect.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motionary.errors import InvalidInput
from motionary.features.catalogue import FULL_BODY
from motionary.features.hysteresis import hysteresis
from motionary.features.quantities import Body, Floats
from motionary.features.relations import FeatureSet, holds
from motionary.motion import GENERIC_JOINTS, Motion, resample
from motionary.skeletons import named_mapping
from motionary.words import Words, pack, unpack

MEASURE_HZ = 120.0
WORD_HZ = 30.0
_STEP = 4


@dataclass(frozen=True, slots=True)
class FeatureSequence:
    """Words of one recording.

    Attributes
    ----------
    words : array, shape (frames, n_words), uint64, at 30 Hz; unknown relations are 0
    known : array of the same shape: which relations are known
    feature_set : what the bits mean
    source : name of the recording
    file_rate_hz, file_frames, first_frame : rate, length and first frame number of the file
    """

    words: Words
    known: Words
    feature_set: FeatureSet
    source: str = ""
    file_rate_hz: float = WORD_HZ
    file_frames: int = 0
    first_frame: int = 0

    def __len__(self) -> int:
        return self.words.shape[0]

    @property
    def rate_hz(self) -> float:
        """Words per second."""
        return WORD_HZ

    @property
    def duration_s(self) -> float:
        """Length of the recording in seconds."""
        return self.file_frames / self.file_rate_hz

    @property
    def features(self) -> NDArray[np.uint8]:
        """Relations, shape (frames, features), 0/1; unknown ones are 0."""
        return unpack(self.words, len(self.feature_set)).view(np.uint8)

    @property
    def known_features(self) -> NDArray[np.uint8]:
        """Which relations are known, shape (frames, features), 0/1."""
        return unpack(self.known, len(self.feature_set)).view(np.uint8)

    def seconds(self, frame: int) -> float:
        """Time at which a word begins; of the end, the recording's length at most."""
        return min(frame / WORD_HZ, self.duration_s)

    def file_frame(self, time_s: float) -> int:
        """The file's number of the frame shown at a time."""
        index = int(np.floor(time_s * self.file_rate_hz + 1e-6))
        return self.first_frame + min(max(index, 0), max(self.file_frames - 1, 0))

    def part(self, start: int, stop: int) -> "FeatureSequence":
        """Words start to stop (half-open); times then count from `start`."""
        if not 0 <= start < stop <= len(self):
            raise InvalidInput(
                f"{self.source}: a part needs 0 <= start < stop <= {len(self)} words, "
                f"got {start} to {stop}"
            )
        first = round(start / WORD_HZ * self.file_rate_hz)
        last = min(round(stop / WORD_HZ * self.file_rate_hz), self.file_frames)
        return FeatureSequence(
            self.words[start:stop], self.known[start:stop], self.feature_set, self.source,
            self.file_rate_hz, last - first, self.first_frame + first,
        )  # fmt: skip


def compute_features(
    motion: Motion | ArrayLike,
    *,
    rate_hz: float | None = None,
    skeleton: str | Sequence[str] | None = None,
    feature_set: FeatureSet = FULL_BODY,
) -> FeatureSequence:
    """Words of a motion, or of an array of joint positions.

    Parameters
    ----------
    motion : Motion, or array, shape (frames, joints, 3), metres, y up, NaN = not seen
    rate_hz : frames per second; for arrays
    skeleton : for arrays: name of a known skeleton, or the joints' names; without it the
        array must hold the 24 generic joints in their order
    feature_set : relations to compute

    Returns
    -------
    FeatureSequence at 30 Hz

    Raises
    ------
    InvalidInput
        If an array comes without rate, with another shape, or an unknown skeleton.
    """
    if not isinstance(motion, Motion):
        motion = _motion_from_array(motion, rate_hz, skeleton)
    positions = resample(motion.generic_positions(), rate_hz=motion.rate_hz, to_hz=MEASURE_HZ)
    features, known = relation_matrix(positions, feature_set)
    return FeatureSequence(
        pack(features[::_STEP]), pack(known[::_STEP]), feature_set, motion.source,
        motion.rate_hz, motion.n_frames, motion.first_frame,
    )  # fmt: skip


def relation_matrix(
    positions: Floats, feature_set: FeatureSet
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Relations at 120 Hz and which of them are known.

    Parameters
    ----------
    positions : array, shape (frames, 24, 3), metres, at 120 Hz

    Returns
    -------
    features, known : arrays, shape (frames, features), bool
    """
    body = Body.from_positions(positions, rate_hz=MEASURE_HZ)
    shape = (len(feature_set), positions.shape[0])
    features, known = np.empty(shape, dtype=np.bool_), np.empty(shape, dtype=np.bool_)
    for i, relation in enumerate(feature_set.relations):
        value = relation.measure(body)
        known[i] = ~np.isnan(value)
        strong = holds(value, relation.test, relation.strong)
        weak = holds(value, relation.test, relation.weak)
        features[i] = hysteresis(strong, weak, known[i])
    return features.T, known.T


def _motion_from_array(
    positions: ArrayLike, rate_hz: float | None, skeleton: str | Sequence[str] | None
) -> Motion:
    array = np.asarray(positions, dtype=np.float64)
    if rate_hz is None:
        raise InvalidInput("an array of positions needs rate_hz=, its frames per second")
    if array.ndim != 3 or array.shape[2] != 3:
        raise InvalidInput(f"positions need shape (frames, joints, 3), got {array.shape}")
    if skeleton is None:
        names, mapping = GENERIC_JOINTS, named_mapping("generic")
    elif isinstance(skeleton, str):
        mapping = named_mapping(skeleton)
        names = mapping.order
    else:
        names = tuple(skeleton)
        mapping = named_mapping("generic")
    return Motion(names, array, rate_hz, mapping)
