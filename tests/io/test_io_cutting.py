"""Clips: the lines of the file itself, and a name for every system."""

import gzip
import re
from dataclasses import replace

import numpy as np
import pytest

from cli_cases import write_bvh
from motionary.batch import Failure
from motionary.errors import InvalidInput, UnreadableFile, UnwritableFile
from motionary.io import (
    ReadOptions,
    can_cut,
    copy_skeleton,
    cut_clips,
    cut_file,
    plan_clips,
    read,
    write,
)
from motionary.io.formats.c3d_head import parse_head
from motionary.labels import Label, LabelTrack
from motionary.motion import Event
from motionary.recording import Recording
from motionary.samples import synthetic_motion
from oracles.c3d_files import DEC, INTEL, MIPS, c3d_bytes

ASF = """:version 1.10
:name body
:units
  mass 1.0
  length 0.45
  angle deg
:root
  order TX TY TZ RX RY RZ
  axis XYZ
  position 0 0 0
  orientation 0 0 0
:bonedata
  begin
    id 1
    name lowerback
    direction 0 1 0
    length 2
    axis 0 0 0 XYZ
    dof rx
  end
:hierarchy
  begin
    root lowerback
  end
"""
AMC = "#!OML:ASF für Bonn\r\n:FULLY-SPECIFIED\r\n:DEGREES\r\n" + "".join(
    f"{n}\r\nroot {n}.10 0 {n}e-015 0 0 0\r\nlowerback {n / 7:.9f}\r\n" for n in range(5, 25)
)


@pytest.fixture
def bvh(tmp_path):
    path = tmp_path / "take.bvh"
    write_bvh(synthetic_motion("squat", seed=0, rate_hz=30), path)
    return path


@pytest.fixture
def amc(tmp_path):
    path = tmp_path / "body_walk.amc"
    path.write_bytes(AMC.encode("latin-1"))
    (tmp_path / "body.asf").write_text(ASF)
    return path


# -- frames -------------------------------------------------------------------------------


@pytest.mark.parametrize(("first", "last"), [(0, 0), (3, 17), (0, -1), (-1, -1)])
def test_a_bvh_clip_is_those_frames(bvh, tmp_path, first, last):
    whole = read(bvh)
    first, last = first % whole.n_frames, last % whole.n_frames
    cut_file(bvh, first, last, tmp_path / "new" / "clip.bvh")
    clip = read(tmp_path / "new" / "clip.bvh")
    assert clip.names == whole.names
    assert clip.rate_hz == whole.rate_hz
    assert np.array_equal(clip.positions, whole.positions[first : last + 1])


def test_a_bvh_clip_keeps_every_byte_but_the_count(bvh, tmp_path):
    text = bvh.read_bytes().replace(b"\n", b"\r\n").replace(b"lknee", b"l\xe4knee")
    bvh.write_bytes(text)
    cut_file(bvh, 2, 4, tmp_path / "clip.bvh")
    lines, clip = text.split(b"\r\n"), (tmp_path / "clip.bvh").read_bytes().split(b"\r\n")
    at = lines.index(b"MOTION")
    assert clip[: at + 1] == lines[: at + 1]
    assert clip[at + 1] == b"Frames: 3"
    assert clip[at + 2] == lines[at + 2]
    assert clip[at + 3 :] == [*lines[at + 5 : at + 8], b""]


def test_an_amc_clip_counts_from_one_and_keeps_its_digits(amc, tmp_path):
    cut_file(amc, 7, 9, tmp_path / "clip.amc")
    clip = (tmp_path / "clip.amc").read_bytes().decode("latin-1")
    header, _, _ = AMC.partition("5\r\n")
    assert clip == header + "".join(
        f"{i}\r\nroot {n}.10 0 {n}e-015 0 0 0\r\nlowerback {n / 7:.9f}\r\n"
        for i, n in enumerate((7, 8, 9), start=1)
    )


