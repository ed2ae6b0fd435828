"""Poses of people by the columns of templates, and what they tell of points that no view does.

After Baak (2012), section 6.4.3: frames that are aligned with the same column of a template lend
each other poses. Beyond the printed method poses of several people are kept, and of those near the
aligned column the ones count that agree with what is seen of the rest of the body.

Conventions: a body's own axes are x from the right hip to the left one, y up and z ahead, from the
middle of the hips, in lengths of the leg; times are those of templates, 30 Hz.
"""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput, UnreadableFile
from motionary.features import FeatureSequence, compute_features
from motionary.files import write_atomically
from motionary.io.formats.npz import ArchivedArrays
from motionary.models.library import ClassLibrary
from motionary.motion import GENERIC_JOINTS, Motion, resample
from motionary.multiview.cameras import bridge
from motionary.retrieval.explanation import Evidence
from motionary.retrieval.labelling import class_distance
from motionary.rotations import unit_vectors

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

SEQUENCE_HZ = 30.0
#: Largest cost of a match that lends priors; damaged tracks match at .01 to .11.
MOST_COST = 0.12
#: A point of which views tell more counts as seen; one of which they tell less takes what is lent.
SEEN = 0.5
#: Keypoints that poses are lent for, and the joints that they are in.
LENT = {
    f"{side}{part}": f"{side.lower()}{joint}"
    for side in "LR"
    for part, joint in (
        ("Knee", "knee"), ("Ankle", "ankle"), ("BigToe", "toes"), ("Elbow", "elbow"),
        ("Wrist", "wrist"),
    )
}  # fmt: skip
# Columns beside the aligned one that count: features tell the phase roughly.
_BESIDE = 6
# Poses and movements that differ by so much from what is seen count little; lengths of the leg.
_AGREES = 0.04
# Movements are differences over so many columns, and count by this time.
_MOVED_COLUMNS, _MOVED_S = 2, 0.08


class Track(NamedTuple):
    """What priors are held against: points (frames, points, 3), their confidence, the rate."""

    names: tuple[str, ...]
    points: Floats
    confidence: Floats
    rate_hz: float


def find_matches(sequence: FeatureSequence, library: ClassLibrary) -> list[Evidence]:
    """All matches that may lend priors, the cheapest first."""
    every: list[Evidence] = []
    for motion_class in library:
        every += class_distance(sequence, motion_class, threshold=MOST_COST).matches
    return sorted(every, key=lambda one: one.alignment.cost)


def keep_essential(matches: Sequence[Evidence], n_frames: int) -> list[Evidence]:
    """Of matches, cheapest first, those of which half is their own: eqs. (6.5) and (6.6)."""
    taken: list[Evidence] = []
    owner = np.zeros(n_frames, dtype=bool)
    for match in matches:
        span = slice(match.alignment.start, match.alignment.end + 1)
        if owner[span].mean() <= 0.5:
            taken.append(match)
            owner[span] = True
    return taken


def prototypes(library: ClassLibrary) -> dict[int, tuple[str, str]]:
    """Class and prototype of a pattern, by its identity."""
    return {
        id(pattern): (one.name, prototype.name)
        for one in library
        for prototype, (_, pattern) in zip(one.prototypes, one.patterns, strict=True)
    }


def columns_of(match: Evidence, track: Track) -> NDArray[np.intp]:
    """The column of each frame of the track, -1 outside of the match."""
    path = match.alignment.path
    columns = np.full(len(track.points), -1, dtype=np.intp)
    at = np.round(path[:, 1] * track.rate_hz / SEQUENCE_HZ).astype(np.intp)
    inside = at < len(columns)
    at, rows = at[inside], path[inside, 0]
    if len(at) < 2:
        return columns
    span = np.arange(at[0], at[-1] + 1)
    columns[span] = np.round(np.interp(span, at, rows)).astype(np.intp)
    return columns


# ---- memory


class PoseMemory(NamedTuple):
    """Poses of examples by the columns of templates.

    `poses` by class and prototype: arrays (examples, columns, points of `LENT`, 3) in body axes,
    NaN where an example has no such point.
    """

    poses: dict[tuple[str, str], Floats]

    def save(self, path: str | Path) -> None:
        """Write as .npz."""
        named = {f"{one}\t{other}": poses for (one, other), poses in self.poses.items()}
        with write_atomically(path) as beside, beside.open("wb") as file:
            np.savez_compressed(file, **named)  # type: ignore[arg-type]

    @classmethod
    def load(cls, path: str | Path) -> "PoseMemory":
        """What was saved; also means of examples, as the first version saved them."""
        try:
            poses = {_split(key): one for key, one in ArchivedArrays(Path(path)).items()}
        except UnreadableFile as error:
            raise UnreadableFile(f"is no memory of poses: {error.problem}", file=path) from error
        poses = {key: one[None] if one.ndim == 3 else one for key, one in poses.items()}
        shape = (len(LENT), 3)
        if any(one.ndim != 4 or one.shape[2:] != shape for one in poses.values()):
            raise InvalidInput(f"needs poses (examples, columns, {len(LENT)}, 3)", file=path)
        return cls(poses)


