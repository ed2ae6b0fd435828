"""Motions: the poses of a recording, its joint tree, and how they are posed and resampled.

A `Motion` holds joint positions in metres, y up, right-handed, by the file's own names,
and how those names give the 24 generic joints that features are defined on.
NaN = not seen.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from numbers import Integral
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput, NotHuman, UnknownSkeleton, check_kind
from motionary.recording import Recording
from motionary.rotations import unit_vectors
from motionary.tables import Shown, Table

GENERIC_JOINTS = (
    "root", "lhip", "lknee", "lankle", "ltoes", "rhip", "rknee", "rankle", "rtoes",
    "belly", "chest", "neck", "head", "headtop",
    "lclavicle", "lshoulder", "lelbow", "lwrist", "lfingers",
    "rclavicle", "rshoulder", "relbow", "rwrist", "rfingers",
)  # fmt: skip

Floats = NDArray[np.float64]
# Frames that are resampled at once: few enough to get the same memory again.
_BLOCK = 1200


@dataclass(frozen=True, slots=True, eq=False)
class Skeleton:
    """A tree of joints: names, parents before children, offsets in metres.

    Attributes
    ----------
    names : one unique name per joint
    parents : array, shape (joints,), index of the parent, -1 for a root
    offsets : array, shape (joints, 3), metres, in the parent's frame at rest
    ends : whether a joint is the end of its bone, as in Acclaim files: its offset then
        turns with the joint itself instead of with its parent
    """

    names: tuple[str, ...]
    parents: NDArray[np.intp]
    offsets: Floats
    ends: bool = False

    def __post_init__(self) -> None:
        n = len(self.names)
        if len(set(self.names)) != n:
            raise InvalidInput("joint names must be unique")
        if self.parents.shape != (n,) or self.offsets.shape != (n, 3):
            raise InvalidInput(
                f"{n} joints need parents (joints,) and offsets (joints, 3), "
                f"got {self.parents.shape} and {self.offsets.shape}"
            )
        if np.any(self.parents >= np.arange(n)) or np.any(self.parents < -1):
            raise InvalidInput("a joint's parent must come before it")

    def __repr__(self) -> str:
        return f"Skeleton({len(self.names)} joints: {', '.join(self.names)[:200]})"


class Normal(NamedTuple):
    """A step away from the plane of three points a, b, c, as markers on the skin need it.

    It is `fraction` times the unit vector of (b - a) x (b - c), times the mean distance of a
    and b over all frames.
    """

    a: str
    b: str
    c: str
    fraction: float

    def renamed(self, names: Mapping[str, str]) -> "Normal":
        """The same step between points of other names."""
        a, b, c = (names.get(name, name) for name in (self.a, self.b, self.c))
        return Normal(a, b, c, self.fraction)


@dataclass(frozen=True, slots=True)
class JointMapping:
    """Weights with which the names of a file give the generic joints.

    A generic joint is a weighted sum of the file's points, and where `normals` has it a
    step away from three of them; a joint without weights is not to be had from this file.
    `substituted` lists generic joints whose place is a stated guess, `note` says which.
    `order` is the usual order of the points where a format has them without names.
    """

    name: str
    weights: dict[str, dict[str, float]]
    substituted: tuple[str, ...] = ()
    note: str = ""
    order: tuple[str, ...] = ()
    normals: dict[str, Normal] = field(default_factory=dict)


class Event(NamedTuple):
    """A moment that the file names, such as a foot strike.

    `side` is "left", "right" or empty; `time_s` counts from the first frame.
    """

    name: str
    side: str
    time_s: float


class Unmapped(NamedTuple):
    """Why joints give no generic joints: a sentence that says what to do.

    `is_human` is False where the body is an animal's.
    """

    reason: str
    is_human: bool = True


@dataclass(frozen=True, slots=True, eq=False)
class Motion(Shown):
    """Poses of a recording; equal to itself only, as arrays have no one equality.

    Attributes
    ----------
    names : the file's own joint or marker names
    positions : array, shape (frames, joints, 3), metres, y up; NaN = not seen
    recording : name, rate, first frame; its number of frames follows `positions`
    mapping : how the names give the generic joints; None if unknown
    skeleton, rotations : the joint tree and local rotations (frames, joints, 4), unit
        quaternions wxyz, where the file has them
    notes : what was assumed or noticed while reading, one sentence each
    events : moments that the file names, by time
    in_place : whether the hips were kept above one point while the feet walk, so that speeds
        of feet and body are unknown
    unmapped : why `mapping` is None, where it is known
    """

    names: tuple[str, ...]
    positions: Floats
    recording: Recording
    mapping: JointMapping | None = None
    skeleton: Skeleton | None = None
    rotations: Floats | None = None
    notes: tuple[str, ...] = field(default=())
    events: tuple[Event, ...] = ()
    in_place: bool = False
    unmapped: Unmapped | None = None

    def __post_init__(self) -> None:
        remedy = "Motion(names, positions, Recording(name, rate_hz=...))"
        check_kind(self.positions, (np.ndarray,), name="positions", remedy=remedy)
        check_kind(self.recording, (Recording,), name="recording", remedy=remedy)
        shape = self.positions.shape
        if len(shape) != 3 or shape[1:] != (len(self.names), 3):
            raise InvalidInput(
                f"positions need shape (frames, {len(self.names)} joints, 3), got {shape}"
            )
        if shape[0] == 0:
            raise InvalidInput("a motion needs at least one frame, got none")
        if not self.recording.rate_hz > 0:
            raise InvalidInput(f"rate_hz must be a positive number, got {self.rate_hz}")
        with np.errstate(all="ignore"):
            # A finite sum, in one pass, has no infinite terms.
            is_finite = np.isfinite(self.positions.sum()) or not np.isinf(self.positions).any()
        if not is_finite:
            raise InvalidInput("positions must be finite, or NaN where a joint is not seen")
        if self.recording.n_frames != shape[0]:
            object.__setattr__(self, "recording", replace(self.recording, n_frames=shape[0]))

    def __repr__(self) -> str:
        return (
            f"Motion({self.source or 'unnamed'!r}, {self.n_frames} frames at {self.rate_hz:g} Hz, "
            f"{self.duration_s:.2f} s, {len(self.names)} joints, {len(self.notes)} notes)"
        )

    def list_rows(self) -> Table:
        """What is known of the recording, a row each."""
        facts = [
            ("recording", self.source),
            ("person", self.recording.person),
            ("frames", self.n_frames),
            ("frames per second", self.rate_hz),
            ("seconds", self.duration_s),
            ("joints", ", ".join(self.names)),
            ("skeleton", self.mapping.name if self.mapping else "unknown"),
            *(("note", note) for note in self.notes),
        ]
        return Table(("", "value"), facts)

    @property
    def source(self) -> str:
        """Name of the recording."""
        return self.recording.name

    @property
    def rate_hz(self) -> float:
        """Frames per second."""
        return self.recording.rate_hz

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        return len(self.positions)

    @property
    def first_frame(self) -> int:
        """Number that the file gives the first frame."""
        return self.recording.first_frame

    @property
    def duration_s(self) -> float:
        """Length in seconds: frames / rate."""
        return self.recording.duration_s

    def show(self, *, labels: Any = None, library: Any = None) -> Any:
        """A page that plays the motion; notebooks show it in the cell.

        Parameters
        ----------
        labels, library : as `report` takes them

        Returns
        -------
        motionary.reporting.Page
        """
        # Late, through the front door: pages know motions, not the other way round.
        from motionary import report

        return report(self, labels=labels, library=library)

    def renamed(self, name: str) -> Self:
        """The motion under another name of its recording."""
        return replace(self, recording=self.recording.renamed(name))

    def generic_positions(self) -> Floats:
        """Positions of the 24 generic joints, shape (frames, 24, 3), NaN where unknown.

        Raises
        ------
        UnknownSkeleton, NotHuman
            If the mapping is unknown.
        """
        if self.mapping is None:
            unmapped = self.unmapped or Unmapped(
                f"no known skeleton has the joints {', '.join(self.names[:6])}, ...; "
                "pass skeleton= with a known name"
            )
            error = UnknownSkeleton if unmapped.is_human else NotHuman
            raise error(f"no features: {unmapped.reason}", file=self.source or "motion")
        index = {name: i for i, name in enumerate(self.names)}
        result = np.full((self.n_frames, len(GENERIC_JOINTS), 3), np.nan)
        for g, joint in enumerate(GENERIC_JOINTS):
            weights = self.mapping.weights.get(joint)
            if weights and all(name in index for name in weights):
                if list(weights.values()) == [1.0]:
                    result[:, g] = self.positions[:, index[next(iter(weights))]]
                else:
                    result[:, g] = sum(w * self.positions[:, index[n]] for n, w in weights.items())
                normal = self.mapping.normals.get(joint)
                if normal is not None:
                    result[:, g] += self._step_away(normal, index)
        return result

    def _step_away(self, normal: Normal, index: dict[str, int]) -> Floats:
        """A normal's step in each frame, shape (frames, 3); NaN where a point is not seen."""
        if not {normal.a, normal.b, normal.c} <= index.keys():
            return np.full((self.n_frames, 3), np.nan)
        a, b, c = (self.positions[:, index[name]] for name in normal[:3])
        away = np.cross(b - a, b - c)
        lengths = np.linalg.norm(b - a, axis=1)
        seen = lengths[~np.isnan(lengths)]
        mean = seen.mean() if len(seen) else np.nan
        step: Floats = unit_vectors(away) * (normal.fraction * mean)
        return step

    def cut(self, first: int, stop: int) -> Self:
        """Frames `first` to `stop` (half-open, counted from 0) as a motion."""
        remedy = f"for seconds multiply by rate_hz ({self.rate_hz:g}) and round"
        for name, value in (("first", first), ("stop", stop)):
            check_kind(value, (Integral,), name=name, remedy=remedy)
        if not 0 <= first < stop <= self.n_frames:
            raise InvalidInput(
                f"a cut needs 0 <= first < stop <= {self.n_frames} frames, got {first}, {stop}"
            )
        return replace(
            self,
            positions=self.positions[first:stop],
            rotations=None if self.rotations is None else self.rotations[first:stop],
            recording=self.recording.part(first, stop),
            events=tuple(
                event._replace(time_s=event.time_s - first / self.rate_hz)
                for event in self.events
                if first <= event.time_s * self.rate_hz < stop
            ),
        )


