"""glTF, GLB, VRM and VRMA: written after the specification, read as the same figure.

No file of another program's own: each is made by the writer in `oracles.rig_files`.
"""

import json
import os
import struct
import time

import numpy as np
import pytest

from motionary.errors import InvalidInput, NotAMotion, UnreadableFile
from motionary.features import compute_features
from motionary.io import find_recordings, read, write
from motionary.samples import synthetic_motion
from oracles.rig_files import VRM, Gltf, gltf_of, matrices


@pytest.fixture(scope="module")
def trial():
    return synthetic_motion("kick_left", seed=2, rate_hz=60).cut(0, 50)


def put(folder, gltf, how="glb", *, suffix="", change=None):
    """The path of a document, written into a folder."""
    if change is not None:
        change(gltf.root)
    files = gltf.pack(how)
    for name, content in files.items():
        (folder / name).write_bytes(content)
    path = folder / next(iter(files))
    return path.rename(path.with_suffix(suffix)) if suffix else path


@pytest.mark.parametrize(
    ("how", "humanoid", "suffix"),
    [("glb", "", ""), ("data", "", ""), ("beside", "", ""), ("glb", "vrm0", ".vrm"),
     ("data", "vrm1", ".vrm"), ("glb", "vrma", ".vrma")],
)  # fmt: skip
def test_the_same_figure_has_the_same_features(tmp_path, trial, how, humanoid, suffix):
    # A VRM file says which node is which bone, whatever it calls them.
    names = {joint: f"J_{i}" for i, joint in enumerate(trial.names)} if humanoid else None
    gltf = gltf_of(trial, names=names, humanoid=humanoid, unit_m=0.01)
    motion = read(put(tmp_path, gltf, how, suffix=suffix))
    assert (motion.rate_hz, motion.n_frames) == (60, 50)
    assert motion.mapping.name == ("vrm" if humanoid else "generic")
    kept = [i for i, joint in enumerate(trial.names) if joint in VRM or not humanoid]
    ours, theirs = motion.generic_positions(), trial.generic_positions()
    np.testing.assert_allclose(ours[:, kept], theirs[:, kept], atol=1e-6)
    features, wanted = compute_features(motion), compute_features(trial)
    known = features.known_features
    assert known.any(axis=0).sum() == (38 if humanoid else 40)
    unpacked = [
        np.unpackbits(f.packed.view(np.uint8), bitorder="little") for f in (features, wanted)
    ]
    mask = np.unpackbits(features.known.view(np.uint8), bitorder="little").astype(bool)
    assert np.array_equal(unpacked[0][mask], unpacked[1][mask])
    assert motion.notes[0] == "axes and unit as glTF has them"


def test_joints_make_a_rig_that_is_written(tmp_path, trial):
    motion = read(put(tmp_path, gltf_of(trial, unit_m=0.01)))
    write(motion, tmp_path / "a.bvh")
    again = read(tmp_path / "a.bvh", unit="cm")
    columns = [again.names.index(name) for name in trial.names]
    mine = [motion.names.index(name) for name in trial.names]
    np.testing.assert_allclose(again.positions[:, columns], motion.positions[:, mine], atol=2e-5)


def test_bones_that_rest_in_matrices(tmp_path, trial):
    motion = read(put(tmp_path, gltf_of(trial, matrix=True)))
    rest = trial.skeleton.offsets.copy()
    for joint, parent in enumerate(trial.skeleton.parents.tolist()):
        rest[joint] += rest[parent] if parent >= 0 else 0
    turned = np.einsum("fij,nj->fni", matrices(trial.rotations[:, 0]), rest - rest[0])
    places = motion.positions[:, [motion.names.index(name) for name in trial.names]]
    np.testing.assert_allclose(places, turned + trial.positions[:, :1], atol=1e-6)


@pytest.mark.parametrize("name", ["mixamorig:{}", "mixamorig{}", "{}"])
def test_rigs_of_animators_are_known(tmp_path, trial, name):
    from motionary.skeletons import named_mapping

    mixamo = {
        joint: next(iter(source)) for joint, source in named_mapping("mixamo").weights.items()
    }
    names = {joint: name.format(mixamo[joint]) for joint in trial.names}
    motion = read(put(tmp_path, gltf_of(trial, names=names)))
    assert motion.mapping.name == "mixamo"
    np.testing.assert_allclose(motion.generic_positions(), trial.generic_positions(), atol=1e-6)


# ---- values between keys