def test_an_amc_clip_is_those_frames(amc, tmp_path):
    whole = read(amc)
    assert (whole.first_frame, whole.n_frames) == (5, 20)
    cut_file(amc, 7, 24, tmp_path / "clip.amc")
    clip = read(tmp_path / "clip.amc", asf=tmp_path / "body.asf")
    assert clip.first_frame == 1
    assert np.array_equal(clip.positions, whole.positions[2:])


def test_packed_files_are_cut(bvh, tmp_path):
    packed = tmp_path / "packed.bvh.gz"
    packed.write_bytes(gzip.compress(bvh.read_bytes()))
    for name in ("clip.bvh.gz", "clip.bvh"):
        cut_file(packed, 1, 3, tmp_path / name)
        assert read(tmp_path / name).n_frames == 3
    assert (tmp_path / "clip.bvh.gz").read_bytes()[:2] == b"\x1f\x8b"
    cut_file(bvh, 1, 3, tmp_path / "again.bvh.gz")
    assert np.array_equal(
        read(tmp_path / "again.bvh.gz").positions, read(tmp_path / "clip.bvh").positions
    )


def test_text_of_wide_letters_is_cut(bvh, tmp_path):
    bvh.write_bytes(bvh.read_text().encode("utf-16"))
    cut_file(bvh, 1, 3, tmp_path / "clip.bvh")
    assert read(tmp_path / "clip.bvh").n_frames == 3


@pytest.mark.parametrize(("first", "last"), [(-1, 3), (3, 1000), (5, 4)])
def test_frames_that_are_not_there_are_refused(bvh, amc, tmp_path, first, last):
    with pytest.raises(InvalidInput, match=r"take.bvh: has frames 0 to \d+, asked for are"):
        cut_file(bvh, first, last, tmp_path / "clip.bvh")
    with pytest.raises(InvalidInput, match=r"walk.amc: has frames 5 to 24, asked for are"):
        cut_file(amc, first, last, tmp_path / "clip.amc")
    assert not list(tmp_path.glob("clip*"))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t: t.replace("MOTION", "NOTHING"), "no MOTION"),
        (lambda t: t.replace("Frame Time", "Time"), "no MOTION"),
        (lambda t: re.sub(r"(\n[-\d.]+ [-\d.]+ )", r"\1\n", t), "does not stand on one line"),
    ],
)
def test_broken_bvh_is_told(bvh, tmp_path, change, words):
    bvh.write_text(change(bvh.read_text()))
    with pytest.raises(UnreadableFile, match=words):
        cut_file(bvh, 0, 3, tmp_path / "clip.bvh")


def test_broken_amc_is_told(amc, tmp_path):
    amc.write_bytes(amc.read_bytes().replace(b"\r\n8\r\n", b"\r\n88\r\n"))
    with pytest.raises(UnreadableFile, match="frame 8 is missing"):
        cut_file(amc, 7, 9, tmp_path / "clip.amc")
    amc.write_text(":DEGREES\n")
    with pytest.raises(UnreadableFile, match="no frame number"):
        cut_file(amc, 7, 9, tmp_path / "clip.amc")


def test_other_files_cannot_be_cut(tmp_path):
    (tmp_path / "take.fbx").touch()
    assert not can_cut("take.fbx")
    assert can_cut("take.BVH")
    assert can_cut("take.amc.gz")
    with pytest.raises(UnreadableFile, match=r"cut out of .*\.npz.*, not out of '.fbx'"):
        cut_file(tmp_path / "take.fbx", 0, 3, tmp_path / "clip.fbx")
    with pytest.raises(UnreadableFile, match=r"none.bvh: cannot be read"):
        cut_file(tmp_path / "none.bvh", 0, 3, tmp_path / "clip.bvh")


def full_motion():
    """Points with a gap, events, and frames that count from 12."""
    motion = synthetic_motion("squat", seed=1, rate_hz=60).cut(0, 60)
    positions = motion.positions.copy()
    positions[20:25, 3] = np.nan
    events = (Event("Foot Strike", "left", 0.1), Event("Foot Off", "right", 0.4))
    recording = Recording(rate_hz=60.0, first_frame=12)
    return replace(motion, positions=positions, recording=recording, events=events)