def forward_kinematics(
    skeleton: Skeleton,
    rotations: NDArray[np.float64],
    root_positions: Floats,
    translations: dict[int, Floats] | None = None,
) -> Floats:
    """Joint positions of a tree, shape (frames, joints, 3), from local rotation matrices.

    Parameters
    ----------
    skeleton : Skeleton
    rotations : array, shape (frames, joints, 3, 3), each joint relative to its parent
    root_positions : array, shape (frames, 3), metres; added to each root's offset
    translations : per joint index, local translations (frames, 3), metres, that replace
        the joint's offset
    """
    translations = translations or {}
    n_frames, n_joints = rotations.shape[:2]
    # Components first and frames last: the arithmetic then runs along frames.
    local = np.moveaxis(rotations, 0, -1)
    world = np.empty((n_joints, 3, 3, n_frames))
    positions = np.empty((n_frames, n_joints, 3))
    placed = np.moveaxis(positions, 0, -1)
    for joint, parent in enumerate(skeleton.parents):
        offset = np.atleast_2d(translations.get(joint, skeleton.offsets[joint])).T
        if parent < 0:
            world[joint], placed[joint] = local[joint], root_positions.T + offset
            continue
        _multiply(world[parent], local[joint], out=world[joint])
        turning = world[joint if skeleton.ends else parent]
        placed[joint] = placed[parent] + _multiply(turning, offset[:, None])[:, 0]
    return positions


