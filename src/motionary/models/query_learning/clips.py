"""Which clips does an individual retrieve?

A clip counts once, whatever its hits (Baak 2012, Algorithm 3): only whether there is a hit
is asked, and of all clips at once. A bitmap over the frames of all clips is one Python
integer: at tens of thousands of frames its AND and shift cost a microsecond, less than a
call of NumPy on top of its work, and no run has to be followed.

Conventions: bit p of a bitmap is position p of the `PostingIndex`; later frames are higher.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from motionary.models.keyframes import PostingIndex
from motionary.models.query_learning.individuals import Individual

#: Keyframes remembered; at 42 586 frames they take 25 MB.
_MOST_REMEMBERED = 4096


class Clips:
    """Bitmaps of clips, and of the keyframes that were asked for.

    Parameters
    ----------
    index : words of the clips, a clip being a document
    """

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


Retrieve = Callable[[Individual], NDArray[np.bool_]]