def _split(key: str) -> tuple[str, str]:
    one, _, other = key.partition("\t")
    return one, other


def remember_poses(library: ClassLibrary, examples: Mapping[str, Sequence[Motion]]) -> PoseMemory:
    """Poses of examples in the columns of each prototype of their class.

    Parameters
    ----------
    library : classes
    examples : motions of each class, by its name; of several people at best
    """
    poses = {}
    for motion_class in library:
        rows: dict[int, list[Floats]] = {}
        for motion in examples.get(motion_class.name, ()):
            sequence = compute_features(motion, feature_set=library.feature_set)
            own = own_axes(_lent_joints(motion))[0]
            for match in class_distance(sequence, motion_class, threshold=MOST_COST).matches:
                rows.setdefault(id(match.pattern), []).append(_by_column(match, own))
        for prototype, (_, pattern) in zip(
            motion_class.prototypes, motion_class.patterns, strict=True
        ):
            if id(pattern) in rows:
                poses[motion_class.name, prototype.name] = np.stack(rows[id(pattern)])
    return PoseMemory(poses)


def remember_best(
    library: ClassLibrary, matches: Sequence[Evidence], own: Floats, rate_hz: float
) -> PoseMemory:
    """Poses of the recording's own best match of each class, as printed in section 6.4.3.

    `own` are points in body axes, (frames, points of `LENT`, 3).
    """
    keys = prototypes(library)
    at_30 = resample(own, rate_hz=rate_hz, to_hz=SEQUENCE_HZ)
    poses: dict[tuple[str, str], Floats] = {}
    for match in sorted(matches, key=lambda one: one.alignment.cost):
        poses.setdefault(keys[id(match.pattern)], _by_column(match, at_30)[None])
    return PoseMemory(poses)


def _lent_joints(motion: Motion) -> dict[str, Floats]:
    """Keypoints of a motion at 30 Hz, by their names."""
    joints = resample(motion.generic_positions(), rate_hz=motion.rate_hz, to_hz=SEQUENCE_HZ)
    wanted = {**LENT, "LHip": "lhip", "RHip": "rhip"}
    return {name: joints[:, GENERIC_JOINTS.index(joint)] for name, joint in wanted.items()}


def _by_column(match: Evidence, own: Floats) -> Floats:
    """Means of poses (frames at 30 Hz, points, 3) over the frames of each column."""
    path = match.alignment.path
    n_columns = len(match.template.values)
    result = np.full((n_columns, *own.shape[1:]), np.nan)
    for column in range(n_columns):
        frames = path[path[:, 0] == column, 1]
        frames = frames[frames < len(own)]
        if len(frames):
            result[column] = own[frames].mean(axis=0)
    # A path may skip columns.
    return bridge(result)


class BodyFrame(NamedTuple):
    """A body's own axes: origins (frames, 3), turns (frames, 3, 3), length of the leg."""

    origins: Floats
    turns: Floats
    leg: float

    def to_world(self, own: Floats) -> Floats:
        """Points (frames, points, 3) of body axes in the world, metres."""
        turned = np.einsum("fij,fpj->fpi", self.turns, own) * self.leg
        points: Floats = turned + self.origins[:, None]
        return points

    def to_own(self, points: Floats) -> Floats:
        """Points of the world in body axes."""
        own: Floats = (
            np.einsum("fji,fpj->fpi", self.turns, points - self.origins[:, None]) / self.leg
        )
        return own


def own_axes(at: Mapping[str, Floats]) -> tuple[Floats, BodyFrame]:
    """Points of `LENT` in body axes, and these axes; NaN for points that are not there.

    Without a hip, or without a whole leg, the axes are unknown, and all is NaN.
    """
    lost = np.full_like(next(iter(at.values())), np.nan)
    left, right = at.get("LHip", lost), at.get("RHip", lost)
    across = unit_vectors((left - right) * [1.0, 0.0, 1.0])
    up = np.broadcast_to([0.0, 1.0, 0.0], across.shape)
    turns = np.stack([across, up, np.cross(across, up)], axis=-1)
    legs = [[at[side + joint] for joint in ("Hip", "Knee", "Ankle")] for side in "LR"
            if {side + "Hip", side + "Knee", side + "Ankle"} <= set(at)]  # fmt: skip
    lengths = [
        sum(np.nanmedian(np.linalg.norm(a - b, axis=1)) for a, b in pairwise(leg)) for leg in legs
    ]
    frame = BodyFrame((left + right) / 2, turns, float(np.mean(lengths)) if lengths else np.nan)
    points = np.stack([at.get(name, lost) for name in LENT], axis=1)
    return frame.to_own(points), frame