def bone(animate, *, nodes=None, **options):
    """A document of a skeleton of two joints, of which `animate` moves the first."""
    nodes = nodes or [{"name": "A", "children": [1]}, {"name": "B", "translation": [0, 1, 0]}]
    gltf = Gltf(nodes)
    gltf.root["skins"] = [{"joints": [0, 1]}]
    for number, channels in enumerate(animate, start=1):
        gltf.animate(f"clip {number}", channels, **options)
    return gltf


def about_z(degrees):
    half = np.radians(degrees) / 2
    return [0, 0, np.sin(half), np.cos(half)]


def angles(motion):
    away = motion.positions[:, 1] - motion.positions[:, 0]
    return np.degrees(np.arctan2(-away[:, 0], away[:, 1]))


def test_turns_go_evenly_along_the_shorter_arc(tmp_path):
    values = [about_z(0), about_z(90), [-x for x in about_z(120)]]
    gltf = bone([[(0, "rotation", [0, 0.3, 0.4], values, "LINEAR")]])
    motion = read(put(tmp_path, gltf))
    assert motion.rate_hz == 30
    assert any("keys lie on frames of 30 Hz" in note for note in motion.notes)
    np.testing.assert_allclose(angles(motion), [*range(0, 91, 10), 100, 110, 120], atol=1e-3)


def test_steps_hold_and_splines_swing(tmp_path):
    times = [0, 0.5, 1.0]
    steps = [[0, 0, 0], [1, 0, 0], [2, 0, 0]]
    spline = [[[0, 0, 0], [0, y, 0], [0, out, 0]] for y, out in ((0, 4), (1, 0), (0, 0))]
    gltf = bone(
        [[(0, "translation", times, steps, "STEP"), (1, "translation", times,
           np.reshape(spline, (9, 3)), "CUBICSPLINE")]]
    )  # fmt: skip
    motion = read(put(tmp_path, gltf), rate_hz=20)
    assert motion.n_frames == 21
    np.testing.assert_allclose(motion.positions[:, 0, 0], [0] * 10 + [1] * 10 + [2], atol=1e-6)
    s = np.linspace(0, 1, 11)
    # Hermite's polynomials, written otherwise: (1 + 2s)(1 - s)² and so on.
    first = s**2 * (3 - 2 * s) + 0.5 * 4 * s * (1 - s) ** 2
    second = (1 + 2 * s) * (1 - s) ** 2
    heights = motion.positions[:, 1, 1]
    np.testing.assert_allclose(heights, [*first, *second[1:]], atol=1e-6)


def test_scales_go_down_the_tree_and_shear(tmp_path):
    nodes = [
        {"name": "A", "scale": [2, 1, 1], "children": [1]},
        {"name": "B", "rotation": about_z(90), "translation": [1, 0, 0], "children": [2]},
        {"name": "C", "translation": [0, 1, 0]},
    ]
    gltf = bone([[(0, "translation", [0, 0.1], [[0, 0, 0], [0, 0, 0.1]], "LINEAR")]], nodes=nodes)
    motion = read(put(tmp_path, gltf))
    # C lies along -x of B's parent, which is twice as wide.
    np.testing.assert_allclose(motion.positions[0], [[0, 0, 0], [2, 0, 0], [0, 0, 0]], atol=1e-6)


def test_mirrored_joints_have_places_and_no_turns(tmp_path):
    nodes = [{"name": "A", "scale": [-1, 1, 1], "children": [1]}, {"translation": [1, 0, 0]}]
    gltf = bone([[(0, "rotation", [0, 0.1], [about_z(0), about_z(90)], "LINEAR")]], nodes=nodes)
    motion = read(put(tmp_path, gltf))
    assert motion.names == ("A", "node 1")
    np.testing.assert_allclose(motion.positions[0, 1], [-1, 0, 0], atol=1e-9)
    assert motion.rotations is None
    assert any("mirrored" in note for note in motion.notes)


@pytest.mark.parametrize(
    ("kind", "scale"), [("i2", 32767), ("i1", 127), ("u2", 65535), ("u1", 255)]
)
def test_whole_numbers_stand_for_fractions(tmp_path, kind, scale):
    values = (np.array([about_z(0), about_z(90)]) * scale).round().astype(int)
    gltf = bone([[(0, "rotation", [0, 0.1], values, "STEP")]], kind=kind, normalized=True)
    np.testing.assert_allclose(angles(read(put(tmp_path, gltf)))[[0, -1]], [0, 90], atol=0.5)


def test_strides_and_sparse_elements(tmp_path):
    moves = np.zeros((5, 3))
    moves[[1, 3]] = [[1, 2, 3], [4, 5, 6]]
    channel = [(0, "translation", np.arange(5) / 30, moves, "LINEAR")]
    for name, options in (("a", {"stride": 20}), ("b", {"sparse": [1, 3]})):
        (tmp_path / name).mkdir()
        motion = read(put(tmp_path / name, bone([channel], **options)))
        np.testing.assert_allclose(motion.positions[:, 0], moves, atol=1e-6)


