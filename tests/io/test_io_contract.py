"""Does every reader and writer keep the same promises?

Write, read, compare each field; a part read is the part of what is read; from another
working directory; through names with blanks and letters of all kinds; packed where the
format is a text; the same bytes again; whole or not at all; no folder's name inside.
"""

import json
import os
import shutil
from dataclasses import dataclass, field

import numpy as np
import pytest

from motionary import read, write
from motionary.errors import InvalidInput, MotionaryError, UnreadableFile, UnwritableFile
from motionary.io import MOTION_SUFFIXES, WRITTEN_SUFFIXES
from motionary.motion import GENERIC_JOINTS, Event, Motion, Skeleton
from motionary.recording import Recording
from motionary.samples import synthetic_motion
from motionary.skeletons import named_mapping
from oracles import motion_files as files
from oracles.c3d_files import c3d_bytes
from oracles.fbx_files import fbx_text
from oracles.rig_files import gltf_of, mvnx_text

RATE_HZ = 100.0


@dataclass(frozen=True)
class Written:
    """What a format keeps of a motion, and how it is read again."""

    suffix: str
    keeps: frozenset
    kind: str = "points"
    tolerance_m: float = 1e-6
    options: dict = field(default_factory=dict)


POINTS = frozenset({"gaps", "first_frame"})
FORMATS = [
    Written(".npz", POINTS | {"events", "rig"}, tolerance_m=0),
    Written(".npz", POINTS | {"events", "rig"}, kind="rig", tolerance_m=0),
    Written(".npz", POINTS | {"events", "rig"}, kind="acclaim", tolerance_m=0),
    Written(".c3d", POINTS | {"events"}),
    Written(".trc", POINTS),
    Written(".trc.gz", POINTS),
    Written(".bvh", frozenset({"rig"}), kind="rig", options={"unit": "cm"}),
    Written(".bvh.gz", frozenset({"rig"}), kind="rig", options={"unit": "cm"}),
    Written(".bvh", frozenset(), kind="acclaim", options={"unit": "cm"}),
    Written(
        ".amc", frozenset({"rig", "first_frame"}), kind="acclaim", options={"rate_hz": RATE_HZ}
    ),
    Written(
        ".amc.gz", frozenset({"rig", "first_frame"}), kind="acclaim", options={"rate_hz": RATE_HZ}
    ),
]
IDS = [f"{f.suffix} {f.kind}" for f in FORMATS]


def make(kind, folder):
    """A motion with all that its kind can have, and beside it what it is read with."""
    if kind == "points":
        motion = synthetic_motion("squat", seed=3, rate_hz=RATE_HZ)
        positions = motion.positions.copy()
        positions[5:9, 3] = np.nan
        events = (Event("Foot Strike", "left", 0.11), Event("Foot Off", "right", 0.4))
        return Motion(
            motion.names,
            positions,
            Recording(rate_hz=RATE_HZ, first_frame=12),
            motion.mapping,
            events=events,
        )
    rng = np.random.default_rng(4)
    if kind == "acclaim":
        bones, children = files.random_acclaim(rng)
        (folder / "a.asf").write_text(files.asf_text(bones, children))
        values = files.random_values(rng, bones, 30)
        (folder / "a.amc").write_text(files.amc_text(bones, values, first=7))
        return read(folder / "a.amc", rate_hz=RATE_HZ)
    nodes = files.random_bvh(rng, 9)
    rows = rng.uniform(-170, 170, (30, sum(len(channels) for *_, channels in nodes)))
    (folder / "a.bvh").write_text(files.bvh_text(nodes, rows, frame_time="0.01"))
    return read(folder / "a.bvh", unit="cm")


@pytest.fixture(params=FORMATS, ids=IDS)
def case(request, tmp_path):
    folder = tmp_path / "Bewegung früh ü 動き"
    folder.mkdir()
    return request.param, make(request.param.kind, folder), folder / f"a b ä{request.param.suffix}"


def write_here(form, motion, path):
    asf = path.parent / "a.asf"
    write(motion, path, asf=asf if asf.exists() and ".amc" in form.suffix else None)


def read_here(form, path):
    options = dict(form.options)
    if ".amc" in form.suffix:
        options["asf"] = path.parent / "a.asf"
    return read(path, **options)


def test_every_writer_is_here():
    assert {form.suffix for form in FORMATS} == set(WRITTEN_SUFFIXES)


