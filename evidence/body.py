"""The body: mesh, chain, derivatives, fits, depth, and real motions that drive it."""

import time
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from evidence.common.recordings import CMU, HDM05, Recordings, Results
from evidence.common.twists import pose_by_twists
from motionary.body import (
    Body,
    Camera,
    Points,
    Pose,
    add_kinect_noise,
    add_time_of_flight_noise,
    blend_matrix,
    fit_points,
    fit_surface,
    jacobian,
    load_body,
    pose_body,
    pose_from_motion,
    render_depth,
    shade,
    skin,
)
from motionary.body.fitting import FitSettings
from motionary.body.rendering import KINECT_SPREAD, KINECT_STEP, TIME_OF_FLIGHT_SPREAD
from motionary.features import FULL_BODY, compute_features
from motionary.io import read
from motionary.motion import GENERIC_JOINTS, Motion
from motionary.packing import unpack
from motionary.rotations import quaternions_to_matrices, rotation_vectors_to_quaternions
from motionary.skeletons import named_mapping

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TITLE = "The body"
SPLIT = "nothing is learned; nothing is chosen on these recordings"
SEED = 0

Floats = NDArray[np.float64]

#: What drives the body, and a moment of each for the sheet, as a fraction of its length.
MOTIONS = {
    "walk": ("cmu/35_01.amc", 0.5),
    "jump": ("hdm05/hopBothLegs1hops", 0.58),
    "cartwheel": ("cmu/49_08.amc", 0.147),
    "squat": ("hdm05/squat1Reps", 0.5),
    "kick": ("hdm05/kickLFront1Reps", 0.5),
    "throw": ("hdm05/throwBasketball", 0.45),
    "lying": ("hdm05/lieDownFloor", 0.95),
    "sneak": ("hdm05/sneak2StepsLStart", 0.5),
}
DATA = (
    (f"eight recordings of {CMU}; {HDM05}", lambda recordings: (8, 0.9)),
    (
        "images and joints of a Kinect (UTD-MHAD; Chen, Jafari, Kehtarnavaz 2015)",
        lambda recordings: (54, 1.0),
    ),
)
SEEDS, POSES = 20, 500
#: Joints whose distance behind the surface is measured: those that a Kinect names, too.
BEHIND = ("root", "belly", "chest", "head", *(side + one for side in "lr" for one in (
    "upperarm", "forearm", "hand", "thigh", "shank", "foot")))  # fmt: skip
#: Variance of half a pixel of jitter, rounded to whole pixels.
JITTER_PX2 = 0.325
ASSETS = Path(str(files("motionary"))) / "io" / "assets" / "body"
#: Joints of the body that stand for generic ones.
JOINTS = {
    "root": "root", "belly": "belly", "chest": "chest", "neck": "head",
    **{
        side + generic: side + own
        for side in "lr"
        for generic, own in {
            "hip": "thigh", "knee": "shank", "ankle": "foot", "clavicle": "clavicle",
            "shoulder": "upperarm", "elbow": "forearm", "wrist": "hand",
        }.items()
    },
}  # fmt: skip
ENDS = {"headtop": 0, "lfingers": 1, "rfingers": 2, "ltoes": 3, "rtoes": 4}


def measure(recordings: Recordings) -> Results:
    """All tables of the page."""
    return {
        "mesh": {("fine" if fine else "coarse"): _mesh(fine) for fine in (False, True)},
        "away_mm": _away(),
        "exact": _exact(),
        "motions": {name: _drive(recordings, name) for name in MOTIONS},
        "fits": _fits(),
        "depth": _depth(recordings),
        "speed": _speed(),
    }


def _mesh(fine: bool) -> Results:
    body = load_body(fine=fine)
    corners = body.vertices[body.faces]
    volumes = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
    left = corners.mean(axis=1)[:, 0] > 0
    return {
        "vertices": len(body.vertices),
        "triangles": len(body.faces),
        "volume_l": 1000 * volumes.sum(),
        "left_by_right": volumes[left].sum() / volumes[~left].sum(),
        "stature_m": np.ptp(body.vertices[:, 1]),
        "kib": ASSETS.joinpath("body_fine.npz" if fine else "body.npz").stat().st_size / 1024,
        "most_bones": int((body.surface.weights > 0).sum(axis=1).max()),
        "sums_off": 1e9 * float(np.abs(body.surface.weights.sum(axis=1) - 1).max()),
    }


def _away() -> list[float]:
    """Mean, 95 % and largest distance of the fine mesh's vertices to the coarse surface."""
    fine, coarse = load_body(fine=True), load_body()
    distances = 1000 * _distances(coarse.vertices, coarse.faces, fine.vertices)
    return [*np.percentile(distances, [50, 95, 100]), float(distances.mean())]


