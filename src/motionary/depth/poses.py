"""A database of poses: what a person's whole body may look like.

After Baak (2012), section 8.3.3: poses of recordings, told apart by (8.1), free of place and
viewing direction; each with where the middle of its points lies, measured as in a camera's image.

Conventions: turns relative to the parent joint; the viewing direction is +z. Poses are of
`ACTIVE` joints; hands and toes stay as they are at rest.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.body import Body, Camera, load_body, pose_body, pose_from_motion, render_depth, skin
from motionary.body.model import Pose, local_rotations
from motionary.depth.clouds import build_graph, prepare
from motionary.errors import InvalidInput, describe_cause
from motionary.motion import Motion
from motionary.rotations import (
    matrices_to_quaternions,
    matrices_to_rotation_vectors,
)

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

#: Joints of the body that turn: all but hands and toes.
ACTIVE = (
    "root", "belly", "chest", "head", "lclavicle", "lupperarm", "lforearm", "lthigh", "lshank",
    "lfoot", "rclavicle", "rupperarm", "rforearm", "rthigh", "rshank", "rfoot",
)  # fmt: skip
#: Poses of the database differ by more (8.1), over the joints that turn and hands and toes.
LEAST_DISTANCE_M = 0.018
#: Viewing directions from which the middle of a pose's points is measured.
N_VIEWS = 8
_STEPS_TO_CENTRE, _CENTRE_M, _TORSO_M = 5, 0.3, 0.15
#: What mirrors a pose: x changes its sign, left and right change places.
FLIP = np.diag([-1.0, 1.0, 1.0])


class Heading(NamedTuple):
    """Where a person looks, by the points around the middle.

    `angle` about the vertical, 0 along +z, in radians; `trust` in [0, 1].
    """

    angle: float
    trust: float


def find_centre(points: Floats, torso: NDArray[np.bool_] | None = None) -> Floats:
    """The middle of a person's points: a mean shift from their median."""
    centre: Floats = np.median(points if torso is None else points[torso], axis=0)
    for _ in range(_STEPS_TO_CENTRE):
        near = ((points - centre) ** 2).sum(axis=1) < _CENTRE_M**2
        if near.any():
            centre = 0.5 * centre + 0.5 * points[near].mean(axis=0)
    return centre


def find_heading(points: Floats, centre: Floats, towards: Floats) -> Heading:
    """The viewing direction: the normal of the torso's plane, `towards` the camera."""
    near = points[((points - centre) ** 2).sum(axis=1) < _TORSO_M**2]
    if len(near) < 10:
        return Heading(0.0, 0.0)
    values, vectors = np.linalg.eigh(np.cov(near.T))
    normal = vectors[:, 0] * np.sign(vectors[:, 0] @ towards)
    flat = values[0] / max(0.15 * values[1], 1e-12)
    round_ = 1.5 * values[1] / max(values[2], 1e-12) - 0.3
    trust = float(np.clip(1 - flat, 0, 1) * np.clip(round_, 0, 1))
    return Heading(float(np.arctan2(normal[0], normal[2])), trust)