def test_each_field_comes_back(case):
    form, motion, path = case
    write_here(form, motion, path)
    again = read_here(form, path)
    assert again.source == path.name
    assert again.rate_hz == pytest.approx(motion.rate_hz, rel=1e-6)
    assert again.n_frames == motion.n_frames
    assert set(motion.names) <= set(again.names)
    columns = [again.names.index(name) for name in motion.names]
    positions = again.positions[:, columns]
    np.testing.assert_allclose(positions, motion.positions, rtol=0, atol=form.tolerance_m)
    if "gaps" in form.keeps:
        assert again.names == motion.names
    if "first_frame" in form.keeps:
        assert again.first_frame == motion.first_frame
    if "events" in form.keeps:
        assert [event[:2] for event in again.events] == [event[:2] for event in motion.events]
        times = [event.time_s for event in motion.events]
        assert [event.time_s for event in again.events] == pytest.approx(times, abs=1e-4)
    if motion.mapping is not None:
        assert again.mapping.weights == motion.mapping.weights
    if "rig" in form.keeps and motion.rotations is not None:
        check_rig(motion, again, columns)


def check_rig(motion, again, columns):
    """Same tree, same turns (a quaternion and its negative are one turn)."""
    for place, parent in zip(columns, motion.skeleton.parents, strict=True):
        expected = motion.names[parent] if parent >= 0 else None
        above = again.skeleton.parents[place]
        assert (again.names[above] if above >= 0 else None) == expected
    turns = again.rotations[:, columns]
    same = np.abs((turns * motion.rotations).sum(axis=2))
    np.testing.assert_allclose(same, 1, atol=1e-9)


def test_a_part_read_is_the_part_of_what_is_read(case):
    form, motion, path = case
    write_here(form, motion, path)
    whole = read_here(form, path).cut(4, 17)
    other = path.with_name(f"part{form.suffix}")
    write_here(form, motion.cut(4, 17), other)
    part = read_here(form, other)
    np.testing.assert_allclose(part.positions, whole.positions, rtol=0, atol=form.tolerance_m)
    if "first_frame" in form.keeps:
        assert part.first_frame == whole.first_frame
    assert [e[:2] for e in part.events] == [e[:2] for e in whole.events]


def test_what_was_read_is_written_and_read_the_same(case):
    form, motion, path = case
    write_here(form, motion, path)
    once = read_here(form, path)
    other = path.with_name(f"again{form.suffix}")
    write_here(form, once, other)
    again = read_here(form, other)
    np.testing.assert_allclose(again.positions, once.positions, rtol=0, atol=form.tolerance_m)
    assert again.names == once.names


def test_from_another_working_directory(case, monkeypatch):
    form, motion, path = case
    monkeypatch.chdir(path.parent.parent)
    relative = path.relative_to(path.parent.parent)
    write_here(form, motion, relative)
    assert path.exists()
    monkeypatch.chdir(path.parent)
    again = read_here(form, path.relative_to(path.parent))
    assert again.n_frames == motion.n_frames
    assert again.source == path.name


def test_the_same_motion_gives_the_same_bytes(case):
    form, motion, path = case
    write_here(form, motion, path)
    first = path.read_bytes()
    write_here(form, motion, path)
    assert path.read_bytes() == first


def test_no_folder_is_named_inside(case):
    form, motion, path = case
    write_here(form, motion, path)
    content = path.read_bytes()
    for part in path.parent.parts[1:]:
        assert part.encode() not in content or len(part) < 6
    assert sorted(p.name for p in path.parent.iterdir() if p.name.startswith(".")) == []


def test_a_file_that_cannot_be_written_leaves_what_was_there(case, monkeypatch):
    form, motion, path = case
    path.write_bytes(b"before")
    bad = Motion(("\tx {y}" * 40,), np.zeros((3, 1, 3)), Recording(rate_hz=RATE_HZ))
    if form.suffix != ".npz":
        with pytest.raises(MotionaryError):
            write_here(form, bad, path)
    assert path.read_bytes() == b"before"
    (path.parent / f"folder{form.suffix}").mkdir()
    with pytest.raises(UnwritableFile, match="cannot be written"):
        write_here(form, motion, path.parent / f"folder{form.suffix}")
    assert path.read_bytes() == b"before"


def test_a_motion_of_one_frame(case):
    form, motion, path = case
    write_here(form, motion.cut(0, 1), path)
    assert read_here(form, path).n_frames == 1