def _multiply(left: Floats, right: Floats, out: Floats | None = None) -> Floats:
    """Matrix products along the last axis: (3, 3, n) times (3, k, n)."""
    product: Floats = np.multiply(left[:, 0, None], right[0], out=out)
    product += left[:, 1, None] * right[1]
    product += left[:, 2, None] * right[2]
    return product


def resample(positions: Floats, *, rate_hz: float, to_hz: float) -> Floats:
    """Positions at another rate, by a cubic through the four nearest frames.

    The first frame stays at the same time. The cubic (Catmull-Rom) is local: a gap stays a gap
    of its own length plus the neighbouring frames, and a part gives what the whole gives.

    Parameters
    ----------
    positions : array, shape (frames, ...), NaN = not seen
    rate_hz, to_hz : frames per second
    """
    if rate_hz == to_hz or len(positions) == 1:
        return positions
    n_new = count_resampled(len(positions), rate_hz=rate_hz, to_hz=to_hz)
    return interpolate(positions, np.arange(n_new), step=rate_hz / to_hz)


def count_resampled(n_frames: int, *, rate_hz: float, to_hz: float) -> int:
    """Number of frames at another rate within the time of the given ones."""
    return int(np.floor((n_frames - 1) * to_hz / rate_hz + 1e-9)) + 1


def interpolate(
    positions: Floats, numbers: NDArray[np.intp], *, step: float, first: int = 0
) -> Floats:
    """Frames of given numbers at another rate, `step` old frames apart; see `resample`.

    `first` is the number of the first of these positions, at least two, in its recording.
    """
    if len(numbers) > _BLOCK:
        whole = np.empty((len(numbers), *positions.shape[1:]))
        for part in (slice(i, i + _BLOCK) for i in range(0, len(numbers), _BLOCK)):
            whole[part] = interpolate(positions, numbers[part], step=step, first=first)
        return whole
    at = numbers * step
    last = first + len(positions) - 1
    left = np.minimum(at.astype(np.intp), last - 1)
    u = (at - left).reshape((-1,) + (1,) * (positions.ndim - 1))
    # Terms of the cubic belong to the old frames, of which there are as a rule far fewer.
    used = np.arange(left[0], left[-1] + 1) if step < 1 else left
    of = left - left[0] if step < 1 else np.arange(len(left))
    p0, p1, p2, p3 = (positions[np.clip(used + i, first, last) - first] for i in (-1, 0, 1, 2))
    # A missing outer neighbour costs curvature, not the frame.
    np.copyto(p0, p1, where=np.isnan(p0))
    np.copyto(p3, p2, where=np.isnan(p3))
    curve: Floats = (2 * p1)[of]
    terms = (p2 - p0, 2 * p0 - 5 * p1 + 4 * p2 - p3, 3 * (p1 - p2) + p3 - p0)
    for power, term in enumerate(terms, start=1):
        part = term[of]
        part *= u**power
        curve += part
    curve *= 0.5
    for whole, is_there in ((p1, u < 1e-9), (p2, u > 1 - 1e-9)):
        there = np.flatnonzero(is_there)
        curve[there] = whole[of[there]]
    return curve
