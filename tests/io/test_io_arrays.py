"""Do arrays, SMPL's parameters and pickles become the motions that they are?"""

import gzip
import io
import os
import pickle
import tracemalloc
import zipfile
import zlib

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from motionary.errors import InvalidInput, SeveralRecordings, UnreadableFile
from motionary.features import compute_features
from motionary.io import read, read_all, write
from motionary.io.formats.smpl import NAMES, PARENTS, STATURE_M, average_skeleton
from motionary.motion import GENERIC_JOINTS, Motion
from motionary.samples import synthetic_motion
from motionary.skeletons import known_mappings, named_mapping

ORDERED = [name for name in known_mappings() if named_mapping(name).order]


def in_order(motion, name):
    """Places of a synthetic motion under the joints of an order; what it lacks lies nearby."""
    mapping = named_mapping(name)
    generic = dict(zip(GENERIC_JOINTS, np.moveaxis(motion.generic_positions(), 1, 0), strict=True))
    result = np.repeat(generic["head"][:, None], len(mapping.order), axis=1)
    for joint, weights in mapping.weights.items():
        for source in weights:
            if source in mapping.order and (len(weights) == 1 or joint not in mapping.substituted):
                result[:, mapping.order.index(source)] = generic[joint]
    return result


@pytest.mark.parametrize("name", ORDERED)
def test_an_order_that_is_told(tmp_path, name):
    array = in_order(synthetic_motion("squat", seed=1, rate_hz=60), name)
    np.save(tmp_path / "a.npy", array)
    motion = read(tmp_path / "a.npy", skeleton=name, rate_hz=60)
    assert motion.mapping.name == name
    assert motion.names == named_mapping(name).order
    np.testing.assert_allclose(motion.positions, array)
    assert motion.notes[0].startswith("unit m, by legs")
    assert motion.notes[1] == "y up, by the body"
    assert compute_features(motion).known_features.any(axis=0).sum() >= 20


@pytest.mark.parametrize("name", ["generic", "smpl", "body25", "kinect_v2", "coco", "humanml3d"])
def test_an_order_is_guessed_by_number_and_stiff_bones_and_the_guess_is_told(tmp_path, name):
    array = in_order(synthetic_motion("squat", seed=1, rate_hz=60), name)
    np.save(tmp_path / "a.npy", array)
    motion = read(tmp_path / "a.npy", rate_hz=60)
    assert motion.mapping.name == name
    assert any(note.startswith(f"order of joints guessed: {name}, by ") for note in motion.notes)


def test_humanml3d_has_20_hz(tmp_path):
    array = in_order(synthetic_motion("squat", seed=1, rate_hz=20), "humanml3d")
    np.save(tmp_path / "a.npy", array.astype(np.float32))
    motion = read(tmp_path / "a.npy")
    assert motion.rate_hz == 20
    assert "rate assumed 20 Hz, as HumanML3D has" in motion.notes


