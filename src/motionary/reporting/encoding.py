"""Numbers as text of a page: whole numbers, their differences in time, deflated, in base64.

Conventions: a block is base64 of a zlib stream of variable-length integers (seven bits a
byte, low ones first); signed ones are folded (0, -1, 1, -2, ... become 0, 1, 2, 3, ...).
`page/decoding.js` is the other half.
"""

import base64
import json
import zlib
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.recording import split_runs

Integers = NDArray[np.int64]

#: Unit of positions in a page, metres: they are off by half of it at most.
UNIT_M = 0.001

_LEVEL = 7
_BITS = 7
_MOST_BYTES = 10


class Block(NamedTuple):
    """Base64 text under the name by which the page asks for it."""

    name: str
    text: str


def encode_positions(positions: NDArray[np.float64], known: NDArray[np.bool_]) -> str:
    """Positions and which of them were seen.

    Joint by joint, coordinate by coordinate: the first value, then differences; after all
    joints, per joint, the lengths of runs of seen and unseen frames in turn, seen first.

    Parameters
    ----------
    positions : array, shape (frames, joints, 3), metres, finite
    known : array, shape (frames, joints)
    """
    n_frames, n_joints, _ = positions.shape
    values = np.rint(positions / UNIT_M).astype(np.int64)
    rows = values.transpose(1, 2, 0).reshape(n_joints * 3, n_frames)
    runs = [run for joint in known.T for run in _lengths(joint)]
    return _deflate(_varints(_fold(_differences(rows))) + _varints(np.array(runs, dtype=np.int64)))


def encode_series(values: NDArray[np.int64]) -> str:
    """Whole numbers over time, shape (rows, frames), by their differences."""
    return _deflate(_varints(_fold(_differences(values))))


def encode_states(states: NDArray[np.int64]) -> str:
    """Rows of up to 8 states over time, shape (rows, frames): 8 x length + state of each run."""
    parts: list[int] = []
    for row in states:
        runs = split_runs(row)
        parts.append(len(runs))
        parts += [8 * run.n_frames + int(row[run.start]) for run in runs]
    return _deflate(_varints(np.array(parts, dtype=np.int64)))


def encode_json(content: Any) -> str:
    """Any JSON, deflated."""
    return _deflate(json.dumps(content, separators=(",", ":"), allow_nan=False).encode("ascii"))


def _lengths(known: NDArray[np.bool_]) -> Sequence[int]:
    """Lengths of the runs in turn, of True first, which may have none."""
    lengths = [run.n_frames for run in split_runs(known)]
    return lengths if known[0] else [0, *lengths]


def _differences(rows: Integers) -> Integers:
    return np.diff(rows, axis=1, prepend=0).ravel()


def _fold(values: Integers) -> Integers:
    return np.where(values < 0, -2 * values - 1, 2 * values)


def _varints(values: Integers) -> bytes:
    """Variable-length integers of numbers of at least 0."""
    if not len(values):
        return b""
    n_bytes = np.ones(len(values), dtype=np.int64)
    for k in range(1, _MOST_BYTES - 1):
        n_bytes += values >= 1 << (_BITS * k)
    places = np.concatenate([[0], np.cumsum(n_bytes)[:-1]])
    out = np.empty(int(n_bytes.sum()), dtype=np.uint8)
    for k in range(int(n_bytes.max())):
        here = n_bytes > k
        low = (values[here] >> (_BITS * k)) & 0x7F
        out[places[here] + k] = low | np.where(n_bytes[here] > k + 1, 0x80, 0)
    return out.tobytes()


def _deflate(content: bytes) -> str:
    return base64.b64encode(zlib.compress(content, _LEVEL)).decode("ascii")