def _exact() -> Results:
    """Largest differences between what is computed and definitions of it, over random poses."""
    body = load_body()
    rng = np.random.default_rng(SEED)
    rest = pose_body(body, np.tile(np.eye(3), (1, 20, 1, 1)))
    turn = quaternions_to_matrices(rotation_vectors_to_quaternions(rng.normal(size=3)))
    step = rng.normal(size=3)
    worst = dict.fromkeys(("loop", "moved", "twists", "derivatives", "twins"), 0.0)
    worst["rest"] = float(np.abs(skin(body, rest)[0] - body.vertices).max())
    for number in range(POSES):
        size = (0.0, 0.6, 2.5)[number % 3]
        vectors = rng.normal(size=(20, 3)) * size
        turns = quaternions_to_matrices(rotation_vectors_to_quaternions(vectors))
        some = body.points(rng.integers(0, len(body.vertices), 12))
        found = jacobian(body, pose_body(body, turns[None]), some, engine="compiled")
        other = jacobian(body, pose_body(body, turns[None]), some, engine="numpy")
        worst["twins"] = max(worst["twins"], float(np.abs(found - other).max()))
        differences = _differences(body, turns, some)
        off = np.abs(found[:, :, :63] - differences).max()
        worst["derivatives"] = max(worst["derivatives"], float(off))
        if number < 20:
            pose = pose_body(body, turns[None])
            vertices = np.asarray(skin(body, pose))[0]
            worst["loop"] = max(worst["loop"], float(np.abs(vertices - _looped(body, pose)).max()))
            moved = Pose(turn @ pose.rotations, pose.joints @ turn.T + step)
            carried = np.asarray(skin(body, moved))[0] - (vertices @ turn.T + step)
            worst["moved"] = max(worst["moved"], float(np.abs(carried).max()))
            chained = pose_by_twists(body, vectors, np.zeros(6))[:, :3, :3] - pose.rotations[0]
            worst["twists"] = max(worst["twists"], float(np.abs(chained).max()))
    return {name: 1e15 * value for name, value in worst.items()}