@pytest.mark.parametrize(("scale", "unit"), [(1000, "mm"), (100, "cm"), (1, "m")])
@pytest.mark.parametrize("up", ["y", "z", "-y", "-z", "x", "-x"])
def test_units_and_axes_by_the_body(tmp_path, scale, unit, up):
    array = in_order(synthetic_motion("squat", seed=2, rate_hz=60), "smpl")
    turns = {
        "y": np.eye(3),
        "z": [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
        "-y": np.diag([1, -1, -1]),
        "-z": [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
        "x": [[0, 1, 0], [-1, 0, 0], [0, 0, 1]],
        "-x": [[0, -1, 0], [1, 0, 0], [0, 0, 1]],
    }
    np.save(tmp_path / "a.npy", scale * array @ np.transpose(turns[up]))
    motion = read(tmp_path / "a.npy", skeleton="smpl", rate_hz=60)
    assert motion.notes[0].startswith(f"unit {unit}, by legs")
    assert motion.notes[1].startswith(f"{up} up, by the body")
    np.testing.assert_allclose(motion.positions, array, atol=1e-9)


def test_names_beside_positions_count(tmp_path):
    motion = synthetic_motion("squat", seed=1, rate_hz=60)
    np.savez(tmp_path / "a.npz", joints=motion.positions, joint_names=motion.names, fps=60)
    again = read(tmp_path / "a.npz")
    assert (again.names, again.rate_hz, again.mapping.name) == (motion.names, 60, "generic")


@pytest.mark.parametrize(
    ("arrays", "options", "error", "words"),
    [
        ({"x": np.ones(3)}, {}, UnreadableFile, r"expected poses and trans .* got x"),
        ({"positions": np.ones((3, 4))}, {}, UnreadableFile, r"got an array of shape \(3, 4\)"),
        ({"positions": np.ones((3, 24, 3))}, {}, InvalidInput, "no frame rate"),
        ({"positions": np.ones((3, 5, 3)), "fps": 30}, {}, InvalidInput, "known orders have"),
        ({"positions": np.ones((3, 5, 3)), "names": ["a"]}, {}, InvalidInput, "1 names for 5"),
        ({"positions": np.ones((3, 5, 3))}, {"skeleton": "smpl"}, InvalidInput, "smpl has 24"),
        ({"positions": np.ones((3, 5, 3))}, {"skeleton": "bandai"}, InvalidInput, "no usual order"),
        ({"poses": np.ones((3, 9)), "trans": np.ones((3, 3)), "fps": 9}, {}, UnreadableFile, "66"),
        ({"poses": np.ones((3, 66)), "trans": np.ones((3, 3))}, {}, InvalidInput, "no frame rate"),
        ({"motionary_motion": 1, "names": ["a"]}, {}, UnreadableFile, "no whole motion"),
        ({"motionary_motion": 9}, {}, UnreadableFile, "newer version"),
    ],
)
def test_what_cannot_be_a_motion_says_why(tmp_path, arrays, options, error, words):
    np.savez(tmp_path / "a.npz", **arrays)
    with pytest.raises(error, match=words):
        read(tmp_path / "a.npz", **options)


def test_objects_are_not_loaded(tmp_path):
    np.save(tmp_path / "a.npy", np.array([{"a": 1}], dtype=object))
    with pytest.raises(UnreadableFile, match="holds Python objects"):
        read(tmp_path / "a.npy", rate_hz=30)


def test_a_file_that_promises_more_than_it_holds_costs_no_memory(tmp_path):
    header = io.BytesIO()
    shape = {"descr": "<f8", "fortran_order": False, "shape": (10**9, 22, 3)}
    np.lib.format.write_array_header_1_0(header, shape)
    (tmp_path / "a.npy").write_bytes(header.getvalue() + bytes(800))
    with pytest.raises(UnreadableFile, match="is shorter"):
        read(tmp_path / "a.npy")
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("positions.npy", header.getvalue() + bytes(800))
    with pytest.raises(UnreadableFile, match="is shorter"):
        read(tmp_path / "a.npz")


# ---- SMPL


def slow_kinematics(offsets, vectors, root):
    """Joints of one frame: a matrix per joint, parents first."""
    world, places = [], []
    for joint, parent in enumerate(PARENTS):
        own = Rotation.from_rotvec(vectors[joint]).as_matrix() if joint < 22 else np.eye(3)
        world.append(own if parent < 0 else world[parent] @ own)
        start = root if parent < 0 else places[parent]
        places.append(start + (offsets[joint] if parent < 0 else world[parent] @ offsets[joint]))
    return np.array(places)


def amass(folder, n_frames=6, **more):
    rng = np.random.default_rng(7)
    poses = rng.normal(scale=0.6, size=(n_frames, 156))
    trans = rng.normal(size=(n_frames, 3))
    arrays = {"poses": poses, "trans": trans, "mocap_framerate": np.array(120.0), **more}
    np.savez(folder / "a_poses.npz", **arrays)
    return poses[:, :66].reshape(-1, 22, 3), trans, folder / "a_poses.npz"


def test_amass_equals_plain_kinematics_turned_y_up(tmp_path):
    turns, trans, path = amass(tmp_path)
    motion = read(path)
    offsets = average_skeleton().offsets
    for frame, (vectors, root) in enumerate(zip(turns, trans, strict=True)):
        x, y, z = slow_kinematics(offsets, vectors, root).T
        np.testing.assert_allclose(motion.positions[frame], np.stack((x, z, -y), 1), atol=1e-9)
    assert (motion.names, motion.rate_hz, motion.mapping.name) == (NAMES, 120, "smpl")
    assert "z up, as AMASS has" in motion.notes
    assert any("average body" in note for note in motion.notes)
    # The rig that comes with it says the same as the positions.
    lengths = np.linalg.norm(motion.positions[:, 4] - motion.positions[:, 1], axis=1)
    np.testing.assert_allclose(lengths, 0.245 * STATURE_M)


def test_root_and_body_may_stand_apart(tmp_path):
    turns, trans, path = amass(tmp_path)
    whole = read(path)
    flat = turns.reshape(-1, 66)
    np.savez(
        path, root_orient=flat[:, :3], pose_body=flat[:, 3:], trans=trans, mocap_frame_rate=120
    )
    np.testing.assert_allclose(read(path).positions, whole.positions)


def test_a_body_at_rest_has_average_proportions(tmp_path):
    np.savez(tmp_path / "a.npz", poses=np.zeros((2, 66)), trans=np.zeros((2, 3)), fps=30)
    motion = read(tmp_path / "a.npz", up="y")
    place = dict(zip(motion.names, motion.positions[0], strict=True))
    assert np.ptp(motion.positions[0, :, 1]) == pytest.approx(0.99 * STATURE_M, abs=0.03)
    assert place["left_hand"][0] == pytest.approx(-place["right_hand"][0])
    assert place["left_foot"][2] > place["left_ankle"][2]
    assert compute_features(motion).known_features.all()


def test_a_body_model_gives_a_persons_own_joints(tmp_path):
    rng = np.random.default_rng(3)
    betas = rng.normal(size=16)
    turns, trans, path = amass(tmp_path, betas=betas)
    template, shapes = rng.normal(size=(40, 3)), rng.normal(size=(40, 3, 10))
    regressor = rng.uniform(size=(52, 40))
    np.savez(tmp_path / "m.npz", v_template=template, shapedirs=shapes, J_regressor=regressor)
    joints = (regressor @ (template + shapes @ betas[:10]))[:22]
    offsets = average_skeleton().offsets
    for joint, parent in enumerate(PARENTS[:22]):
        offsets[joint] = joints[joint] - (joints[parent] if parent >= 0 else 0)
    motion = read(path, body_model=tmp_path / "m.npz")
    x, y, z = slow_kinematics(offsets, turns[2], trans[2]).T
    np.testing.assert_allclose(motion.positions[2], np.stack((x, z, -y), 1), atol=1e-9)
    assert not any("average" in note for note in motion.notes)
    np.savez(tmp_path / "m.npz", v_template=template)
    with pytest.raises(UnreadableFile, match="is no body model"):
        read(path, body_model=tmp_path / "m.npz")


# ---- AIST++


@pytest.mark.parametrize("protocol", range(6))
@pytest.mark.parametrize("dtype", ["<f4", ">f8", "<f8"])
def test_keypoints_of_aist(tmp_path, protocol, dtype):
    array = 100 * in_order(synthetic_motion("squat", seed=1, rate_hz=60), "coco")
    # Fortran order and a scalar beside, as NumPy pickles them.
    content = {"keypoints3d": np.asfortranarray(array.astype(dtype)), "loss": np.float32(2)}
    (tmp_path / "a.pkl").write_bytes(pickle.dumps(content, protocol=protocol))
    motion = read(tmp_path / "a.pkl")
    np.testing.assert_allclose(motion.positions, array / 100, atol=1e-6)
    assert (motion.rate_hz, motion.mapping.name) == (60, "coco")
    assert motion.notes[0].startswith("unit cm, by legs")
    assert "rate assumed 60 Hz, as AIST++ has" in motion.notes


def test_poses_of_aist_are_scaled(tmp_path):
    poses, trans = np.zeros((4, 72)), np.arange(12.0).reshape(4, 3) * 100
    content = {"smpl_poses": poses, "smpl_trans": trans, "smpl_scaling": np.array([100.0])}
    (tmp_path / "a.pkl").write_bytes(pickle.dumps(content))
    motion = read(tmp_path / "a.pkl")
    np.testing.assert_allclose(motion.positions[3, 0] - motion.positions[0, 0], [9, 9, 9])
    assert (motion.positions[0, NAMES.index("head"), 1]) > motion.positions[0, 0, 1]


class Evil:
    def __init__(self, call, *arguments):
        self.call, self.arguments = call, arguments

    def __reduce__(self):
        return self.call, self.arguments


EVIL = {
    "a command": Evil(os.system, "touch {flag}"),
    "a file": Evil(open, "{flag}", "w"),
    "code": Evil(eval, "open('{flag}', 'w')"),
    "attributes": Evil(getattr, "text", "upper"),
    "numpy's own loader": Evil(np.load, "{flag}"),
    "a huge array": Evil(np.ndarray, (10**12,)),
    "a record": np.zeros(3, dtype=[("a", "f8")]),
    "objects": np.array([Evil(os.system, "touch {flag}")], dtype=object),
}


@pytest.mark.parametrize("kind", EVIL)
def test_a_pickle_is_never_run(tmp_path, kind):
    flag = tmp_path / "flag"
    evil = EVIL[kind]
    if isinstance(evil, Evil):
        evil = Evil(
            evil.call, *(a.format(flag=flag) if isinstance(a, str) else a for a in evil.arguments)
        )
    content = pickle.dumps({"keypoints3d": np.ones((3, 17, 3)), "more": evil})
    (tmp_path / "a.pkl").write_bytes(content)
    with pytest.raises(UnreadableFile, match="more than arrays of NumPy, which is not loaded"):
        read(tmp_path / "a.pkl")
    assert not flag.exists()


@pytest.mark.parametrize(
    "content",
    [
        b"\x80\x04\x8a\xff\xff\xff\xff.",
        b"\x80\x04K\x01r\xff\xff\xff\xff.",
        b"\x80\x04cnumpy\nndarray\n(K\x01tR.",
        b"\x80\x04cnumpy\nndarray\n)\x81.",
        b"cos\nsystem\n(S'true'\ntR.",
        b"\x80\x04\x82\x01.",
        b"\x80\x02cnumpy\ndtype\n(X\x0a\x00\x00\x00V999999999tR.",
        b"\x80\x04" + b"(" * 100_000,
        b"\x80\x04}\x94.",
        # More bytes than there are; texts, bytes and arrays of bytes.
        b"\x80\x05\x96" + (1 << 40).to_bytes(8, "little") + b"ab.",
        b"\x80\x05\x8e" + (1 << 63).to_bytes(8, "little") + b"ab.",
        b"\x80\x05\x8d" + (1 << 40).to_bytes(8, "little") + b"ab.",
        b"\x80\x02T\xff\xff\xff\xffab.",
        # Keys that are no texts, and one whose hash takes 2 ** 100 steps.
        b"\x80\x02}K\x01K\x01s.",
        b"\x80\x02})" + b"2\x86" * 100 + b"K\x01s.",
        # The same in place of a name, a type, a shape and a text.
        *(
            b"\x80\x02)" + b"2\x86" * 100 + rest
            for rest in (
                b"2\x93.",
                b"cnumpy\ndtype\n)2\x85R.",
                b"\x85cnumpy\ndtype\n\x86.",
                b"0cnumpy\ndtype\n(U\x02f8tR)" + b"2\x86" * 100 + b"b.",
                b"0cnumpy.core.multiarray\n_reconstruct\n)R)" + b"2\x86" * 100 + b"b.",
                b"0cjoblib.numpy_pickle\nNumpyArrayWrapper\n)\x81)" + b"2\x86" * 100 + b"b.",
            )
        ),
        # One text of a million bytes that is to become bytes a thousand times.
        b"\x80\x02c_codecs\nencode\nq\x00X@B\x0f\x00"
        + bytes(1_000_000)
        + b"q\x01"
        + b"h\x00h\x01\x85R" * 1000
        + b".",
        b"\x80\x02" + b"}" * 200_000 + b".",
        b"I" + b"9" * 200_000 + b"\n.",
        b"\x80\x02s.",
    ],
)
def test_pickles_made_to_harm(tmp_path, content):
    (tmp_path / "a.pkl").write_bytes(content)
    tracemalloc.start()
    with pytest.raises(UnreadableFile) as refused:
        read(tmp_path / "a.pkl")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert "MemoryError" not in str(refused.value)
    assert peak < 4_000_000 + 100 * len(content)


def test_one_person_around_an_array_is_taken_off(tmp_path):
    array = in_order(synthetic_motion("squat", seed=1, rate_hz=60), "smpl")
    array[4, 3] = np.inf
    np.save(tmp_path / "a.npy", array[None])
    motion = read(tmp_path / "a.npy", rate_hz=60, skeleton="smpl")
    assert isinstance(motion, Motion)
    assert np.isnan(motion.positions[4, 3]).all()


# ---- files that inflate


def peak_of_reading(path, **options):
    tracemalloc.start()
    try:
        with pytest.raises((UnreadableFile, InvalidInput)) as refused:
            read(path, **options)
        return tracemalloc.get_traced_memory()[1], str(refused.value)
    finally:
        tracemalloc.stop()


def zip_of(path, method=zipfile.ZIP_DEFLATED, **sizes):
    """A .npz with one array of a frame per name, and of zeros of a size in MB."""
    with zipfile.ZipFile(path, "w", method, compresslevel=1) as archive:
        for name, n_megabytes in sizes.items():
            n_frames = max(1, n_megabytes * 1_000_000 // (66 * 8))
            header = io.BytesIO()
            shape = {"descr": "<f8", "fortran_order": False, "shape": (n_frames, 22, 3)}
            np.lib.format.write_array_header_1_0(header, shape)
            with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
                file.write(header.getvalue())
                for start in range(0, n_frames, 2000):
                    file.write(bytes(66 * 8 * min(2000, n_frames - start)))


def test_only_arrays_that_are_asked_for_are_inflated(tmp_path):
    zip_of(tmp_path / "a.npz", positions=0, other=120)
    peak, message = peak_of_reading(tmp_path / "a.npz")
    assert "no frame rate" in message
    assert peak < 5_000_000


@pytest.mark.parametrize("name", ["positions", "poses"])
def test_an_array_that_inflates_a_thousandfold_is_refused(tmp_path, name):
    zip_of(tmp_path / "a.npz", **{name: 150, "trans": 0})
    peak, message = peak_of_reading(tmp_path / "a.npz", rate_hz=30)
    assert "inflates to more" in message
    assert peak < 5_000_000


def test_ways_of_packing_that_inflate_without_a_bound_are_refused(tmp_path):
    zip_of(tmp_path / "a.npz", zipfile.ZIP_BZIP2, positions=20)
    peak, message = peak_of_reading(tmp_path / "a.npz", rate_hz=30)
    assert "packed in another way" in message
    assert peak < 5_000_000


def test_text_that_unpacks_a_thousandfold_is_refused(tmp_path):
    content = gzip.compress(b"HIERARCHY\n" + b" " * 200_000_000, compresslevel=1)
    (tmp_path / "a.bvh.gz").write_bytes(content)
    peak, message = peak_of_reading(tmp_path / "a.bvh.gz")
    assert "unpacks to more than 64 MB" in message
    assert peak < 100_000_000


# ---- ways to write turns


def walk_turns(n_frames=40, n_joints=24, seed=3):
    """Rotation vectors of a body that bends its knees, (frames, joints, 3)."""
    rng = np.random.default_rng(seed)
    phase = np.linspace(0, 6, n_frames)[:, None, None]
    turns = 0.3 * np.sin(phase + rng.uniform(0, 6, (n_joints, 3)))
    turns[:, 4:6] = [0.1, 0.0, 0.0]
    turns[:, 4, 0] += 0.5 * (1 + np.sin(phase[:, 0, 0]))
    turns[:, 16:18, 2] -= 1.2
    return turns


def ways(turns):
    r = Rotation.from_rotvec(turns.reshape(-1, 3))
    shape, m = turns.shape[:2], r.as_matrix()
    return {
        "vectors": turns,
        "degrees": np.degrees(turns),
        "matrices": m.reshape(*shape, 9),
        "square matrices": m.reshape(*shape, 3, 3),
        "wxyz": r.as_quat(scalar_first=True).reshape(*shape, 4),
        "xyzw": r.as_quat().reshape(*shape, 4),
        "columns": m[:, :, :2].swapaxes(1, 2).reshape(*shape, 6),
        "columns in turn": m[:, :, :2].reshape(*shape, 6),
        "rows": m[:, :2].reshape(*shape, 6),
    }


WAYS = list(ways(walk_turns(1)))
SAID = {"degrees": "in degrees", "wxyz": "w first", "xyzw": "w last", "rows": "two rows"}


@pytest.mark.parametrize("flat", [False, True])
@pytest.mark.parametrize("n_joints", [22, 24, 52, 55])
@pytest.mark.parametrize("way", WAYS)
def test_every_way_to_write_turns_gives_the_same_motion(tmp_path, way, n_joints, flat):
    turns = walk_turns(n_joints=n_joints)
    trans = np.linspace(0, 2, 40)[:, None] * [1, 0, 0]
    np.savez(tmp_path / "a.npz", poses=turns.reshape(40, -1), trans=trans, fps=30)
    expected = read(tmp_path / "a.npz").positions
    written = ways(turns)[way].astype(np.float32)
    np.savez(tmp_path / "a.npz", poses=written.reshape(40, -1) if flat else written, trans=trans,
             fps=30)  # fmt: skip
    motion = read(tmp_path / "a.npz")
    np.testing.assert_allclose(motion.positions, expected, atol=2e-6)
    assert (way == "vectors") == (not any("turns are" in note for note in motion.notes))
    assert any(SAID.get(way, "") in note for note in motion.notes)


def test_turns_of_no_known_way_are_refused(tmp_path):
    turns = np.random.default_rng(0).normal(size=(5, 24, 4))
    np.savez(tmp_path / "a.npz", poses=turns, trans=np.zeros((5, 3)), fps=30)
    with pytest.raises(UnreadableFile, match=r"neither rotation vectors .* nor matrices"):
        read(tmp_path / "a.npz")


@pytest.mark.parametrize(
    "arrays",
    [
        {"root_orient": (5, 3), "pose_body": (4, 63), "trans": (5, 3)},
        {"root_orient": (5, 3), "pose_body": (5, 63), "trans": (4, 3)},
        {"root_orient": (5, 3), "pose_body": (5,), "trans": (5, 3)},
        {"poses": (5, 66), "trans": (5, 2)},
        {"poses": (), "trans": (5, 3)},
        {"poses": (5, 66), "trans": ()},
        {"global_orient": (5, 3), "body_pose": (5, 23), "transl": (5, 3)},
        {"poses": (0, 66), "trans": (0, 3)},
    ],
)
def test_shapes_that_do_not_go_together_are_named(tmp_path, arrays):
    zeros = {name: np.zeros(shape) for name, shape in arrays.items()}
    np.savez(tmp_path / "a.npz", **zeros, fps=30)
    with pytest.raises(UnreadableFile, match=r"expected poses .*got \("):
        read(tmp_path / "a.npz")


@pytest.mark.parametrize(("factor", "unit"), [(1000, "mm"), (100, "cm")])
def test_places_in_other_units_are_doubted(tmp_path, factor, unit):
    trans = np.tile([0.0, 0.0, 0.95], (5, 1)) * factor
    np.savez(tmp_path / "a.npz", poses=np.zeros((5, 66)), trans=trans, fps=30)
    assert any(f"pelvis at {0.95 * factor:.0f} m" in n for n in read(tmp_path / "a.npz").notes)
    motion = read(tmp_path / "a.npz", unit=unit)
    assert not any("pelvis at" in note for note in motion.notes)
    assert motion.positions[0, 0, 1] == pytest.approx(0.95, abs=1e-6)


# Names and shapes as the programs' own documentation has them; their files are not at hand.
def video_tools(turns, trans):
    matrices = Rotation.from_rotvec(turns.reshape(-1, 3)).as_matrix().reshape(-1, 24, 3, 3)
    flat = turns.reshape(len(turns), -1)
    return {
        "GVHMR": {"global_orient": flat[:, :3], "body_pose": flat[:, 3:66], "transl": trans,
                  "betas": np.zeros((len(turns), 10))},
        "ROMP": {"smpl_thetas": flat, "cam_trans": trans},
        "4D-Humans": {"global_orient": matrices[:, :1], "body_pose": matrices[:, 1:],
                      "pred_cam_t": trans},
        "PHC": {"pose_aa": turns, "trans": trans},
    }  # fmt: skip


@pytest.mark.parametrize("packed", ["npz", "pkl", "nested pkl"])
@pytest.mark.parametrize("tool", ["GVHMR", "ROMP", "4D-Humans", "PHC"])
def test_parameters_of_video_tools(tmp_path, tool, packed):
    turns, trans = walk_turns(), np.linspace(0, 2, 40)[:, None] * [1.0, 0, 0]
    np.savez(tmp_path / "a.npz", poses=turns.reshape(40, -1), trans=trans, fps=30)
    expected = read(tmp_path / "a.npz")
    content = video_tools(turns, trans)[tool]
    if packed == "npz":
        np.savez(tmp_path / "b.npz", **content)
    else:
        outer = {"walk": content} if packed == "nested pkl" else content
        (tmp_path / "b.pkl").write_bytes(pickle.dumps(outer))
    motion = read(tmp_path / f"b.{packed[-3:]}", rate_hz=30)
    own = motion.positions - motion.positions[:, :1]
    for frame in (0, 20, 39):
        wanted = expected.positions[frame] - expected.positions[frame, 0]
        # The same body; which axis points up is another for each tool.
        assert (
            np.abs(np.linalg.norm(own[frame], axis=1) - np.linalg.norm(wanted, axis=1)).max() < 1e-6
        )
    assert motion.rate_hz == 30
    assert any("camera" in note for note in motion.notes) == (tool in ("ROMP", "4D-Humans"))


# ---- layouts of data sets and generators


def slow_humanml3d(positions):
    """The numbers of HumanML3D of a motion, frame by frame: turn, way, height, places."""
    n_frames, n_joints = positions.shape[:2]
    right, left = (2, 1) if n_joints == 22 else (11, 16)
    half, rows = [], []
    for pose in positions:
        across = pose[left] - pose[right]
        # The body looks along z where its left is at +x.
        half.append(np.arctan2(-across[2], across[0]) / 2)
    half = np.unwrap(np.array(half) * 2) / 2
    start = positions[0, 0] * [1, 0, 1]
    for i, pose in enumerate(positions):
        c, s = np.cos(-2 * half[i]), np.sin(-2 * half[i])
        back = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        row = np.zeros(4 + 9 * (n_joints - 1) + 3 * n_joints + 4)
        if i + 1 < n_frames:
            c, s = np.cos(-2 * half[i + 1]), np.sin(-2 * half[i + 1])
            back_next = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
            way = back_next @ (positions[i + 1, 0] - pose[0])
            # Turns are counted the other way round.
            row[0], row[1], row[2] = -(half[i + 1] - half[i]), way[0], way[2]
        row[3] = pose[0, 1]
        beside = (back @ (pose[1:] - pose[0] * [1, 0, 1]).T).T
        row[4 : 4 + 3 * (n_joints - 1)] = beside.ravel()
        rows.append(row)
    turn = half[0] * 2
    return np.array(rows), start, turn


@pytest.mark.parametrize(("name", "width", "rate"), [("humanml3d", 263, 20), ("kit_ml", 251, 12.5)])
def test_numbers_of_humanml3d_become_places(tmp_path, name, width, rate):
    places = in_order(synthetic_motion("walk", seed=1, rate_hz=20), name)
    angle = np.linspace(0.3, 2.5, len(places))
    c, s, o = np.cos(angle), np.sin(angle), np.zeros(len(places))
    around = np.stack((c, o, s, o, o + 1, o, -s, o, c), axis=-1).reshape(-1, 3, 3)
    places = np.einsum("fij,fkj->fki", around, places)
    numbers, start, turn = slow_humanml3d(places)
    assert numbers.shape[1] == width
    np.save(tmp_path / "a.npy", numbers.astype(np.float32))
    motion = read(tmp_path / "a.npy", up="y", unit="m")
    assert (motion.rate_hz, motion.mapping.name) == (rate, name)
    # They begin at the origin and look along z.
    c, s = np.cos(-turn), np.sin(-turn)
    back = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    np.testing.assert_allclose(motion.positions, (places - start) @ back.T, atol=1e-4)
    assert any(f"{width} numbers a frame" in note for note in motion.notes)


def test_normalised_numbers_of_humanml3d_are_refused_with_what_to_do(tmp_path):
    np.save(tmp_path / "a.npy", np.random.default_rng(0).normal(size=(60, 263)))
    with pytest.raises(UnreadableFile, match=r"multiply by Std.npy and add Mean.npy"):
        read(tmp_path / "a.npy")


def test_joints_before_frames_are_read_and_told(tmp_path):
    array = in_order(synthetic_motion("squat", seed=1, rate_hz=20), "humanml3d")
    np.save(tmp_path / "a.npy", array.transpose(1, 2, 0))
    motion = read(tmp_path / "a.npy")
    np.testing.assert_allclose(motion.positions, array)
    assert any(note.startswith("read as (joints, 3, frames): 22 joints") for note in motion.notes)
    np.save(tmp_path / "a.npy", np.concatenate([array.transpose(0, 2, 1)] * 9))
    assert any("read as (frames, 3, joints)" in note for note in read(tmp_path / "a.npy").notes)


def results_of_a_generator(path):
    """Three motions as MDM saves them: (motions, joints, 3, frames), filled up behind the end."""
    motions = [
        in_order(synthetic_motion(what, seed=1, rate_hz=20), "humanml3d")
        for what in ("squat", "walk", "jump")
    ]
    longest = max(map(len, motions))
    batch = np.zeros((3, 22, 3, longest))
    for i, motion in enumerate(motions):
        batch[i, ..., : len(motion)] = motion.transpose(1, 2, 0)
    lengths = np.array([len(motion) for motion in motions])
    np.save(path, {"motion": batch, "text": ["a", "b", "c"], "lengths": lengths, "num_samples": 3})
    return motions


def test_results_of_a_generator_are_several_recordings(tmp_path):
    motions = results_of_a_generator(tmp_path / "results.npy")
    with pytest.raises(SeveralRecordings, match=r"holds 3 recordings .* name one with --take") as e:
        read(tmp_path / "results.npy")
    assert e.value.takes == ("1", "2", "3")
    motion = read(tmp_path / "results.npy", take=2)
    np.testing.assert_allclose(motion.positions, motions[1])
    assert motion.rate_hz == 20
    with pytest.raises(InvalidInput, match=r"has no take '4'; it has 1, 2, 3"):
        read(tmp_path / "results.npy", take=4)
    everything = read_all(tmp_path / "results.npy")
    assert [m.source for m in everything] == [f"results.npy#00{i}" for i in (1, 2, 3)]
    for motion, expected in zip(everything, motions, strict=True):
        np.testing.assert_allclose(motion.positions, expected)


@pytest.mark.parametrize("suffix", ["npy", "npz"])
def test_a_batch_is_several_recordings(tmp_path, suffix):
    array = in_order(synthetic_motion("squat", seed=1, rate_hz=20), "smpl")
    batch = np.stack([array, array + 1])
    if suffix == "npy":
        np.save(tmp_path / "a.npy", batch)
    else:
        np.savez(tmp_path / "a.npz", positions=batch)
    with pytest.raises(SeveralRecordings, match="holds 2 recordings"):
        read(tmp_path / f"a.{suffix}", rate_hz=20)
    np.testing.assert_allclose(
        read(tmp_path / f"a.{suffix}", rate_hz=20, take="2").positions, array + 1
    )
    # A file of one recording is what it is.
    assert len(read_all(tmp_path / f"a.{suffix}", rate_hz=20, take=1)) == 1


def test_parameters_of_motion_x(tmp_path):
    turns, trans = walk_turns(n_joints=22), np.linspace(0, 2, 40)[:, None] * [1.0, 0, 0]
    numbers = np.zeros((40, 322))
    numbers[:, :66], numbers[:, 309:312] = turns.reshape(40, -1), trans
    np.save(tmp_path / "a.npy", numbers)
    motion = read(tmp_path / "a.npy", up="y")
    np.savez(tmp_path / "b.npz", poses=turns.reshape(40, -1), trans=trans, fps=30)
    np.testing.assert_allclose(motion.positions, read(tmp_path / "b.npz", up="y").positions)
    assert motion.rate_hz == 30
    assert any("as Motion-X has" in note for note in motion.notes)


def test_results_of_romp_as_objects_in_a_npz(tmp_path):
    turns, trans = walk_turns(), np.zeros((40, 3))
    results = {"smpl_thetas": turns.reshape(40, -1), "cam_trans": trans}
    np.savez(tmp_path / "a.npz", results=np.array(results, dtype=object))
    motion = read(tmp_path / "a.npz", rate_hz=30)
    assert motion.n_frames == 40
    assert any("camera" in note for note in motion.notes)


def test_a_format_of_one_recording_has_no_takes(tmp_path):
    write(synthetic_motion("squat", seed=1), tmp_path / "a.trc")
    with pytest.raises(InvalidInput, match="holds one recording; leave out take="):
        read(tmp_path / "a.trc", take=1)


# ---- joblib: PHC and 4D-Humans save with it. Its arrays stand between the pickle's instructions.


def joblib_array(array, *, n_there=None, module=b"joblib.numpy_pickle", padding=11):
    """Instructions that build an array as joblib 1.6 writes them, then its bytes."""

    def text(words):
        return b"\x8c" + bytes((len(words),)) + words

    order = b"F" if array.flags.f_contiguous and not array.flags.c_contiguous else b"C"
    shape = b"(" + b"".join(b"J" + n.to_bytes(4, "little") for n in array.shape) + b"t"
    code = array.dtype.str[1:].encode()
    state = b"(K\x03" + text(b"<") + b"NNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK\x00t"
    dtype = text(b"numpy") + text(b"dtype") + b"\x93" + text(code) + b"\x89\x88\x87R" + state + b"b"
    build = text(module) + text(b"NumpyArrayWrapper") + b"\x93)\x81}("
    build += text(b"subclass") + text(b"numpy") + text(b"ndarray") + b"\x93"
    build += text(b"shape") + shape + text(b"order") + text(order) + text(b"dtype") + dtype
    build += text(b"allow_mmap") + b"\x88" + text(b"numpy_array_alignment_bytes") + b"K\x10ub"
    content = bytes((padding,)) + b"\xff" * padding + array.tobytes(order.decode())
    return build + content[:n_there]


def joblib_pickle(**options):
    turns, trans = walk_turns().reshape(40, -1), np.asfortranarray(walk_turns()[:, 7])
    whole = b"\x80\x04}(\x8c\x04walk}(\x8c\x07pose_aa" + joblib_array(turns)
    whole += b"\x8c\x05trans" + joblib_array(trans, **options) + b"\x8c\x03fpsK\x1euu."
    return whole, turns, trans


@pytest.mark.parametrize("pack", [bytes, zlib.compress, gzip.compress])
def test_pickles_of_joblib(tmp_path, pack):
    whole, turns, trans = joblib_pickle()
    (tmp_path / "a.pkl").write_bytes(pack(whole))
    motion = read(tmp_path / "a.pkl")
    np.savez(tmp_path / "b.npz", poses=turns, trans=trans, fps=30)
    np.testing.assert_allclose(motion.positions, read(tmp_path / "b.npz").positions)
    assert motion.rate_hz == 30


@pytest.mark.parametrize(
    "options", [{"module": b"os"}, {"n_there": 200}, {"n_there": 0}, {"padding": 200}]
)
def test_damaged_pickles_of_joblib_are_refused(tmp_path, options):
    whole, _, _ = joblib_pickle(**options)
    cut = whole if "module" in options or "padding" in options else whole[: -len("....fpsK.uu.")]
    (tmp_path / "a.pkl").write_bytes(cut[:-300] if "padding" in options else cut)
    with pytest.raises(UnreadableFile, match="pickle is damaged, or holds more"):
        read(tmp_path / "a.pkl")


def test_a_packed_pickle_that_unpacks_a_thousandfold_is_refused(tmp_path):
    (tmp_path / "a.pkl").write_bytes(zlib.compress(b"\x80\x02" + b"N" * 80_000_000, 1))
    peak, message = peak_of_reading(tmp_path / "a.pkl")
    assert "unpacks to more than 64 MB" in message
    assert peak < 200_000_000
