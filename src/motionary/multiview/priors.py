"""What a recognised motion tells of points that views do not: resting feet, and poses of others.

After Baak (2012), sections 6.3 and 6.4: templates of known classes are aligned with the tracked
motion; a prior that belongs to columns of a template goes to the frames that they are aligned
with. Beyond the printed method each prior must first prove itself on what was seen: a wrong label
must do no harm.

Conventions: frames are those of the track; a body's own axes are x from the right hip to the left
one, y up and z ahead, from the middle of the hips, in lengths of the leg.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput, UnreadableFile
from motionary.features import FeatureSequence, compute_features
from motionary.files import write_atomically
from motionary.io.formats.npz import ArchivedArrays
from motionary.models.library import ClassLibrary
from motionary.models.templates import QuantisedTemplate
from motionary.motion import GENERIC_JOINTS, Motion, resample
from motionary.multiview.triangulation import bridge
from motionary.retrieval.annotation import class_distance
from motionary.retrieval.explanation import Evidence
from motionary.rotations import unit_vectors

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

#: Largest cost of a match that lends priors; damaged tracks match at .01 to .11.
MOST_COST = 0.12
SEQUENCE_HZ = 30.0
#: Keypoints that poses are lent for, and the joints that they are in.
LENT = {
    f"{side}{part}": f"{side.lower()}{joint}"
    for side in "LR"
    for part, joint in (
        ("Knee", "knee"), ("Ankle", "ankle"), ("BigToe", "toes"), ("Elbow", "elbow"),
        ("Wrist", "wrist"),
    )
}  # fmt: skip


class NamedPrior(NamedTuple):
    """What holds in columns of a template: `name`, and `columns` (columns,), where it does."""

    name: str
    columns: Bools


class PoseMemory(NamedTuple):
    """Poses of examples by the columns of templates.

    `poses` by class and prototype: arrays (columns, points of `LENT`, 3) in body axes, NaN where no
    example has the point.
    """

    poses: dict[tuple[str, str], Floats]

    def save(self, path: str | Path) -> None:
        """Write as .npz."""
        named = {f"{one}\t{other}": poses for (one, other), poses in self.poses.items()}
        with write_atomically(path) as beside, beside.open("wb") as file:
            np.savez_compressed(file, **named)  # type: ignore[arg-type]

    @classmethod
    def load(cls, path: str | Path) -> "PoseMemory":
        """What was saved."""
        try:
            poses = {_split(key): one for key, one in ArchivedArrays(Path(path)).items()}
        except UnreadableFile as error:
            raise UnreadableFile(f"is no memory of poses: {error.problem}", file=path) from error
        shape = (len(LENT), 3)
        if any(one.shape[1:] != shape for one in poses.values()):
            raise InvalidInput(f"needs poses (columns, {len(LENT)}, 3)", file=path)
        return cls(poses)


def _split(key: str) -> tuple[str, str]:
    one, _, other = key.partition("\t")
    return one, other


def named_priors(template: QuantisedTemplate, names: Sequence[str]) -> list[NamedPrior]:
    """Priors that a template tells by itself: a foot that is slow, and stays so, rests.

    `names` are those of its features, in the sequence of its cells.
    """
    found = []
    for side in ("left", "right"):
        name = f"{side} foot fast"
        if name not in names:
            continue
        column = names.index(name)
        slow = template.fixed[:, column] & ~template.values[:, column]
        # The first and the last slow column may be a step's end.
        inner = slow.copy()
        inner[1:] &= slow[:-1]
        inner[:-1] &= slow[1:]
        if inner.any():
            found.append(NamedPrior(f"{side} foot rests", inner))
    return found


def find_matches(sequence: FeatureSequence, library: ClassLibrary) -> list[Evidence]:
    """Matches that lend priors, each of the cheapest class where it is: eqs. (6.5) and (6.6)."""
    every: list[Evidence] = []
    for motion_class in library:
        every += class_distance(sequence, motion_class, threshold=MOST_COST).matches
    taken: list[Evidence] = []
    owner = np.zeros(len(sequence), dtype=bool)
    for match in sorted(every, key=lambda one: one.alignment.cost):
        span = slice(match.alignment.start, match.alignment.end + 1)
        # One essential minimum for each place: half of a match must be its own.
        if owner[span].mean() <= 0.5:
            taken.append(match)
            owner[span] = True
    return taken


# ---- poses


def remember_poses(library: ClassLibrary, examples: Mapping[str, Sequence[Motion]]) -> PoseMemory:
    """Mean poses of examples in the columns of each prototype of their class.

    Parameters
    ----------
    library : classes
    examples : motions of each class, by its name; of several people at best
    """
    poses = {}
    for motion_class in library:
        motions = examples.get(motion_class.name, ())
        for prototype, (_, pattern) in zip(
            motion_class.prototypes, motion_class.patterns, strict=True
        ):
            rows = []
            for motion in motions:
                sequence = compute_features(motion, feature_set=library.feature_set)
                for match in class_distance(sequence, motion_class, threshold=MOST_COST).matches:
                    if match.pattern is pattern:
                        rows.append(_by_column(match, own_axes(_lent_joints(motion))[0]))
            if rows:
                with np.errstate(invalid="ignore"):
                    known = ~np.isnan(np.stack(rows))
                    total = np.nansum(np.stack(rows), axis=0)
                    poses[motion_class.name, prototype.name] = np.where(
                        known.any(axis=0), total / np.maximum(known.sum(axis=0), 1), np.nan
                    )
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
        poses.setdefault(keys[id(match.pattern)], _by_column(match, at_30))
    return PoseMemory(poses)


def prototypes(library: ClassLibrary) -> dict[int, tuple[str, str]]:
    """Class and prototype of a pattern, by its identity."""
    return {
        id(pattern): (one.name, prototype.name)
        for one in library
        for prototype, (_, pattern) in zip(one.prototypes, one.patterns, strict=True)
    }


def _lent_joints(motion: Motion) -> dict[str, Floats]:
    """Keypoints of a motion at 30 Hz, by their names."""
    joints = resample(motion.generic_positions(), rate_hz=motion.rate_hz, to_hz=SEQUENCE_HZ)
    wanted = {**LENT, "LHip": "lhip", "RHip": "rhip"}
    return {name: joints[:, GENERIC_JOINTS.index(joint)] for name, joint in wanted.items()}


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
    """Points of `LENT` in body axes, and these axes; NaN for points that are not there."""
    across = at["LHip"] - at["RHip"]
    across = unit_vectors(across * [1.0, 0.0, 1.0])
    up = np.broadcast_to([0.0, 1.0, 0.0], across.shape)
    turns = np.stack([across, up, np.cross(across, up)], axis=-1)
    lengths = [
        np.nanmedian(np.linalg.norm(at[f"{s}Hip"] - at[f"{s}Knee"], axis=1))
        + np.nanmedian(np.linalg.norm(at[f"{s}Knee"] - at[f"{s}Ankle"], axis=1))
        for s in "LR"
    ]
    frame = BodyFrame((at["LHip"] + at["RHip"]) / 2, turns, float(np.mean(lengths)))
    lost = np.full_like(across, np.nan)
    points = np.stack([at.get(name, lost) for name in LENT], axis=1)
    return frame.to_own(points), frame


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