def _differences(body: Body, turns: Floats, points: Points) -> Floats:
    """Central differences by all turns and the step, shape (points, 3, 63)."""
    small = 1e-6
    both = []
    for sign in (1, -1):
        many = np.tile(turns, (63, 1, 1, 1))
        for column in range(60):
            vector = np.zeros(3)
            vector[column % 3] = sign * small
            change = quaternions_to_matrices(rotation_vectors_to_quaternions(vector))
            many[column, column // 3] = many[column, column // 3] @ change
        steps = np.zeros((63, 3))
        steps[60:] = sign * small * np.eye(3)
        both.append(np.asarray(skin(body, pose_body(body, many, steps), points)))
    result: Floats = ((both[0] - both[1]) / (2 * small)).transpose(1, 2, 0)
    return result


def _looped(body: Body, pose: Pose) -> Floats:
    """The mesh in a pose, one vertex and one bone at a time."""
    rest, bones, weights, _ = body.surface
    turns, joints = pose.rotations[0], pose.joints[0]
    result = np.zeros_like(rest)
    for i in range(len(rest)):
        for bone, weight in zip(bones[i], weights[i], strict=True):
            seen = rest[i] - body.joints[bone]
            result[i] += weight * (turns[bone] @ seen + joints[bone])
    return result


def _motion(recordings: Recordings, name: str) -> Motion:
    place = recordings.folder / MOTIONS[name][0]
    path = place if place.suffix else sorted(place.glob("*.amc"))[0]
    return read(path)


def _drive(recordings: Recordings, name: str) -> Results:
    """How near the driven body is to the motion, and how alike their features are."""
    body, motion = load_body(), _motion(recordings, name)
    driven = pose_from_motion(body, motion)
    joints, vertices = motion.generic_positions(), np.asarray(skin(body, driven.pose))
    legs = [
        np.linalg.norm(
            driven.pose.joints[:, body.index(side + own)]
            - joints[:, GENERIC_JOINTS.index(side + generic)],
            axis=1,
        ).max()
        for side in "lr"
        for generic, own in (("hip", "thigh"), ("knee", "shank"), ("ankle", "foot"))
    ]
    chest = driven.pose.rotations[:, body.index("chest")]
    away = (
        driven.pose.joints[:, body.index("lupperarm")]
        - joints[:, GENERIC_JOINTS.index("lshoulder")]
    )
    steady = np.einsum("fji,fj->fi", chest, away).std(axis=0).max()
    lowest = vertices[..., 1].min(axis=1)
    same = _same_features(motion, driven.pose.joints, vertices[:, body.ends])
    return {
        "legs_mm": 1000 * max(legs),
        "lowest_cm": 100 * np.percentile(lowest, [5, 50, 95]),
        "own_cm": 100 * np.median(np.nanmin(joints[..., 1], axis=1)),
        "shoulder_sd_mm": 1000 * steady,
        "same": float(np.mean(list(same.values()))),
        "features": same,
    }


def _same_features(motion: Motion, posed: Floats, ends: Floats) -> dict[str, float]:
    """Share of frames in which each feature of the body's joints is the file's."""
    body = load_body()
    head = (posed[:, body.index("head")] + ends[:, ENDS["headtop"]]) / 2
    places = np.stack([head] * len(GENERIC_JOINTS), axis=1)
    for joint, end in ENDS.items():
        places[:, GENERIC_JOINTS.index(joint)] = ends[:, end]
    for joint, name in JOINTS.items():
        places[:, GENERIC_JOINTS.index(joint)] = posed[:, body.index(name)]
    own = Motion(GENERIC_JOINTS, places, motion.recording, named_mapping("generic"))
    of_file, of_body = (compute_features(one) for one in (motion, own))
    known = unpack(of_file.known & of_body.known, len(FULL_BODY))
    same = unpack(~(of_file.packed ^ of_body.packed), len(FULL_BODY))
    return {
        feature.name: float(same[known[:, k], k].mean())
        for k, feature in enumerate(FULL_BODY.features)
        if known[:, k].any()
    }


def _planted(seed: int, size: float) -> Any:
    rng = np.random.default_rng(seed)
    body = load_body()
    vectors = rng.normal(size=(len(body.names), 3)) * size
    turns = quaternions_to_matrices(rotation_vectors_to_quaternions(vectors))
    return rng, body, turns[None]


def _fits() -> Results:
    """Planted poses and shapes found again."""
    middles, angles, surfaces = [], [], []
    for seed in range(SEEDS):
        rng, body, turns = _planted(seed, 0.35)
        shape = {"height": rng.uniform(-0.4, 0.4), "gender": rng.uniform(-0.5, 0.5)}
        true = body.shaped(shape)
        pose = pose_body(true, turns, rng.normal(size=(1, 3)))
        both = _joints_and_ends(body)
        exact = np.asarray(skin(true, pose, _joints_and_ends(true)))[0]
        targets = exact + rng.normal(size=exact.shape) * 0.01 / np.sqrt(3)
        targets[rng.choice(len(exact), 2, replace=False)] += rng.normal(size=(2, 3)) * 0.5
        fit = fit_points(
            body, both, targets, settings=FitSettings(shape_prior_m=0.02, turn_prior_m=0.01)
        )
        found = fit.pose.joints[0]
        middles.append(np.median(np.linalg.norm(found - pose.joints[0], axis=1)))
        angles.append(np.median(_angles(body.parents, found, pose.joints[0])))
    for seed in range(SEEDS // 4):
        rng, body, turns = _planted(seed, 0.3)
        pose = pose_body(body, turns)
        vertices = np.asarray(skin(body, pose))[0]
        chosen = body.faces[rng.integers(len(body.faces), size=2000)]
        cloud = (rng.dirichlet((1, 1, 1), 2000)[..., None] * vertices[chosen]).sum(axis=1)
        noisy = pose.joints[0] + rng.normal(size=(20, 3)) * 0.02
        start = fit_points(body, body.joint_points(), noisy).pose
        fit = fit_surface(body, cloud, start=start)
        surfaces.append(_to_surface(np.asarray(skin(body, fit.pose))[0], body.faces, vertices))
    return {
        "joints_mm": 1000 * np.array([np.median(middles), max(middles)]),
        "directions_deg": [np.median(angles), max(angles)],
        "surface_mm": 1000 * np.array([np.median(surfaces), max(surfaces)]),
    }


def _joints_and_ends(body: Body) -> Points:
    """The joints and the ends of the body as points."""
    joints, ends = body.joint_points(), body.points(body.ends)
    more = ((0, 0), (0, ends.bones.shape[1] - joints.bones.shape[1]))
    return Points(
        np.concatenate([joints.rest, ends.rest]),
        np.concatenate([np.pad(joints.bones, more), ends.bones]),
        np.concatenate([np.pad(joints.weights, more), ends.weights]),
        np.concatenate([joints.shapes, ends.shapes], axis=1),
    )


def _angles(parents: NDArray[np.intp], found: Floats, true: Floats) -> list[float]:
    result = []
    for joint, parent in enumerate(parents):
        if parent >= 0:
            a, b = found[joint] - found[parent], true[joint] - true[parent]
            cosine = a @ b / np.linalg.norm(a) / np.linalg.norm(b)
            result.append(float(np.degrees(np.arccos(np.clip(cosine, -1, 1)))))
    return result


def _to_surface(vertices: Floats, faces: NDArray[np.intp], others: Floats) -> float:
    """Mean distance of points to the planes of the triangles with the nearest middles."""
    from scipy.spatial import cKDTree

    corners = vertices[faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
    nearest = cKDTree(corners.mean(axis=1)).query(others)[1]
    return float(np.abs(((others - corners[nearest, 0]) * across[nearest]).sum(axis=1)).mean())


def _distances(vertices: Floats, faces: NDArray[np.intp], others: Floats) -> Floats:
    """Distances of points to a surface, by many points of each triangle."""
    from scipy.spatial import cKDTree

    n = 12
    shares = np.array([(i, j, n - i - j) for i in range(n + 1) for j in range(n + 1 - i)]) / n
    points = np.einsum("sc,fcx->fsx", shares, vertices[faces]).reshape(-1, 3)
    return np.asarray(cKDTree(points).query(others)[0])


def _depth(recordings: Recordings) -> Results:
    """Noise on a plane and a sphere by its formula; how far joints lie behind the surface."""
    body, camera = load_body(), Camera()
    rays = camera.unproject(np.ones((camera.height, camera.width)))
    sphere = _sphere(rays, np.array([0, 0, 3.0]), 0.5)
    noise: Results = {}
    for name, depth in (("plane", np.full(sphere.shape, 3.0)), ("sphere", sphere)):
        noise[name] = {
            "kinect": _moment(
                add_kinect_noise(depth, camera, seed=SEED) - depth,
                np.sqrt(
                    (KINECT_SPREAD**2 + KINECT_STEP**2 / 12) * depth**4
                    + JITTER_PX2 * (np.square(np.gradient(depth)).sum(axis=0))
                ),
            ),
            "flight": _moment(
                add_time_of_flight_noise(depth, seed=SEED, mixed=False) - depth,
                TIME_OF_FLIGHT_SPREAD * depth**2,
            ),
        }
    behind, here = [], [body.index(name) for name in BEHIND]
    for name in ("walk", "squat", "throw", "sneak"):
        motion = _motion(recordings, name)
        driven = pose_from_motion(body, motion)
        for frame in range(0, motion.n_frames, max(motion.n_frames // 10, 1)):
            joints = driven.pose.joints[frame]
            vertices = np.asarray(skin(body, _one(driven.pose, frame)))[0]
            front = driven.pose.rotations[frame, 0] @ (0, 0, 1)
            front = np.array([front[0], 0, front[2]]) / np.hypot(front[0], front[2])
            view = camera.looking_at(joints[0] + 2.8 * front, joints[0])
            image = render_depth(vertices, body.faces, view)
            columns, rows = np.rint(view.project(joints[here])).astype(int).T
            inside = (rows >= 0) & (rows < 240) & (columns >= 0) & (columns < 320)
            seen = image.depth[rows[inside], columns[inside]]
            behind.append(1000 * (view.to_camera(joints[here])[inside, 2] - seen))
    away = np.concatenate(behind)
    away = away[np.isfinite(away)]
    return {
        "noise": noise,
        "behind_mm": np.percentile(away, [10, 50, 90]),
        "real_behind_mm": _behind_kinect(recordings),
    }


def _one(pose: Pose, frame: int) -> Pose:
    part = slice(frame, frame + 1)
    return Pose(pose.rotations[part], pose.joints[part], pose.stretches)


def _sphere(rays: Floats, middle: Floats, radius: float) -> Floats:
    """Depth of a sphere by rays whose third coordinate is 1; NaN where they miss it."""
    squares, along = (rays**2).sum(axis=-1), rays @ middle
    root = along**2 - squares * (middle @ middle - radius**2)
    with np.errstate(invalid="ignore"):
        return np.asarray((along - np.sqrt(root)) / squares)


def _moment(errors: Floats, formula: Floats) -> float:
    """Standard deviation of errors over what a formula says, away from edges."""
    flat = np.abs(np.gradient(formula, axis=1)) < 0.02 * formula
    share = (errors / formula)[flat & np.isfinite(errors)]
    return float(share.std())


def _behind_kinect(recordings: Recordings) -> list[float]:
    """The same of a Kinect's own joints and images (UTD-MHAD), millimetres."""
    from scipy.io import loadmat

    focal, behind = Camera().focal[0], []
    folder = recordings.folder / "sensors" / "utd_mhad"
    for path in sorted(folder.glob("*_depth.mat")):
        images = loadmat(path)["d_depth"]
        skeletons = loadmat(path.with_name(path.name.replace("depth", "skeleton")))["d_skel"]
        for frame in range(0, images.shape[2], 10):
            x, y, z = skeletons[[0, 1, 2, 3, 4, 5, 6, 8, 9, 10, 12, 13, 14, 16, 17, 18], :, frame].T
            columns = np.rint(160 + focal * x / z).astype(int)
            rows = np.rint(120 - focal * y / z).astype(int)
            inside = (rows >= 0) & (rows < 240) & (columns >= 0) & (columns < 320)
            seen = images[rows[inside], columns[inside], frame]
            behind.append((1000 * z[inside] - seen)[seen > 0])
    return [float(one) for one in np.percentile(np.concatenate(behind), [10, 50, 90])]


def _speed() -> Results:
    """How many a second, on one thread."""
    _, body, turns = _planted(1, 0.4)
    pose, many = pose_body(body, turns), pose_body(body, np.tile(turns, (512, 1, 1, 1)))
    some = body.points(np.arange(0, 1000, 4))
    double = blend_matrix(body)
    single = double.astype(np.float32)
    product, thin = np.zeros((80, 1536)), np.zeros((80, 1536), np.float32)
    camera = Camera().looking_at(np.array([0, 1.0, 3.0]), np.array([0, 0.9, 0]))

    def image(engine: Any) -> Callable[[], Any]:
        return lambda: render_depth(body.vertices, body.faces, camera, engine=engine)

    return {
        "skinned": 512 * _rate(lambda: skin(body, many, blend=double)),
        "skinned_single": 512 * _rate(lambda: skin(body, many, blend=single)),
        "product": 512 * _rate(lambda: double @ product),
        "product_single": 512 * _rate(lambda: single @ thin),
        "derivatives": _rate(lambda: jacobian(body, pose, some, engine="compiled")),
        "derivatives_numpy": _rate(lambda: jacobian(body, pose, some, engine="numpy")),
        "depth_ms": 1000 / _rate(image("compiled")),
        "depth_numpy_ms": 1000 / _rate(image("numpy")),
    }


def _rate(call: Callable[[], Any]) -> float:
    """Calls a second of processor time, the best of five."""
    call()
    best = 0.0
    for _ in range(5):
        began, count = time.process_time(), 0
        while time.process_time() - began < 0.1:
            call()
            count += 1
        best = max(best, count / (time.process_time() - began))
    return best


def draw_recordings(recordings: Recordings, results: Results) -> "dict[str, Figure]":
    """The body in eight motions, from in front and from aside."""
    from matplotlib.figure import Figure

    body = load_body(fine=True)
    figure = Figure(figsize=(7.5, 3.9))
    for number, (name, (_, moment)) in enumerate(MOTIONS.items()):
        motion = _motion(recordings, name)
        frame = int(moment * (motion.n_frames - 1))
        pose = pose_from_motion(body, motion.cut(frame, frame + 1)).pose
        vertices = np.asarray(skin(body, pose))[0]
        middle = (vertices.max(axis=0) + vertices.min(axis=0)) / 2
        away = max(2.7, 2.7 * np.ptp(vertices[:, [0, 2]], axis=0).max())
        front = pose.rotations[0, 0] @ (0, 0, 1)
        front = np.array([front[0], 0, front[2]]) / max(np.hypot(front[0], front[2]), 1e-9)
        for view, way in enumerate((front, np.array([front[2], 0, -front[0]]))):
            camera = Camera(240, 420, (560.0, 560.0), (120.0, 210.0)).looking_at(
                middle + away * way + np.array([0, 0.3, 0]), middle
            )
            bright = shade(render_depth(vertices, body.faces, camera), vertices, body.faces, camera)
            axes = figure.add_axes((
                (number % 4) / 4 + view / 8, 0.5 - (number // 4) * 0.5, 1 / 8, 0.44))  # fmt: skip
            axes.imshow(
                np.where(np.isnan(bright), 1.0, 0.15 + 0.7 * bright), cmap="gray", vmin=0, vmax=1
            )
            axes.set_axis_off()
        figure.text(
            (number % 4) / 4 + 1 / 8, 0.955 - (number // 4) * 0.5, name, ha="center", size=9
        )
    return {"body": figure}
