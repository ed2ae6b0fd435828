"""What readers share: the content of a file, in its own unit and axes, and which take is meant.

Readers raise errors without the file's name: `names_file` adds it.
"""

import functools
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Concatenate, ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput, MotionaryError, SeveralRecordings, UnreadableFile
from motionary.io.formats import EVERY
from motionary.io.normalise.units import FileMetadata
from motionary.motion import Event, JointMapping, Motion, Skeleton, forward_kinematics
from motionary.rotations import (
    Floats,
    conjugate_quaternions,
    multiply_quaternions,
    quaternions_to_matrices,
    rotate,
)

P = ParamSpec("P")
Result = TypeVar("Result")

#: No unit is so small that a person is this many of them away.
FARTHEST = 1e9

# Coordinates, in a file's own unit, from which on a point is nowhere.
_FARTHEST_SEEN = 1e6
_SENTINEL = 9999.0

#: Units that formats of points are in.
POINT_UNITS = ("m", "dm", "cm", "mm", "inch")

#: What to do about a rate, at the end of an error.
RATE_HINT = "pass the rate with --rate (rate_hz=...)"

MOST_RATE_HZ = 1e5

# What is given may be more.
_MOST_GIVEN_HZ = 1e6

_TICK_NS = 200_000_000

# What was loaded last of a file with several recordings: they are read one after the other.
_kept: dict[tuple[str, int, int], Any] = {}

# Matrices of this many frames stay in the processor's cache, and memory stays flat.
_TOGETHER = 512


@contextmanager
def at_fault(file: str) -> Iterator[None]:
    """Errors on the way name this file, unless they name another one."""
    try:
        yield
    except MotionaryError as error:
        error.file = error.file or file
        raise


def names_file(
    function: Callable[Concatenate[Path, P], Result],
) -> Callable[Concatenate[Path, P], Result]:
    """A function of a file whose errors name it, as of `at_fault`."""

    @functools.wraps(function)
    def named(path: Path, /, *args: P.args, **kwargs: P.kwargs) -> Result:
        with at_fault(path.name):
            return function(path, *args, **kwargs)

    return named


@dataclass(frozen=True, slots=True)
class FileContent:
    """Motion of a file, as it stands there.

    Attributes
    ----------
    names : one name per joint or point; those that occur twice are numbered
    positions : array, shape (frames, joints, 3), file units; NaN = not seen; given away:
        normalising changes it
    rate_hz : frames per second, as given or as the file says
    metadata : what the file says of unit and axes; None where it is known to be normal
    first_frame, skeleton, rotations, events, notes : as in `Motion`
    mapping : where the file, or the order of its joints, gives it
    """

    names: Sequence[str]
    positions: Floats
    rate_hz: float
    metadata: FileMetadata | None
    first_frame: int = 0
    skeleton: Skeleton | None = None
    rotations: Floats | None = None
    mapping: JointMapping | None = None
    events: tuple[Event, ...] = ()
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not len(self.positions):
            raise UnreadableFile("holds no frames")
        if not 0 < self.rate_hz <= _MOST_GIVEN_HZ:
            raise UnreadableFile(f"says {self.rate_hz:g} frames a second; {RATE_HINT}")
        # Comparing with NaN is False: what is not seen is not too far away.
        far = self.rotations is None and (np.abs(self.positions) > FARTHEST).any()
        if far:
            raise UnreadableFile("has impossibly large numbers")


def place_joints(
    skeleton: Skeleton,
    quaternions: Floats,
    root_positions: Floats,
    translations: dict[int, Floats] | None = None,
) -> Floats:
    """Joint positions of a tree over hours of frames, shape (frames, joints, 3).

    Local rotations wxyz are (frames, joints, 4); translations, (frames, 3) by index, are in place
    of a joint's offset. Numbers so large that no body can be meant are refused.
    """
    n_frames, n_joints = quaternions.shape[:2]
    positions = np.empty((n_frames, n_joints, 3))
    with np.errstate(all="ignore"):
        for start in range(0, n_frames, _TOGETHER):
            part = slice(start, start + _TOGETHER)
            # Frames last in memory, as forward kinematics runs along them.
            turns = quaternions_to_matrices(np.swapaxes(quaternions[part], 0, 1))
            positions[part] = forward_kinematics(
                skeleton,
                np.swapaxes(turns, 0, 1),
                root_positions[part],
                {joint: moved[part] for joint, moved in (translations or {}).items()},
            )
    # NaN is no possible place either.
    if not (positions.max() < FARTHEST and positions.min() > -FARTHEST):
        possible = np.abs(positions).max(axis=(1, 2)) < FARTHEST
        frame = 1 + int(np.flatnonzero(~possible)[0])
        raise UnreadableFile(f"frame {frame} from the start has impossibly large numbers")
    return positions


def rig_of(motion: Motion, holds: str) -> tuple[Skeleton, Floats]:
    """Skeleton and rotations of a motion to write; one without has no place in the format."""
    if motion.skeleton is None or motion.rotations is None:
        raise InvalidInput(
            f"{holds}, and this motion has places of points only; write .trc, .c3d or .npz",
            file=motion.source or "motion",
        )
    return motion.skeleton, motion.rotations