@pytest.mark.parametrize("suffix", [".c3d", ".trc", ".trc.gz", ".npz"])
def test_a_clip_of_points_is_those_frames(tmp_path, suffix):
    path, clip = tmp_path / f"take{suffix}", tmp_path / f"clip{suffix}"
    write(full_motion(), path)
    whole = read(path)
    cut_file(path, 30, 41, clip)
    expected, part = whole.cut(18, 30), read(clip)
    assert part.names == expected.names
    assert (part.first_frame, part.rate_hz) == (30, 60)
    assert np.array_equal(part.positions, expected.positions, equal_nan=True)
    if suffix == ".npz":
        assert part.events == expected.events
    with pytest.raises(InvalidInput, match=r"has frames 12 to 71, asked for are 70 to 72"):
        cut_file(path, 70, 72, tmp_path / f"late{suffix}")
    with pytest.raises(InvalidInput, match=r"has frames 12 to 71"):
        cut_file(path, 11, 20, tmp_path / f"early{suffix}")


@pytest.mark.parametrize("machine", [INTEL, DEC, MIPS])
@pytest.mark.parametrize("scale", [-1.0, 0.1])
def test_a_c3d_clip_keeps_analog_values_and_parameters(tmp_path, machine, scale):
    positions = np.random.default_rng(5).uniform(100, 900, (40, 3, 3)).round(1)
    trial = {
        "ACTUAL_START_FIELD": np.array([7, 0], dtype=np.int16),
        "ACTUAL_END_FIELD": np.array([46, 0], dtype=np.int16),
    }
    content = c3d_bytes(
        positions,
        ["A", "B", "C"],
        machine=machine,
        scale=scale,
        first=7,
        analog=4,
        point={"LONG_FRAMES": 40.0},
        groups={"TRIAL": trial, "OWN": {"NOTE": ["kept"]}},
    )
    (tmp_path / "a.c3d").write_bytes(content)
    cut_file(tmp_path / "a.c3d", 9, 12, tmp_path / "clip.c3d")
    head, clip = parse_head(content), (tmp_path / "clip.c3d").read_bytes()
    frame = (len(content) - (head.header.data_block - 1) * 512) // 40
    start = len(content) - 40 * frame
    assert clip[start:] == content[start + 2 * frame : start + 6 * frame]
    cut_head = parse_head(clip)
    assert cut_head.texts("OWN", "NOTE") == ("kept",)
    assert (cut_head.header.first_frame, cut_head.header.last_frame) == (9, 12)
    assert cut_head.count("POINT", "FRAMES", 0) == cut_head.count("POINT", "LONG_FRAMES", 0) == 4
    assert cut_head.count("TRIAL", "ACTUAL_END_FIELD", 0) == 12
    whole, part = read(tmp_path / "a.c3d"), read(tmp_path / "clip.c3d")
    assert np.array_equal(part.positions, whole.positions[2:6])


def test_a_trc_clip_keeps_every_byte_but_the_count(tmp_path):
    write(full_motion(), tmp_path / "a.trc")
    text = (tmp_path / "a.trc").read_bytes().replace(b"\n", b"\r\n")
    (tmp_path / "a.trc").write_bytes(text)
    cut_file(tmp_path / "a.trc", 13, 14, tmp_path / "clip.trc")
    lines, clip = text.split(b"\r\n"), (tmp_path / "clip.trc").read_bytes().split(b"\r\n")
    assert clip[:2] + clip[3:5] == lines[:2] + lines[3:5]
    assert clip[2].split(b"\t") == [*lines[2].split(b"\t")[:2], b"2", *lines[2].split(b"\t")[3:]]
    assert clip[5:] == [*lines[6:8], b""]
    # A header that has too few values stays as it is.
    lines[2] = b"60.0"
    (tmp_path / "a.trc").write_bytes(b"\r\n".join(lines))
    cut_file(tmp_path / "a.trc", 13, 14, tmp_path / "clip.trc")
    assert (tmp_path / "clip.trc").read_bytes().split(b"\r\n")[2] == b"60.0"