def turn_about_up(angle: float) -> Floats:
    """The turn by an angle about the vertical, shape (3, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def heading_of(rotations: Floats, body: Body) -> Floats:
    """The viewing directions of poses by their trunk, from global turns (n, joints, 3, 3)."""
    forward = rotations[:, body.index("belly"), :, 2] + rotations[:, body.index("chest"), :, 2]
    angles: Floats = np.arctan2(forward[:, 0], forward[:, 2])
    return angles


@dataclass(frozen=True, eq=False)
class PoseDatabase:
    """Poses by turns, and where their points' middle lies.

    Attributes
    ----------
    turns : array, shape (poses, active, 4), quaternions of `ACTIVE` relative to the parents
    centres : array, shape (poses, views, 3), metres, middle of the seen points from the root,
        for views from `N_VIEWS` sides, in a body of 1.66 m
    mean, covariance : of the rotation vectors (45,) of all joints but the root, in all frames
        that poses were chosen from
    provenance : what it was made of
    licence : of it
    """

    turns: Floats
    centres: Floats
    mean: Floats
    covariance: Floats
    provenance: Mapping[str, object] = field(default_factory=dict)
    licence: str = ""

    def __post_init__(self) -> None:
        n, bones = len(self.turns), 3 * (len(ACTIVE) - 1)
        for what, shape, wanted in (
            ("turns", self.turns.shape, (n, len(ACTIVE), 4)),
            ("centres", self.centres.shape, (n, N_VIEWS, 3)),
            ("mean", self.mean.shape, (bones,)),
            ("covariance", self.covariance.shape, (bones, bones)),
        ):
            if shape != wanted or n == 0:
                raise InvalidInput(f"a database of {n} poses needs {what} {wanted}, got {shape}")

    def __len__(self) -> int:
        return len(self.turns)

    def __repr__(self) -> str:
        return f"PoseDatabase({len(self)} poses)"

    def save(self, path: str | Path) -> None:
        """Write it as .npz; `load_database` reads it."""
        from motionary.files import write_atomically

        with write_atomically(path) as beside, beside.open("wb") as file:
            np.savez_compressed(file, **database_to_arrays(self))  # type: ignore[arg-type]


def load_database(path: str | Path | None = None) -> PoseDatabase:
    """A database from its file; without one that which ships, of CMU's recordings."""
    if path is None:
        from motionary.io.assets import read_poses

        return database_from_arrays(read_poses())
    from motionary.io.formats.npz import ArchivedArrays

    return database_from_arrays(ArchivedArrays(Path(path)))


def database_to_arrays(database: PoseDatabase) -> dict[str, NDArray[np.generic]]:
    """Plain arrays of a database, for a file without pickle."""
    import json

    return {
        "turns": database.turns.astype(np.float16),
        "centres": database.centres.astype(np.float16),
        "mean": database.mean.astype(np.float32),
        "covariance": database.covariance.astype(np.float32),
        "about": np.array(
            json.dumps({"provenance": dict(database.provenance), "licence": database.licence})
        ),
    }


def database_from_arrays(arrays: Mapping[str, NDArray[np.generic]]) -> PoseDatabase:
    """A database of such arrays.

    Raises
    ------
    InvalidInput
        If an array is missing or of another shape.
    """
    import json

    names = ("turns", "centres", "mean", "covariance", "about")
    missing = [name for name in names if name not in arrays]
    if missing:
        raise InvalidInput(
            f"a pose database needs the arrays {', '.join(names)}, got none of {missing[0]!r}; "
            "make one with motionary depth database"
        )
    turns, centres, mean, covariance = (
        np.asarray(arrays[name], dtype=np.float64) for name in names[:4]
    )
    try:
        about = json.loads(str(arrays["about"]))
        provenance, licence = about["provenance"], about["licence"]
    except (ValueError, LookupError, TypeError, RecursionError) as error:
        raise InvalidInput(
            f"about: {describe_cause(error)}; motionary depth database writes it"
        ) from error
    return PoseDatabase(
        turns / np.linalg.norm(turns, axis=-1, keepdims=True),
        centres, mean, covariance, provenance, licence,
    )  # fmt: skip


def build_database(
    motions: Iterable[Motion],
    *,
    least_m: float = LEAST_DISTANCE_M,
    rate_hz: float = 30.0,
    provenance: Mapping[str, object] | None = None,
    licence: str = "",
) -> PoseDatabase:
    """A database of what people do in recordings, and of the same mirrored.

    Parameters
    ----------
    motions : of people
    least_m : poses differ by more, by (8.1)
    rate_hz : so many poses a second are chosen from
    provenance : of the recordings
    licence : of the database

    Raises
    ------
    InvalidInput
        If there is no motion, or one cannot drive the body.
    """
    body = load_body()
    turns = [_read_turns(body, motion, rate_hz) for motion in motions]
    if not turns:
        raise InvalidInput("a pose database needs at least one recording")
    both = np.concatenate(turns)
    both = np.concatenate([both, mirror_turns(both)])
    pose = expand_pose(body, both)
    places = pose.joints - pose.joints[:, :1]
    chosen = choose_apart(places[:, 1:].reshape(len(both), -1), least_m * (len(body.names) - 1))
    vectors = matrices_to_rotation_vectors(both[:, 1:])
    flat = vectors.reshape(len(both), -1)
    return PoseDatabase(
        matrices_to_quaternions(both[chosen]),
        measure_centres(body, both[chosen]),
        flat.mean(axis=0),
        np.cov(flat.T),
        dict(provenance or {}),
        licence,
    )