@pytest.mark.parametrize("suffix", [".bvh", ".amc"])
def test_points_have_no_rig_to_write(tmp_path, suffix):
    make("acclaim", tmp_path)
    with pytest.raises(InvalidInput, match=r"places of points only; write \.trc, \.c3d or \.npz"):
        write(make("points", tmp_path), tmp_path / f"a{suffix}", asf=tmp_path / "a.asf")


def test_an_unknown_suffix_is_answered_with_the_known_ones(tmp_path):
    with pytest.raises(InvalidInput, match=r"written as \.amc, \.bvh, \.c3d, .* got '\.mp4'"):
        write(make("points", tmp_path), tmp_path / "a.mp4")


def test_another_skeleton_than_the_motions_own(tmp_path):
    motion = make("acclaim", tmp_path)
    bones, children = files.random_acclaim(np.random.default_rng(9), 4)
    (tmp_path / "b.asf").write_text(files.asf_text(bones, children))
    with pytest.raises(InvalidInput, match=r"has not the bones of b\.asf"):
        write(motion, tmp_path / "x.amc", asf=tmp_path / "b.asf")
    text = (tmp_path / "a.asf").read_text().replace("length 0.45", "length 0.9")
    (tmp_path / "b.asf").write_text(text)
    with pytest.raises(InvalidInput, match="not as long as those of"):
        write(motion, tmp_path / "x.amc", asf=tmp_path / "b.asf")


# ---- readers, those without a writer too


def smpl_files(folder):
    rng = np.random.default_rng(5)
    poses, trans = rng.normal(scale=0.2, size=(30, 156)), rng.normal(size=(30, 3))
    np.savez(folder / "amass.npz", poses=poses, trans=trans, mocap_framerate=np.array(RATE_HZ))


def other_files(folder):
    """A small file per format that is read, with the options it needs."""
    make("acclaim", folder), make("rig", folder), smpl_files(folder)
    points = make("points", folder).cut(0, 30)
    np.save(folder / "a.npy", np.random.default_rng(6).normal(size=(30, 22, 3)))
    import pickle

    (folder / "a.pkl").write_bytes(pickle.dumps({"keypoints3d": np.ones((30, 17, 3))}))
    (folder / "a.c3d").write_bytes(c3d_bytes(np.ones((30, 2, 3)), ["a", "b"]))
    write(points, folder / "a.trc")
    rows = "\n".join(f"{i / 100}\t1,2,3\t4,5,6" for i in range(30))
    (folder / "a.sto").write_text(f"x\nDataType=Vec3\nendheader\ntime\ta\tb\n{rows}\n")
    rows = rows.replace(",", "\t")
    head = "nRows=30\nendheader\ntime\ta_X\ta_Y\ta_Z\tb_X\tb_Y\tb_Z"
    (folder / "a.mot").write_text(f"x\n{head}\n{rows}\n")
    turns = [[10.0 * i for i in range(30)]] * 2
    bones = [("Hips", -1, (0, 100, 0)), ("Leg", 0, (0, -50, 0))]
    (folder / "a.fbx").write_text(fbx_text(bones, turns, list(range(30))))
    figure = synthetic_motion("squat", seed=3, rate_hz=RATE_HZ).cut(0, 30)
    (folder / "a.mvnx").write_text(mvnx_text(figure)[0])
    (folder / "a.json").write_text(
        json.dumps({"names": figure.names, "fps": RATE_HZ, "positions": figure.positions.tolist()})
    )
    for suffix, humanoid in ((".gltf", ""), (".glb", ""), (".vrm", "vrm0"), (".vrma", "vrma")):
        gltf = gltf_of(figure, humanoid=humanoid)
        (content,) = gltf.pack("data" if suffix == ".gltf" else "glb").values()
        (folder / f"a{suffix}").write_bytes(content)
    return {
        "a.amc": {}, "a.bvh": {"unit": "cm"}, "amass.npz": {}, "a.npy": {}, "a.pkl": {},
        "a.c3d": {}, "a.trc": {}, "a.sto": {}, "a.mot": {}, "a.fbx": {}, "a.mvnx": {},
        "a.gltf": {}, "a.glb": {}, "a.vrm": {}, "a.vrma": {}, "a.json": {},
    }  # fmt: skip


@pytest.fixture(scope="module")
def others(tmp_path_factory):
    folder = tmp_path_factory.mktemp("andere Dateien é")
    return folder, other_files(folder)


READ = [
    "a.amc",
    "a.bvh",
    "amass.npz",
    "a.npy",
    "a.pkl",
    "a.c3d",
    "a.trc",
    "a.sto",
    "a.mot",
    "a.fbx",
    "a.mvnx",
    "a.gltf",
    "a.glb",
    "a.vrm",
    "a.vrma",
    "a.json",
]


