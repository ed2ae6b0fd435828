"""Do joints of BVH files lie where the format puts them, and is what is odd said?"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from motionary.errors import InvalidInput, UnreadableFile
from motionary.io import find_recordings, read
from motionary.io.normalise.units import METRES
from motionary.motion import forward_kinematics
from motionary.rotations import quaternions_to_matrices
from oracles import kinematics as oracle
from oracles import motion_files as files


def write(folder, nodes, rows, *, name="a.bvh", **header):
    path = folder / name
    path.write_text(files.bvh_text(nodes, rows, **header), encoding="utf-8")
    return path


def random_rows(rng, nodes, n_frames=4):
    width = sum(len(channels) for *_, channels in nodes)
    return rng.uniform(-180, 180, (n_frames, width)).round(4)


@pytest.fixture
def small():
    """Joints of a random tree and four frames."""
    rng = np.random.default_rng(11)
    nodes = files.random_bvh(rng)
    return nodes, random_rows(rng, nodes)


# Three joints, straight up, 4 units long: one root with positions, one joint, an End Site.
STICK = [
    ("Hips", -1, [0, 0, 0], ["Xposition", "Yposition", "Zposition", "Zrotation"]),
    ("Arm", 0, [0, 1, 0], ["Zrotation"]),
    ("End of Arm", 1, [0, 3, 0], []),
]


def test_a_conversion_equals_the_acclaim_file_it_came_from(data):
    # The conversion puts a rest pose first; what it lacks (thorax, wrists) lies above.
    amc, bvh = read(data / "cmu" / "01_01.amc"), read(data / "cmu" / "01_01.bvh")
    assert (amc.n_frames, bvh.n_frames) == (2751, 2752)
    assert (amc.rate_hz, bvh.rate_hz) == (120, 120)
    pairs = {
        "lhipjoint": "LeftUpLeg",
        "lfemur": "LeftLeg",
        "ltibia": "LeftFoot",
        "lfoot": "LeftToeBase",
        "ltoes": "End of LeftToeBase",
        "rtoes": "End of RightToeBase",
        "lowerback": "Spine",
        "upperback": "Spine1",
    }
    assert_same(amc, bvh, "root", "Hips", pairs)
    above = {
        "lowerneck": "Neck1",
        "upperneck": "Head",
        "head": "End of Head",
        "lclavicle": "LeftArm",
        "lhumerus": "LeftForeArm",
        "lradius": "LeftHand",
        "rradius": "RightFingerBase",
    }
    assert_same(amc, bvh, "thorax", "Neck", above)


def assert_same(amc, bvh, amc_start, bvh_start, pairs):
    for amc_name, bvh_name in pairs.items():
        a = amc.positions[:, amc.names.index(amc_name)]
        b = bvh.positions[1:, bvh.names.index(bvh_name)]
        a = a - amc.positions[:, amc.names.index(amc_start)]
        b = b - bvh.positions[1:, bvh.names.index(bvh_start)]
        np.testing.assert_allclose(a, b, rtol=0, atol=3e-6, err_msg=amc_name)


def test_every_bvh_at_hand_is_read(data):
    folders = [data / "cmu", data / "bandai", data / "sensors" / "neura"]
    paths = find_recordings(folders, suffixes={".bvh"})
    assert len(paths) >= 57
    for path in paths:
        motion = read(path)
        assert np.isfinite(motion.positions).all(), path.name
        assert motion.first_frame == 0
        # Head to feet, standing, bowing or walking: the size of a person.
        heights = np.ptp(motion.positions[..., 1], axis=1)
        assert 1.0 < np.median(heights) < 2.1, path.name


@pytest.mark.parametrize(
    ("name", "rate_hz", "mapping", "unit"),
    [
        ("cmu/01_01.bvh", 120, "cmu_bvh", "unit 1/0.45 inch, by legs"),
        ("cmu/neutral_16_000.bvh", 120, "cmu_bvh", "unit 1/0.45 inch, by legs"),
        ("bandai/bow_old_001.bvh", 30, "bandai", "unit cm, by legs"),
        ("cmu/iclone_07_01.bvh", 60, "character_creator", "unit cm, by legs"),
        ("sensors/neura/S02-Trial-Walk-1.bvh", 100, "xsens", "unit mm, by legs"),
    ],
)
def test_rate_skeleton_and_unit_are_told(data, name, rate_hz, mapping, unit):
    motion = read(data / name)
    assert motion.rate_hz == rate_hz
    assert (motion.mapping.name if motion.mapping else None) == mapping
    assert motion.notes[0].startswith(unit)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("cmu/01_01.bvh", True),
        ("sensors/neura/S02-Trial-Walk-1.bvh", True),
        ("cmu/neutral_16_000.bvh", False),
        ("bandai/dash_normal_001.bvh", False),
    ],
)
def test_a_rest_pose_at_the_beginning_is_noticed(data, name, expected):
    assert any("rest pose" in note for note in read(data / name).notes) == expected


@given(st.integers(1, 7), st.integers(0, 2**32 - 1))
def test_joints_turn_and_move_as_the_channels_say(tmp_path_factory, n_joints, seed):
    rng = np.random.default_rng(seed)
    nodes = files.random_bvh(rng, n_joints)
    rows = random_rows(rng, nodes, 3)
    motion = read(write(tmp_path_factory.mktemp("bvh"), nodes, rows), unit="m")
    assert motion.names == tuple(name for name, *_ in nodes)
    assert motion.skeleton.parents.tolist() == [parent for _, parent, *_ in nodes]
    for frame, row in enumerate(rows):
        np.testing.assert_allclose(
            motion.positions[frame], oracle.bvh_frame(nodes, row), atol=1e-10
        )


def test_skeleton_and_rotations_give_the_positions_again(data):
    # Only the root moves in this file, so that the offsets are all there is.
    motion = read(data / "cmu" / "01_01.bvh").cut(0, 300)
    again = forward_kinematics(
        motion.skeleton, quaternions_to_matrices(motion.rotations), motion.positions[:, 0]
    )
    np.testing.assert_allclose(again, motion.positions, atol=1e-12)


@pytest.mark.parametrize(
    ("printed", "rate_hz"),
    [
        (".0083333", 120),
        ("0.008333", 120),
        ("0.016667", 60),
        ("0.0333333", 30),
        ("0.04", 25),
        ("0.016683", 60 / 1.001),
        ("0.033367", 30 / 1.001),
        ("0.0417083", 24 / 1.001),
        ("0.0333", 30),
        ("0.033", 30),
        ("0.0167", 60),
        ("0.0083", 120),
        ("0.008", 125),
        ("0.0325", pytest.approx(30.769, abs=0.001)),
        ("2", 0.5),
    ],
)
def test_rounded_rates_become_whole(tmp_path, printed, rate_hz):
    path = write(tmp_path, STICK, np.zeros((3, 5)), frame_time=printed)
    assert read(path).rate_hz == rate_hz


@pytest.mark.parametrize("printed", ["0.0", "0", "-0.01", "nan", "inf", "soon", "1e-300", "1e999"])
def test_no_rate_is_an_error_unless_it_is_given(tmp_path, printed):
    path = write(tmp_path, STICK, np.zeros((3, 5)), frame_time=printed)
    with pytest.raises(UnreadableFile, match=r"Frame Time.*--rate"):
        read(path)
    assert read(path, rate_hz=50).rate_hz == 50
    for wrong in (0, -1, float("nan")):
        with pytest.raises(InvalidInput, match="rate_hz"):
            read(path, rate_hz=wrong)


def test_position_channels_replace_the_offset(tmp_path):
    nodes = [
        ("Root", -1, [7, 7, 7], ["Yposition"]),
        ("Joint", 0, [5, 5, 5], ["Zposition", "Xposition"]),
    ]
    motion = read(write(tmp_path, nodes, [[1, 2, 3]] * 3), unit="m")
    np.testing.assert_array_equal(motion.positions[0], [[7, 1, 7], [10, 6, 9]])


def test_end_sites_without_length_are_missing_joints(tmp_path):
    nodes = [*STICK, ("Head", 0, [0, 1, 0], ["Xrotation"]), ("End of Head", 3, [0, -0.0, 0], [])]
    motion = read(write(tmp_path, nodes, np.zeros((3, 6))))
    assert motion.names == ("Hips", "Arm", "End of Arm", "Head")
    assert "1 End Sites without length count as missing joints" in motion.notes


def test_several_roots_and_names_that_occur_twice(tmp_path):
    nodes = STICK + [
        (name, parent + 3 if parent >= 0 else -1, *rest) for name, parent, *rest in STICK
    ]
    rows = np.zeros((3, 10))
    rows[:, 5] = 4.0
    motion = read(write(tmp_path, nodes, rows), unit="m")
    assert motion.names[3:] == ("Hips (2)", "Arm (2)", "End of Arm (2)")
    np.testing.assert_array_equal(motion.positions[0, 3:, 0], 4.0)
    assert any("twice" in note for note in motion.notes)


@pytest.mark.parametrize("change", ["crlf", "cr", "tabs", "braces", "capitals", "end", "mark"])
def test_looks_of_a_file_do_not_matter(tmp_path, small, change):
    nodes, rows = small
    path = write(tmp_path, nodes, rows)
    text = path.read_text(encoding="utf-8")
    changed = {
        "crlf": text.replace("\n", "\r\n"),
        "cr": text.replace("\n", "\r"),
        "tabs": text.replace(" ", "\t").replace("joint\t", "joint ").replace("Frame\tT", "Frame T"),
        "braces": text.replace("\n\t{", " {").replace("\n{", "{"),
        "capitals": text.replace("position", "POSITION").replace("JOINT", "Joint"),
        "end": text.rstrip("\n"),
        "mark": "\ufeff" + text,
    }[change]
    other = tmp_path / "other.bvh"
    other.write_text(changed, encoding="utf-8", newline="")
    a, b = read(path, unit=1), read(other, unit=1)
    assert a.names == b.names
    np.testing.assert_array_equal(a.positions, b.positions)


@pytest.mark.parametrize(
    "name",
    ["mixamorig:Hips", "Left Arm", "hüfte", "腰", "Bip01 L Thigh", "nan", "MOTION1", "a.b-c"],
)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "latin-1"])
def test_names_stay_as_they_are(tmp_path, name, encoding):
    nodes = [(name, *STICK[0][1:]), *STICK[1:]]
    path = tmp_path / f"{name.replace(':', '')} take.BVH"
    text = files.bvh_text(nodes, np.zeros((3, 5)))
    if encoding == "latin-1" and not name.isascii() and name != "hüfte":
        pytest.skip("not a name in this encoding")
    path.write_text(text, encoding=encoding)
    motion = read(path)
    assert motion.names[0] == name
    assert motion.source == path.name


@pytest.mark.parametrize("unit", METRES)
@pytest.mark.parametrize("size", [0.75, 1.0, 1.15])
def test_the_unit_is_told_by_the_size_of_the_body(data, tmp_path, unit, size):
    # A recording in centimetres, written as if by a person of another size in other units.
    text = (data / "bandai" / "bow_old_001.bvh").read_text()
    head, _, frames = text.partition("MOTION")
    factor = 0.01 / METRES[unit] * size
    lines = head.split("\n")
    for i, line in enumerate(lines):
        if "OFFSET" in line:
            lines[i] = "OFFSET " + " ".join(str(float(w) * factor) for w in line.split()[1:])
    rows = np.array([line.split() for line in frames.strip().split("\n")[2:12]], dtype=float)
    scaled = rows.reshape(len(rows), -1, 2, 3)
    scaled[:, :, 0] *= factor
    body = "\n".join(" ".join(map(str, row)) for row in rows.tolist())
    path = tmp_path / "a.bvh"
    path.write_text(
        "\n".join(lines) + f"MOTION\nFrames: {len(rows)}\nFrame Time: .0333333\n{body}\n"
    )
    motion = read(path)
    assert motion.notes[0].startswith(f"unit {unit}, by legs")
    expected = read(data / "bandai" / "bow_old_001.bvh").positions[:10] * size
    np.testing.assert_allclose(motion.positions, expected, atol=1e-9)


@pytest.mark.parametrize(
    ("unit", "metres"), [("m", 1.0), ("cm", 0.01), (0.3048, 0.3048), ("0.0254", 0.0254)]
)
def test_the_unit_may_be_given_by_name_or_number(tmp_path, unit, metres):
    motion = read(write(tmp_path, STICK, np.zeros((3, 5))), unit=unit)
    np.testing.assert_allclose(motion.positions[0, :, 1], [0, metres, 4 * metres])
    np.testing.assert_allclose(motion.skeleton.offsets[2], [0, 3 * metres, 0])
    assert motion.notes[0] == f"unit {unit}, as given"


@pytest.mark.parametrize("unit", ["parsec", "", 0, -1.0, float("nan"), float("inf")])
def test_impossible_units_are_refused(tmp_path, unit):
    with pytest.raises(InvalidInput, match="unit must be one of m, cm"):
        read(write(tmp_path, STICK, np.zeros((3, 5))), unit=unit)


def test_an_asf_does_not_go_with_a_bvh(tmp_path):
    with pytest.raises(InvalidInput, match="own skeleton"):
        read(write(tmp_path, STICK, np.zeros((3, 5))), asf="a.asf")


def replaced(old, new):
    return lambda text: text.replace(old, new, 1)


ROW = "0.0 0.0 0.0 0.0 0.0\n"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (replaced("MOTION", "NOTION"), "no line MOTION"),
        (replaced("Frames:", "Frame:"), r"line 17: expected 'Frames: N'"),
        (replaced("Frame Time:", "Time:"), "expected 'Frames: N'"),
        (replaced("Frames: 3", "Frames: 999999999"), "promises 999999999 frames.*after 3"),
        (replaced("Frames: 3", "Frames: 1e3"), "whole number"),
        (replaced("Frames: 3", "Frames: -3"), "whole number"),
        (replaced(ROW, ""), "promises 3 frames"),
        (replaced(ROW, "0.0 0.0 0.0\n"), r"line 19: a frame has 5 numbers.* 3"),
        (lambda text: text[:-5], r"line 21: a frame has 5"),
        (lambda text: text[: text.index(ROW)], "promises|got 0"),
        (
            replaced(ROW, "0.0 0.0 nan 0.0 0.0\n"),
            "expected a number, got 'nan'",
        ),
        (replaced(ROW, "0.0 x 0.0 0.0 0.0\n"), "line 19: expected a number"),
        (replaced(ROW, "0.0 1_0 0.0 0.0 0.0\n"), "expected a number"),
        (replaced(ROW, "0.0 1e999 0.0 0.0 0.0\n"), "expected a number"),
        (replaced(ROW, "1e300 0.0 0.0 0.0 0.0\n"), "impossibly large"),
        (replaced("CHANNELS 4", "CHANNELS 999999999999999999999"), "line 5: CHANNELS needs"),
        (replaced("CHANNELS 4", "CHANNELS 3"), "line 5: CHANNELS needs"),
        (replaced("Zrotation", "Wrotation"), "line 5: channels are"),
        (replaced("Yposition", "Xposition"), "each once"),
        (replaced("OFFSET 0.0 0.0", "OFFSET 0.0 inf"), "line 4: OFFSET needs"),
        (replaced("OFFSET 0.0", "OFFSET"), "line 4: OFFSET needs"),
        (replaced("JOINT Arm", "JOINT"), "needs a name"),
        (replaced("JOINT Arm", "ROOT Arm"), "ROOT stands outside"),
        (replaced("JOINT Arm", "BONE Arm"), "line 6: expected ROOT, JOINT"),
        (replaced("}", "End Site\n{\n}\n}"), "an End Site has no joints"),
        (replaced("}", "JOINT Hand\n{\n}\n}"), "an End Site has no joints"),
        (replaced("}", "CHANNELS 1 Xrotation\n}"), "an End Site has no channels"),
        (replaced("}", ""), "not closed"),
        (replaced("}", "}}}}}"), "outside of a joint"),
        (replaced("HIERARCHY\n", "HIERARCHY\nOFFSET 1 2 3\n"), "line 2: this stands outside"),
        (lambda text: "HIERARCHY\nMOTION\nFrames: 1\nFrame Time: 1\n1\n", "no joints"),
        (lambda text: "", "no line MOTION"),
    ],
)
def test_broken_files_are_refused_with_the_place(tmp_path, change, words):
    text = files.bvh_text(STICK, np.zeros((3, 5)))
    path = tmp_path / "b.bvh"
    path.write_text(change(text))
    with pytest.raises(UnreadableFile, match=words) as caught:
        read(path)
    assert "b.bvh" in str(caught.value)


def test_more_frames_than_promised_are_read_and_said(tmp_path):
    motion = read(write(tmp_path, STICK, np.zeros((3, 5)), n_frames=2))
    assert motion.n_frames == 3
    assert any("promises 2 frames, all 3" in note for note in motion.notes)


def test_a_missing_file_and_a_folder_are_unreadable(tmp_path):
    with pytest.raises(UnreadableFile, match=r"nowhere\.bvh"):
        read(tmp_path / "nowhere.bvh")
    (tmp_path / "folder.bvh").mkdir()
    with pytest.raises(UnreadableFile, match=r"folder\.bvh"):
        read(tmp_path / "folder.bvh")