def expand_pose(body: Body, turns: Floats, roots: Floats | None = None) -> Pose:
    """Poses of the body by turns (n, active, 3, 3) and places of the root (n, 3)."""
    step = None if roots is None else roots - body.joints[0]
    return pose_body(body, expand_turns(body, turns), step)


def expand_turns(body: Body, turns: Floats) -> Floats:
    """Turns of all joints (n, joints, 3, 3), of those of `ACTIVE`."""
    whole = np.tile(np.eye(3), (len(turns), len(body.names), 1, 1))
    whole[:, list_active(body)] = turns
    return whole


def list_active(body: Body) -> Indices:
    """Which joints of the body those of `ACTIVE` are."""
    return np.array([body.index(name) for name in ACTIVE])


def choose_apart(places: Floats, least: float) -> Indices:
    """Rows that differ by more than `least`: each time the one farthest from all chosen."""
    chosen = [0]
    nearest = np.full(len(places), np.inf)
    # Squares of distances by one product each, in single precision: halves what memory moves.
    single = (places - places.mean(axis=0)).astype(np.float32)
    squares = np.einsum("ij,ij->i", single, single)
    while True:
        last = chosen[-1]
        away = squares + squares[last] - 2 * (single @ single[last])
        np.minimum(nearest, away, out=nearest)
        farthest = int(nearest.argmax())
        if nearest[farthest] <= least**2:
            return np.array(chosen, dtype=np.intp)
        chosen.append(farthest)


def measure_centres(body: Body, turns: Floats) -> Floats:
    """Where the middle of the points lies from the root, seen from `N_VIEWS` sides."""
    # The camera of the benchmark at half its size: the middle needs no more.
    camera = Camera(160, 120, (142.8, 142.8), (80.0, 60.0)).looking_at(
        np.array([0.0, 0.1, 3.0]), np.zeros(3)
    )
    pose = expand_pose(body, turns, np.zeros((len(turns), 3)))
    vertices = np.asarray(skin(body, pose))
    result = np.empty((len(turns), N_VIEWS, 3))
    for view in range(N_VIEWS):
        turn = turn_about_up(2 * np.pi * view / N_VIEWS)
        for number, own in enumerate(vertices @ turn.T):
            cloud = prepare(render_depth(own, body.faces, camera).depth, camera)
            graph = build_graph(cloud, camera.focal[0])
            # As the tracker finds it: from the largest component.
            result[number, view] = find_centre(graph.points, graph.torso) @ turn
    return result


def _read_turns(body: Body, motion: Motion, rate_hz: float) -> Floats:
    """Turns of `ACTIVE` in frames of a motion, facing +z, shape (n, active, 3, 3)."""
    step = max(1, round(motion.rate_hz / rate_hz))
    pose = pose_from_motion(body, motion, lengths="kept").pose
    pose = Pose(pose.rotations[::step], pose.joints[::step])
    whole = local_rotations(body, pose)
    turns: Floats = whole[:, list_active(body)]
    for frame, angle in enumerate(heading_of(pose.rotations, body)):
        turns[frame, 0] = turn_about_up(-angle) @ turns[frame, 0]
    return turns


def mirror_turns(turns: Floats) -> Floats:
    """The turns (n, active, 3, 3) of poses with left and right exchanged."""
    sides = {"l": "r", "r": "l"}
    paired = [
        sides[name[0]] + name[1:] if sides.get(name[0], "") + name[1:] in ACTIVE else name
        for name in ACTIVE
    ]
    result: Floats = FLIP @ turns[:, [ACTIVE.index(name) for name in paired]] @ FLIP
    return result


def scale_body(body: Body, scale: float) -> Body:
    """A body of another size, of the same build."""
    return replace(
        body,
        joints=body.joints * scale,
        surface=body.surface._replace(
            rest=body.surface.rest * scale, shapes=body.surface.shapes * scale
        ),
        joint_shapes=body.joint_shapes * scale,
    )