def test_every_reader_is_here():
    known = {name[name.index(".") :] for name in READ}
    assert {suffix.removesuffix(".gz") for suffix in MOTION_SUFFIXES} <= known


@pytest.mark.parametrize("name", READ)
def test_reading(others, name, tmp_path, monkeypatch):
    folder, options = others
    if name.endswith(".fbx"):
        pytest.importorskip("ufbx")
    motion = read(folder / name, **options[name])
    assert isinstance(motion, Motion)
    assert (motion.n_frames, motion.source) == (30, name)
    assert all(isinstance(note, str) and note for note in motion.notes)
    monkeypatch.chdir(folder)
    again = read(name, **options[name])
    np.testing.assert_array_equal(again.positions, motion.positions)
    # Any motion goes into our own file and comes back equal.
    write(motion, tmp_path / "x.npz")
    np.testing.assert_array_equal(read(tmp_path / "x.npz").positions, motion.positions)


@pytest.mark.parametrize("name", READ)
def test_missing_empty_and_foreign_files(others, name, tmp_path):
    for content in (None, b"", b"\x00" * 3000, b"hello\n" * 100, os.urandom(0)):
        path = tmp_path / name
        if content is not None:
            path.write_bytes(content)
        if name == "a.amc":
            shutil.copy(others[0] / "a.asf", tmp_path)
        if name.endswith(".fbx"):
            pytest.importorskip("ufbx")
        with pytest.raises(UnreadableFile) as caught:
            read(path)
        assert name in str(caught.value)
        assert "\n" not in str(caught.value)
    (tmp_path / "folder").mkdir()
    shutil.move(tmp_path / name, tmp_path / "folder" / "kept")
    (tmp_path / name).mkdir()
    with pytest.raises(UnreadableFile):
        read(tmp_path / name)


@pytest.mark.parametrize("name", ["a.amc", "a.bvh", "a.trc", "a.sto", "a.mot"])
def test_packed_texts(others, name, tmp_path):
    import gzip

    folder, options = others
    path = tmp_path / f"{name}.gz"
    path.write_bytes(gzip.compress((folder / name).read_bytes()))
    if name == "a.amc":
        shutil.copy(folder / "a.asf", tmp_path)
    motion = read(path, **options[name])
    np.testing.assert_array_equal(motion.positions, read(folder / name, **options[name]).positions)
    assert motion.source == f"{name}.gz"
    content = path.read_bytes()
    for broken in (content[:-20], content[:50] + b"xxxxxxxx" + content[58:], b"\x1f\x8b"):
        path.write_bytes(broken)
        with pytest.raises(UnreadableFile, match="packed"):
            read(path, **options[name])


@pytest.mark.parametrize(
    ("name", "option", "words"),
    [
        ("a.c3d", {"asf": "x.asf"}, "own skeleton"),
        ("a.bvh", {"body_model": "x.npz"}, "no motion of a body model"),
        ("a.fbx", {"up": "w"}, "up must be one of"),
        ("a.amc", {"sides": "both"}, "sides must be one of"),
        ("a.trc", {"rate_hz": -1}, "rate_hz must be a positive number"),
    ],
)
def test_options_that_do_not_go_with_a_format(others, name, option, words):
    with pytest.raises(InvalidInput, match=words):
        read(others[0] / name, **option)


def test_generic_joints_keep_their_names():
    assert set(synthetic_motion("squat", seed=1).names) <= set(GENERIC_JOINTS)
    assert named_mapping("generic").order == GENERIC_JOINTS


def test_a_rig_whose_joints_move_against_their_parents(tmp_path):
    # As in files that give every joint position channels.
    rng = np.random.default_rng(8)
    parents = np.array([-1, 0, 1], dtype=np.intp)
    skeleton = Skeleton(("a", "b", "c"), parents, rng.normal(size=(3, 3)))
    turns = rng.normal(size=(6, 3, 4))
    turns /= np.linalg.norm(turns, axis=2, keepdims=True)
    motion = Motion(
        ("a", "b", "c"), rng.normal(size=(6, 3, 3)), Recording(rate_hz=30.0), None, skeleton, turns
    )
    write(motion, tmp_path / "a.bvh", unit="m")
    again = read(tmp_path / "a.bvh", unit="m")
    np.testing.assert_allclose(again.positions, motion.positions, atol=3e-6)
    check_rig(motion, again, [0, 1, 2])