def rest_offsets(positions: Floats, turns: Floats, parents: NDArray[np.intp]) -> Floats:
    """Offsets of joints in their parents' frames, shape (joints, 3), parents first.

    Positions (joints, 3) and local turns wxyz (joints, 4) are those of one pose.
    """
    world = turns.copy()
    for joint, parent in enumerate(parents.tolist()):
        if parent >= 0:
            world[joint] = multiply_quaternions(world[parent], turns[joint])
    has = parents >= 0
    above = parents[has]
    offsets = positions.copy()
    away = positions[has] - positions[above]
    offsets[has] = rotate(conjugate_quaternions(world[above]), away)
    return offsets


def hide_sentinels(positions: Floats, names: Sequence[str]) -> tuple[str, ...]:
    """Make places that stand for "not seen" NaN, in place; a note on them if there are any.

    Programs write 9999999 (or 9999.999, in another unit) three times; beyond a million units no
    camera sees.
    """
    counts = np.zeros(positions.shape[1], dtype=np.intp)
    for start in range(0, len(positions), _TOGETHER):
        part = positions[start : start + _TOGETHER]
        sizes = np.abs(part)
        if not (sizes >= _SENTINEL).any():
            continue
        # Comparing with NaN is False.
        alike = (sizes[..., 0] == sizes[..., 1]) & (sizes[..., 1] == sizes[..., 2])
        hidden = (sizes >= _FARTHEST_SEEN).any(axis=2) | (alike & (sizes[..., 0] >= _SENTINEL))
        part[hidden] = np.nan
        counts += hidden.sum(axis=0)
    n = int(counts.sum())
    if not n:
        return ()
    some = name_some([names[i] for i in np.flatnonzero(counts).tolist()])
    return (
        f"{n} {'place' if n == 1 else 'places'} of {some} {'is' if n == 1 else 'are'} impossibly "
        f"far away (9999999 and the like) and {'counts' if n == 1 else 'count'} as not seen",
    )


def hide_unseen(positions: Floats, names: Sequence[str]) -> tuple[str, ...]:
    """As `hide_sentinels`, and what is zero throughout, or known in part, is NaN, too."""
    positions[(positions == 0).all(axis=2) | np.isnan(positions).any(axis=2)] = np.nan
    return hide_sentinels(positions, names)


def name_some(names: Sequence[object], most: int = 3) -> str:
    """The first of some names, as they stand in a text."""
    return ", ".join(map(str, names[:most])) + (", ..." if len(names) > most else "")


def number_doubles(names: Sequence[str]) -> list[str]:
    """Names, the second and further of a kind with a number."""
    taken, result = set(names), []
    counts: dict[str, int] = {}
    for name in names:
        counts[name] = counts.get(name, 0) + 1
        if counts[name] > 1:
            while f"{name} ({counts[name]})" in taken:
                counts[name] += 1
            name = f"{name} ({counts[name]})"
            taken.add(name)
        result.append(name)
    return result


# ---- files that hold several recordings


def choose_take(takes: Sequence[str] | int, take: str | int | None, source: str) -> int:
    """Which of several recordings in a file is meant: by its name, or by its number from 1.

    `takes` are their names, or how many there are where they have none. That of a single one need
    not be given; to ask for `EVERY` is `SeveralRecordings`.
    """
    # Names of thousands are not written out for each that is read.
    names: Sequence[object] = range(1, takes + 1) if isinstance(takes, int) else takes
    if take == EVERY or (take is None and len(names) > 1):
        raise SeveralRecordings(source, [str(name) for name in names])
    if take is None:
        return 0
    if str(take) in names:
        return list(names).index(str(take))
    if str(take).isascii() and str(take).isdigit() and 1 <= int(take) <= len(names):
        return int(take) - 1
    some = name_some([str(name)[:30] for name in names[:9]], 8)
    raise InvalidInput(f"has no take {str(take)[:40]!r}; it has {some} ({len(names)} in all)")


def note_take(names: Sequence[str], number: int, *, is_given: bool, called: str) -> tuple[str, ...]:
    """A note on which of the takes that a file calls `called` is read; none where it has one."""
    if len(names) < 2:
        return ()
    why = "as given" if is_given else "the first that moves"
    return (
        f"{called} {names[number]}, {why}, of {len(names)} ({name_some(names, 10)}); --take NAME "
        "(take=...) reads another",
    )


def recall(path: Path, load: Callable[[], Result], *, count: Callable[[Result], int]) -> Result:
    """What `load` gives; kept until another file is loaded, where it holds several recordings."""
    try:
        status = path.stat()
    except OSError:
        # Loading says what is wrong.
        return load()
    # What is written twice within a tick of the clock may have the same time and size.
    is_settled = abs(time.time_ns() - status.st_mtime_ns) > _TICK_NS
    key = str(path.absolute()), status.st_mtime_ns, status.st_size
    if key in _kept:
        kept: Result = _kept[key]
        return kept
    _kept.clear()
    loaded = load()
    if is_settled and count(loaded) > 1:
        _kept[key] = loaded
    return loaded