@pytest.mark.parametrize(
    ("times", "rate", "words"),
    [
        (np.arange(40) / 29.97, 29.97, None),
        (5 + np.arange(40) / 240, 240, None),
        ([0, 1, 3], 30, "keys lie on frames of 30 Hz"),
        (np.array([0, 1, 5, 12]) / 24, 24, "keys lie on frames of 24 Hz"),
        ([0, 0.0123, 0.1, 0.237], 30, "keys lie at uneven times, read at 30 Hz"),
    ],
)
def test_keys_tell_the_rate(tmp_path, times, rate, words):
    moves = np.linspace(0, 1, len(times))[:, None] * [1, 0, 0]
    motion = read(put(tmp_path, bone([[(0, "translation", times, moves, "LINEAR")]])))
    assert motion.rate_hz == pytest.approx(rate, rel=1e-5)
    assert motion.n_frames == 1 + int((times[-1] - times[0]) * rate + 0.02)
    assert any(words in note for note in motion.notes) if words else len(motion.notes) < 4
    at = np.interp(np.arange(motion.n_frames) / rate, np.array(times) - times[0], moves[:, 0])
    np.testing.assert_allclose(motion.positions[:, 0, 0], at, atol=2e-3)


# ---- which joints, which animation


def moves_of(*sizes):
    return [[(0, "translation", [0, 0.1], [[0, 0, 0], [size, 0, 0]], "LINEAR")] for size in sizes]


def test_the_animation_that_moves_is_read_or_the_one_that_is_given(tmp_path):
    path = put(tmp_path, bone(moves_of(0, 1, 2)))
    motion = read(path)
    assert motion.positions[-1, 0, 0] == pytest.approx(1)
    assert any("clip 2, the first that moves, of 3 (clip 1, clip 2, clip 3)" in note
               for note in motion.notes)  # fmt: skip
    assert read(path, take="clip 3").positions[-1, 0, 0] == pytest.approx(2)
    assert read(path, take=1).n_frames == 4
    third = read(f"{path}#clip 3")
    assert (third.source, third.positions[-1, 0, 0]) == ("a.glb#clip 3", pytest.approx(2))
    with pytest.raises(InvalidInput, match="has no take 'x'; it has clip 1, clip 2, clip 3"):
        read(path, take="x")


def test_without_animation_it_is_one_pose(tmp_path):
    motion = read(put(tmp_path, bone([])))
    assert motion.n_frames == 1
    assert any("holds no animation" in note for note in motion.notes)


def test_what_hangs_on_joints_is_read_and_what_is_shown_is_not(tmp_path):
    nodes = [
        {"name": "Scene", "children": [1, 5]},
        {"name": "A\n\tB", "children": [2, 3]},
        {"name": "tip"},
        {"name": "hat", "mesh": 0, "children": [4]},
        {"name": "feather"},
        {"name": "camera", "camera": 0},
    ]
    gltf = bone([], nodes=nodes)
    gltf.root["skins"] = [{"joints": [1]}]
    assert read(put(tmp_path, gltf)).names == ("Scene", "A B", "tip")


def test_without_a_skin_joints_are_what_moves(tmp_path):
    nodes = [{"name": "A", "children": [1, 2]}, {"name": "box", "mesh": 0}, {"name": "B"}]
    gltf = bone([[(1, "translation", [0, 0.1], [[0, 0, 0], [1, 0, 0]], "LINEAR")]], nodes=nodes)
    del gltf.root["skins"]
    assert read(put(tmp_path, gltf)).names == ("A", "box", "B")
    still = Gltf(nodes)
    with pytest.raises(NotAMotion, match="expected a skin or an animation"):
        read(put(tmp_path, still))


def test_folders_are_searched_for_them(tmp_path, trial):
    put(tmp_path, gltf_of(trial))
    put(tmp_path, gltf_of(trial), "beside")
    assert [path.name for path in find_recordings(tmp_path)] == ["a.glb", "a.gltf"]


# ---- hostile and damaged


def with_uri(uri):
    return lambda root: root["buffers"].append({"uri": uri, "byteLength": 400})


