"""Packed features of a motion that is still going on.

Positions arrive in chunks of any size; what comes out, in all, is what `compute_features`
gives for the whole. A frame of features is known as soon as the positions have arrived that
its velocities and the cubic between frames look ahead to.

Conventions: as of `computing`; the lengths of the body freeze a second after the first frame
in which a joint is seen, or at once if all are seen there.
"""

import math

import numpy as np
from numpy.typing import NDArray

from motionary.features.body import LENGTHS, REFERENCE_S, Body, Floats, window_frames
from motionary.features.computing import MEASURE_HZ, SEQUENCE_HZ, switch_features
from motionary.features.feature_set import FeatureSet
from motionary.motion import GENERIC_JOINTS, count_resampled, interpolate
from motionary.packing import PackedFeatures, pack

_STEP = round(MEASURE_HZ / SEQUENCE_HZ)
_REFERENCE = round(REFERENCE_S * MEASURE_HZ)
# A cubic needs two frames after, and one before.
_AHEAD, _BEHIND = 2, 1


class FeatureStream:
    """Features at 30 Hz of generic positions that arrive in chunks.

    Parameters
    ----------
    feature_set : features to compute
    rate_hz : positions per second
    """

    #: What changes as positions arrive.
    REMEMBERED = ("_raw", "_even", "_reference", "_state", "_n_done")

    def __init__(self, feature_set: FeatureSet, rate_hz: float) -> None:
        self.feature_set, self.rate_hz = feature_set, rate_hz
        widths = [window_frames(one.window_s, MEASURE_HZ) for one in feature_set.features]
        self._before = max(-(-width // 2) - 1 for width in widths)
        self._after = max(width // 2 for width in widths) + 1
        self._raw = _Window()
        self._even = _Window()
        self._reference: Body | None = None
        self._state = np.zeros(len(feature_set), dtype=np.bool_)
        self._n_done = 0

    @property
    def delay_s(self) -> float:
        """How long after its time a frame of features is known at the latest."""
        between = 0.0 if self.rate_hz == MEASURE_HZ else (_AHEAD + 1) / self.rate_hz
        return between + (self._after + _STEP) / MEASURE_HZ

    def push(self, positions: Floats) -> tuple[PackedFeatures, PackedFeatures]:
        """Packed features and which are known, shape (new frames, n_integers), uint64.

        Parameters
        ----------
        positions : array, shape (frames, 24, 3), metres, y up, NaN = not seen
        """
        self._raw.append(positions)
        return self._advance(at_end=False)

    def finish(self) -> tuple[PackedFeatures, PackedFeatures]:
        """What is left when no more positions come."""
        return self._advance(at_end=True)

    def _advance(self, *, at_end: bool) -> tuple[PackedFeatures, PackedFeatures]:
        self._even_out(at_end)
        # Whole frames of the sequence, as far as all that they look ahead to has come.
        stop = self._even.stop
        if not at_end:
            stop = (max(stop - self._after, 0) // _STEP) * _STEP
        reference, stop = self._find_reference(stop, at_end)
        if stop <= self._n_done:
            none = pack(np.empty((0, len(self.feature_set)), dtype=np.bool_))
            return none, none
        first = max(self._n_done - self._before, 0)
        body = Body.from_positions(self._even.since(first), rate_hz=MEASURE_HZ, reference=reference)
        part = slice(self._n_done - first, stop - first)
        features, known = switch_features(body, self.feature_set, self._state, part)
        self._state, self._n_done = features[-1], stop
        self._even.forget(stop - self._before)
        return pack(features[::_STEP]), pack(known[::_STEP])

    def _even_out(self, at_end: bool) -> None:
        """Positions at 120 Hz of what has arrived."""
        n = self._raw.stop
        if self.rate_hz == MEASURE_HZ or (at_end and n == 1):
            self._even.append(self._raw.since(self._raw.first))
            self._raw.forget(n)
            return
        step = self.rate_hz / MEASURE_HZ
        usable = n if at_end else n - _AHEAD
        count = count_resampled(usable, rate_hz=self.rate_hz, to_hz=MEASURE_HZ) if usable > 0 else 0
        numbers = np.arange(self._even.stop, count)
        if len(numbers) == 0:
            return
        self._even.append(
            interpolate(self._raw.since(self._raw.first), numbers, step=step, first=self._raw.first)
        )
        self._raw.forget(math.floor(self._even.stop * step) - _BEHIND)

    def _find_reference(self, stop: int, at_end: bool) -> tuple[Body, int]:
        """The body whose lengths count, and the frame up to which they are settled."""
        if self._reference is not None:
            return self._reference, stop
        waiting = self._even.since(self._n_done)
        seen = np.flatnonzero(np.isfinite(waiting[..., 1]).any(axis=1))
        nothing = np.full((1, len(GENERIC_JOINTS), 3), np.nan)
        if len(seen):
            beginning = waiting[seen[0] : seen[0] + _REFERENCE]
            if at_end or len(beginning) == _REFERENCE or _sees_all_lengths(beginning[0]):
                self._reference = Body.from_positions(beginning, rate_hz=MEASURE_HZ)
                return self._reference, stop
            begin = self._n_done + int(seen[0])
            stop = min(stop, begin // _STEP * _STEP)
        # Of a body of which nothing is seen no length is asked for.
        return Body.from_positions(nothing, rate_hz=MEASURE_HZ), stop


class _Window:
    """The last positions of a stream, by the number of their frame."""

    REMEMBERED = ("first", "_positions")

    def __init__(self) -> None:
        self.first = 0
        self._positions: NDArray[np.float64] = np.empty((0, len(GENERIC_JOINTS), 3))

    @property
    def stop(self) -> int:
        return self.first + len(self._positions)

    def append(self, positions: Floats) -> None:
        self._positions = np.concatenate([self._positions, positions])

    def since(self, first: int) -> Floats:
        return self._positions[first - self.first :]

    def forget(self, first: int) -> None:
        """Drop what lies before a frame."""
        n = min(max(first - self.first, 0), len(self._positions))
        self._positions, self.first = self._positions[n:], self.first + n


def _sees_all_lengths(positions: Floats) -> bool:
    joints = {joint for chain in LENGTHS.values() for pair in chain for joint in pair}
    indices = [GENERIC_JOINTS.index(joint) for joint in sorted(joints)]
    return bool(np.isfinite(positions[indices]).all())