# ---- poses that agree with what is seen


class Candidates(NamedTuple):
    """Poses that a match offers.

    `frames` (n,) of the track; `poses` (n, candidates, points, 3); `distances` (n, candidates,
    points), squared, NaN where a point is not seen.
    """

    frames: NDArray[np.intp]
    poses: Floats
    distances: Floats

    def without(self, limb: Sequence[int]) -> Floats:
        """Mean distances (n, candidates) of points that are not of a limb; 0 if none is seen."""
        others = np.delete(self.distances, list(limb), axis=2)
        known = ~np.isnan(others)
        mean: Floats = np.nansum(others, axis=2) / np.maximum(known.sum(axis=2), 1)
        lost = np.isnan(self.poses[:, :, list(limb), 0]).any(axis=2)
        return np.where(lost, np.inf, mean)


def find_candidates(
    poses: Floats, columns: NDArray[np.intp], own: Floats, seen: Bools, rate_hz: float
) -> Candidates:
    """Poses (examples, columns, points, 3) near the aligned columns, and how they fit what is seen.

    `columns` of each frame are -1 outside of the match; `own` are points of the track in body axes,
    (frames, points, 3), and `seen` which of them views tell.
    """
    frames = np.flatnonzero(columns >= 0)
    n_columns = poses.shape[1]
    near = columns[frames][:, None] + np.arange(-_BESIDE, _BESIDE + 1)
    inside = (near >= 0) & (near < n_columns)
    near = np.clip(near, 0, n_columns - 1)
    moved = _movement(poses, _MOVED_COLUMNS, SEQUENCE_HZ, axis=1)
    step = max(1, round(_MOVED_COLUMNS * rate_hz / SEQUENCE_HZ))
    own_moved = _movement(own, step, rate_hz, axis=0)[frames]
    offered = np.moveaxis(poses[:, near], 0, 1)
    distances = ((offered - own[frames][:, None, None]) ** 2).sum(axis=-1)
    off = np.moveaxis(moved[:, near], 0, 1) - own_moved[:, None, None]
    distances += _MOVED_S**2 * (off**2).sum(axis=-1)
    distances = np.where(seen[frames][:, None, None], distances, np.nan)
    lost = np.where(inside, 0.0, np.nan)[:, None, :, None, None]
    shape = (len(frames), -1, poses.shape[2])
    return Candidates(frames, (offered + lost).reshape(*shape, 3), distances.reshape(shape))


def _movement(values: Floats, step: int, rate_hz: float, *, axis: int) -> Floats:
    """Velocities over so many steps to either side, fewer at the ends."""
    at = np.arange(values.shape[axis])
    ahead, behind = np.minimum(at + step, len(at) - 1), np.maximum(at - step, 0)
    shape = [1] * values.ndim
    shape[axis] = len(at)
    seconds = (np.maximum(ahead - behind, 1) / rate_hz).reshape(shape)
    velocity: Floats = (np.take(values, ahead, axis) - np.take(values, behind, axis)) / seconds
    return velocity


def blend(offers: Sequence[Candidates], limb: Sequence[int], n_frames: int) -> Floats:
    """Poses of a limb (frames, points of the limb, 3) by the rest of the body; NaN without any."""
    own = list(limb)
    distances = [one.without(own) for one in offers]
    least = np.full(n_frames, np.inf)
    for one, distance in zip(offers, distances, strict=True):
        least[one.frames] = np.minimum(least[one.frames], distance.min(axis=1))
    total, whole = np.zeros((n_frames, len(own), 3)), np.zeros(n_frames)
    for one, distance in zip(offers, distances, strict=True):
        floor = np.where(np.isfinite(least), least, 0.0)[one.frames, None]
        weights = np.exp((floor - distance) / (2 * _AGREES**2))
        total[one.frames] += np.einsum("nc,ncpi->npi", weights, np.nan_to_num(one.poses[:, :, own]))
        whole[one.frames] += weights.sum(axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        result: Floats = total / whole[:, None, None]
    return result