@pytest.mark.parametrize(
    "uri",
    ["../secret.bin", "/etc/hostname", "file:///etc/hostname", "http://x.example/a.bin",
     "..%2Fsecret.bin", "link.bin", "a%00.bin", "sub/../../secret.bin"],
)  # fmt: skip
def test_no_file_elsewhere_is_read(tmp_path, uri):
    folder = tmp_path / "in"
    folder.mkdir()
    (tmp_path / "secret.bin").write_bytes(b"\0" * 400)
    (folder / "link.bin").symlink_to(tmp_path / "secret.bin")
    gltf = bone(moves_of(1))
    files = gltf.pack("beside")
    root = json.loads(files["a.gltf"])
    root["buffers"][0]["uri"] = uri
    (folder / "a.gltf").write_text(json.dumps(root))
    with pytest.raises(UnreadableFile, match=r"a.gltf: names a buffer outside its folder"):
        read(folder / "a.gltf")


def test_a_buffer_in_a_folder_below(tmp_path):
    files = bone(moves_of(1)).pack("beside")
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "a.bin").write_bytes(files["a x.bin"])
    (tmp_path / "a.gltf").write_text(files["a.gltf"].decode().replace("a%20x.bin", "sub/a.bin"))
    assert read(tmp_path / "a.gltf").n_frames == 4


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
def test_a_pipe_is_no_buffer(tmp_path):
    path = put(tmp_path, bone(moves_of(1)), "beside")
    (tmp_path / "a x.bin").unlink()
    with pytest.raises(UnreadableFile, match=r"its buffer 'a x.bin' cannot be read.*beside it"):
        read(path)
    os.mkfifo(tmp_path / "a x.bin")
    with pytest.raises(UnreadableFile, match="a named pipe"):
        read(path)


def set_in(*keys, value):
    """Change of a document: a value at a place."""

    def change(root):
        for key in keys[:-1]:
            root = root[key]
        root[keys[-1]] = value

    return change


DAMAGED = [
    (set_in("asset", "version", value="1.0"), "is glTF 1.0, expected 2.0"),
    (set_in("nodes", 1, "children", value=[0]), "is its own ancestor"),
    (set_in("nodes", 1, "children", value=[1]), "has two parents"),
    (set_in("nodes", 0, "children", value=[7]), "has 2 of nodes and names number 7"),
    (set_in("nodes", 1, "translation", value=[1, "x", 2]), "translation should be 3 numbers"),
    (set_in("nodes", 1, "translation", value=[1e400, 0, 0]), "translation should be 3 numbers"),
    (set_in("nodes", 1, "translation", value=[1e9, 0, 0]), "impossibly large"),
    (set_in("nodes", 1, "rotation", value=[0, 0, 0, 0]), "impossible turns"),
    (set_in("nodes", value={"a": 1}), "nodes should be a list"),
    (set_in("skins", 0, "joints", value=[True]), "has 2 of nodes and names number True"),
    (set_in("accessors", 0, "count", value=10**12), "more numbers than its bytes"),
    (set_in("accessors", 0, "count", value=2000), "ends behind its view"),
    (set_in("accessors", 0, "count", value=-1), "count should be a whole number"),
    (set_in("accessors", 0, "count", value=0), "no times of its keys"),
    (set_in("accessors", 1, "count", value=1), "has 1 elements where 2 are needed"),
    (set_in("accessors", 1, "type", value="VEC4"), "an accessor is VEC4 of 5126, expected 3 wide"),
    (set_in("accessors", 1, "componentType", value={}), "componentType should be a whole number"),
    (set_in("accessors", 1, "byteOffset", value=10**9), "ends behind its view"),
    (set_in("accessors", 0, value={"type": "SCALAR", "componentType": 5126, "count": 9}),
     "has no numbers"),
    (set_in("bufferViews", 0, "byteLength", value=10**9), "a view ends behind its buffer"),
    (set_in("bufferViews", 0, "byteStride", value=1), "ends behind its view"),
    (set_in("bufferViews", 0, "buffer", value=3), "has 1 of buffers and names number 3"),
    (set_in("bufferViews", 0, "extensions", value={"EXT_meshopt_compression": {}}), "is packed"),
    (set_in("animations", 0, "samplers", 0, "interpolation", value="X"), "interpolates by 'X'"),
    (set_in("animations", 0, "samplers", 0, "input", value="0"), "names number 0"),
    (set_in("animations", 0, "channels", 0, "sampler", value=5), "has 1 of samplers"),
    (set_in("extensions", value={"VRMC_vrm": {"humanoid": {"humanBones": {"hips": {"node": 9}}}}}),
     "has 2 of nodes and names number 9"),
]  # fmt: skip


@pytest.mark.parametrize(("change", "words"), DAMAGED, ids=[words for _, words in DAMAGED])
def test_what_is_wrong_is_told(tmp_path, change, words):
    with pytest.raises(UnreadableFile, match=words) as caught:
        read(put(tmp_path, bone(moves_of(1)), change=change))
    assert str(caught.value).startswith("a.glb: ")