def test_clips_of_other_arrays_keep_what_they_have(tmp_path):
    rng = np.random.default_rng(2)
    given = {
        "poses": rng.normal(size=(16, 156)) / 9,
        "trans": rng.normal(size=(16, 3)),
        "betas": rng.normal(size=16),
        "mocap_framerate": np.array(60.0),
    }
    np.savez(tmp_path / "a.npz", **given)
    cut_file(tmp_path / "a.npz", 3, 7, tmp_path / "clip.npz")
    with np.load(tmp_path / "clip.npz") as clip:
        assert np.array_equal(clip["poses"], given["poses"][3:8])
        assert np.array_equal(clip["betas"], given["betas"])
    assert read(tmp_path / "clip.npz").n_frames == 5
    np.savez(tmp_path / "batch.npz", joints=rng.normal(size=(3, 16, 22, 3)), fps=20)
    cut_file(tmp_path / "batch.npz", 3, 7, tmp_path / "clip.npz", take=2)
    with np.load(tmp_path / "batch.npz") as batch, np.load(tmp_path / "clip.npz") as clip:
        assert np.array_equal(clip["joints"], batch["joints"][1, 3:8])
    for other in ({"a": np.zeros(3)}, {"poses": np.zeros(()), "trans": np.zeros((4, 3))}):
        np.savez(tmp_path / "other.npz", **other)
        with pytest.raises(UnreadableFile, match="no clips can be cut out of it"):
            cut_file(tmp_path / "other.npz", 0, 1, tmp_path / "clip.npz")


def test_a_clip_that_would_end_late_is_called_by_the_end(tmp_path):
    write(full_motion(), tmp_path / "take.c3d")
    track = LabelTrack(Recording("take.c3d"), (Label("squat", 0.5, 20.0),))
    plan = plan_clips([track], {"take.c3d": tmp_path / "take.c3d"}, tmp_path / "out")
    (clip,) = cut_clips(plan)
    assert clip.target.name == "take_squat_0.50-1.00s.c3d"
    assert clip.label.end_s == 1.0
    assert [path.name for path in (tmp_path / "out").iterdir()] == [clip.target.name]
    (again,) = cut_clips(plan)
    assert isinstance(again.error, UnwritableFile)
    (replaced,) = cut_clips(plan, replace=True)
    assert replaced == clip


def test_a_recording_is_not_replaced_by_its_clip(bvh):
    before = bvh.read_bytes()
    with pytest.raises(UnwritableFile, match="would replace the recording"):
        cut_file(bvh, 0, 3, bvh)
    assert bvh.read_bytes() == before


# -- skeletons ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("motion", "skeleton", "copied"),
    [
        ("body_walk.amc", "body.asf", "body.asf"),
        ("body.amc", "body.asf", "body.asf"),
        ("bodywalk.amc", "body.asf", "bodywalk.asf"),
        ("take.amc", "Body.ASF", "take.asf"),
    ],
)
def test_clips_find_their_skeleton(tmp_path, motion, skeleton, copied):
    source, clips = tmp_path / "in", tmp_path / "out"
    source.mkdir()
    (source / motion).write_bytes(AMC.encode("latin-1"))
    (source / skeleton).write_text(ASF)
    (clips / "other.asf").parent.mkdir()
    (clips / "other.asf").write_text("")
    stem = motion.removesuffix(".amc")
    cut_file(source / motion, 5, 9, clips / f"{stem}_squat_0.00-0.10s.amc")
    copy_skeleton(source / motion, clips)
    assert (clips / copied).read_text() == ASF
    assert read(clips / f"{stem}_squat_0.00-0.10s.amc").n_frames == 5


def test_a_skeleton_that_is_there_stays(amc, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "body.asf").write_text("mine")
    copy_skeleton(amc, tmp_path / "out")
    assert (tmp_path / "out" / "body.asf").read_text() == "mine"


# -- clips of labels ----------------------------------------------------------------------