@pytest.mark.parametrize(
    ("times", "words"),
    [
        ([0.2, 0.1], "time runs backward"),
        ([np.nan, 0.1], "no times of its keys"),
        ([0, 9e5], r"27000001 frames of 2 joints in so few bytes"),
        ([0, np.inf], "no times of its keys"),
    ],
)
def test_times_that_are_none(tmp_path, times, words):
    gltf = bone([[(0, "translation", times, [[0, 0, 0], [1, 0, 0]], "LINEAR")]])
    with pytest.raises(UnreadableFile, match=words):
        read(put(tmp_path, gltf))


def test_bytes_that_are_shared_are_no_bomb(tmp_path):
    # Hundreds of channels that all read the same numbers.
    gltf = bone([])
    gltf.root["nodes"] += [{"name": f"n{i}"} for i in range(300)]
    gltf.root["skins"] = [{"joints": list(range(302))}]
    times = gltf.accessor(np.arange(30_000) / 1000)
    values = gltf.accessor(np.zeros((30_000, 3)))
    sampler = {"input": times, "output": values}
    gltf.root["animations"] = [{"samplers": [sampler], "channels": [
        {"sampler": 0, "target": {"node": i, "path": "translation"}} for i in range(302)
    ]}]  # fmt: skip
    with pytest.raises(UnreadableFile, match="more numbers than its bytes can hold"):
        read(put(tmp_path, gltf))


def glb(text):
    """A binary file with one chunk."""
    return b"glTF" + struct.pack("<III", 2, 20 + len(text), len(text)) + b"JSON" + text


@pytest.mark.parametrize(("content", "words"), [
    (b"glTF" + struct.pack("<II", 2, 12), "has no chunk of JSON"),
    (glb(b""), "it is empty; get the whole file"),
    (glb(b'{"asset": '), "it ends too early, in line 1; get the whole file"),
    (glb(b'{"asset": \xff}'), "expected text in UTF-8, got other bytes from byte 10"),
    (glb(b'{"a": 1,\n x}'), "in line 2, column 2 stands 'x}', which JSON does not have"),
    (glb(b"9" * 5000), "thousands of digits"),
    (glb(b"[" * 50_000), "lists within lists without end"),
])  # fmt: skip
def test_text_that_is_none_is_told_in_words_for_people(tmp_path, content, words):
    (tmp_path / "a.glb").write_bytes(content)
    with pytest.raises(UnreadableFile, match=words) as caught:
        read(tmp_path / "a.glb")
    text = str(caught.value)
    assert text.startswith("a.glb: ")
    assert not any(word in text for word in ("codec", "Expecting", "char ", "recursion"))


@pytest.mark.parametrize("content", [
    b"glTF", b"glTF" + struct.pack("<II", 1, 12), b"glTF" + struct.pack("<II", 2, 900),
    b"glTF" + struct.pack("<III", 2, 24, 900) + b"JSON....", b"{", b"[" * 100_000, b"[]",
    b'{"asset": 3}', b"\xff\xfe{}", b'{"asset": {"version": "2.0"}, "nodes": [3]}',
])  # fmt: skip
def test_what_is_no_gltf(tmp_path, content):
    (tmp_path / "a.glb").write_bytes(content)
    with pytest.raises(UnreadableFile, match=r"a\.glb: ") as caught:
        read(tmp_path / "a.glb")
    assert len(str(caught.value)) < 500


def test_a_file_that_was_cut_off(tmp_path):
    path = put(tmp_path, bone(moves_of(1)))
    path.write_bytes(path.read_bytes()[:-9])
    with pytest.raises(UnreadableFile, match=r"should have \d+ bytes and has \d+; is it whole"):
        read(path)
    data = put(tmp_path, bone(moves_of(1)), "data")
    data.write_text(data.read_text().replace(";base64,", ";base64,%"))
    with pytest.raises(UnreadableFile, match="base64"):
        read(data)


def test_many_nodes_take_linear_time(tmp_path):
    n = 20_000
    nodes = [{"children": [i + 1]} for i in range(n - 1)] + [{}]
    gltf = Gltf(nodes)
    gltf.root["skins"] = [{"joints": [n - 1]}]
    began = time.perf_counter()
    with pytest.raises(UnreadableFile, match="20000 joints, more than any body"):
        read(put(tmp_path, gltf))
    gltf.root["skins"] = [{"joints": [499]}]
    gltf.root["nodes"][499]["children"] = []
    assert len(read(put(tmp_path, gltf)).names) == 500
    assert time.perf_counter() - began < 10