def track(recording, *labels):
    made = [Label(name, a, b, start_frame=i, end_frame=j) for name, a, b, i, j in labels]
    return LabelTrack(Recording(recording), tuple(made))


def targets(tracks, files):
    return [clip.target.name for clip in plan_clips(tracks, files, "out")]


def test_clips_are_called_after_recording_label_and_seconds(tmp_path):
    files = {"a/take.bvh": tmp_path / "take.bvh", "walk.AMC": tmp_path / "walk.AMC"}
    tracks = [
        track("a/take.bvh", ("squat", 1.204, 3.4, 36, 101)),
        track("walk", ("kick left/right: ?", 0.0, 12.0, 1, 360)),
    ]
    assert targets(tracks, files) == [
        "take_squat_1.20-3.40s.bvh", "walk_kick_left_right_0.00-12.00s.amc",
    ]  # fmt: skip


def test_every_clip_has_a_name_of_its_own(tmp_path):
    files = {name: tmp_path / name for name in ("a/take.bvh", "b/Take.bvh", "c.bvh")}
    tracks = [
        track("a/take.bvh", ("squat", 0, 1, 0, 9), ("squat", 0.001, 1, 0, 9)),
        track("b/Take.bvh", ("squat", 0, 1, 0, 9)),
        track("c.bvh", ("x", 0, 1, 0, 9), ("X", 0, 1, 0, 9)),
    ]
    assert targets(tracks, files) == [
        "a_take_squat_0.00-1.00s.bvh", "a_take_squat_0.00-1.00s-2.bvh",
        "b_Take_squat_0.00-1.00s.bvh", "c_X_0.00-1.00s.bvh", "c_x_0.00-1.00s-2.bvh",
    ]  # fmt: skip


@pytest.mark.usefixtures("two_processes")
def test_a_batch_of_clips_finishes(bvh, amc, tmp_path):
    files = {"take.bvh": bvh, "body_walk.amc": amc, "x.c3d": tmp_path / "x.c3d"}
    tracks = [
        track("take.bvh", ("squat", 0.1, 0.5, 3, 14), ("late", 99, 100, 2970, 2999)),
        track("nothing", ("squat", 0, 1, 0, 9)),
        track("x.c3d", ("squat", 0, 1, 0, 9)),
        track("body_walk.amc", ("walk", 0.02, 0.1, 7, 15)),
    ]
    clips = plan_clips(tracks, files, tmp_path / "out")
    done = list(cut_clips(clips))
    assert [isinstance(clip, Failure) for clip in done] == [False, True, True, True, False]
    assert "there is no recording of this name" in str(done[2].error)
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        "body.asf", "body_walk_walk_0.02-0.10s.amc", "take_squat_0.10-0.50s.bvh",
    ]  # fmt: skip
    assert read(done[0].target).n_frames == 12
    assert next(iter(cut_clips(clips, jobs=2))) == done[0]


def test_labels_made_in_seconds_are_cut_at_the_rate_of_the_file(bvh, amc, tmp_path):
    tracks = [
        LabelTrack(Recording("take.bvh"), (Label("squat", 0.1, 0.5), Label("late", 1.0, 99.0))),
        LabelTrack(Recording("body_walk.amc"), (Label("walk", 0.0, 0.2),)),
        LabelTrack(Recording("take.bvh"), (Label("after", 98.0, 99.0),)),
    ]
    files = {"take.bvh": bvh, "body_walk.amc": amc}
    *done, after = cut_clips(plan_clips(tracks, files, tmp_path / "out"))
    whole = read(bvh)
    assert np.array_equal(read(done[0].target).positions, whole.positions[3:15])
    assert np.array_equal(read(done[1].target).positions, whole.positions[30:])
    assert read(done[2].target).n_frames == 20
    assert "asked for is 98.00 to 99.00 s" in str(after.error)
    (slow,) = cut_clips(
        plan_clips(tracks[1:2], files, tmp_path / "slow"), options=ReadOptions(rate_hz=30.0)
    )
    assert read(slow.target).n_frames == 6
