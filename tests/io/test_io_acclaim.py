"""Do joints of Acclaim files lie where the format and its authors put them?"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from motionary.errors import InvalidInput, UnreadableFile
from motionary.io import find_recordings, read
from motionary.io.formats import amc
from motionary.io.formats.asf import find_asf, read_asf
from motionary.motion import GENERIC_JOINTS, forward_kinematics
from motionary.rotations import quaternions_to_matrices
from oracles import kinematics as oracle
from oracles import motion_files as files

CLIPS = (
    "HDM_bd_squat1Reps_001_120",
    "HDM_bk_lieDownFloor_005_120",
    "HDM_dg_throwBasketball_007_120",
    "HDM_mm_kickLFront1Reps_019_120",
    "HDM_tr_elbowToKnee1RepsLelbowStart_021_120",
)


def write(folder, asf, amc, *, name="a_1", encoding="utf-8"):
    (folder / f"{name}.asf").write_text(asf, encoding=encoding)
    path = folder / f"{name}.amc"
    path.write_text(amc, encoding=encoding)
    return path


@pytest.fixture
def small(tmp_path):
    """A random skeleton and four frames, as what they are and as files."""
    rng = np.random.default_rng(7)
    bones, children = files.random_acclaim(rng)
    values = files.random_values(rng, bones, 4)
    path = write(tmp_path, files.asf_text(bones, children), files.amc_text(bones, values))
    return path, bones, children, values


@pytest.mark.parametrize("clip", CLIPS)
def test_joints_lie_where_the_authors_of_hdm05_have_them(data, golden, clip):
    # joint_positions.npz: every tenth frame by the parser of the authors' toolbox.
    table = np.load(golden / "joint_positions.npz")
    path = next((data / "hdm05").glob(f"*/{clip}.*"))
    order = [GENERIC_JOINTS.index(joint) for joint in table["joints"]]
    positions = read(path).generic_positions()[::10, order]
    np.testing.assert_allclose(positions, table[clip], rtol=0, atol=1e-6)


def test_clips_and_takes_at_hand_are_read(data):
    paths = find_recordings([data / "hdm05", data / "hdm05_takes", data / "cmu"], suffixes={".amc"})
    clips = [path for path in paths if path.parent.parent.name == "hdm05"]
    assert len(clips) == 288
    # All of them are read by the evidence; here every fourth.
    for path in paths[::4]:
        asf = data / "cmu" / "86.asf" if path.parent.name == "exercises" else None
        motion = read(path, asf=asf)
        assert motion.mapping.name == "acclaim"
        assert np.isfinite(motion.generic_positions()).all()
        assert motion.rate_hz == 120
        # A body is 1.3 to 2.1 m long from toes to top, whatever it does.
        spread = np.ptp(motion.positions[0], axis=0)
        assert 0.8 < np.linalg.norm(spread) < 3


@given(st.integers(0, 2**32 - 1), st.booleans(), st.booleans())
def test_bones_turn_as_the_format_says(tmp_path_factory, seed, radians, keyword):
    rng = np.random.default_rng(seed)
    bones, children = files.random_acclaim(rng)
    values = files.random_values(rng, bones, 3)
    length = float(rng.choice([0.45, 1.0, 2.54]))
    path = write(
        tmp_path_factory.mktemp("acclaim"),
        files.asf_text(bones, children, length=length, radians=radians),
        files.amc_text(bones, values, radians=radians, keyword=keyword),
    )
    motion = read(path)
    assert set(motion.names) == set(bones)
    for frame in range(3):
        expected = oracle.acclaim_frame(bones, children, values[frame], 0.0254 / length)
        for joint, name in enumerate(motion.names):
            np.testing.assert_allclose(motion.positions[frame, joint], expected[name], atol=1e-9)


def test_skeleton_and_rotations_give_the_positions_again(small):
    motion = read(small[0])
    again = forward_kinematics(
        motion.skeleton, quaternions_to_matrices(motion.rotations), motion.positions[:, 0]
    )
    np.testing.assert_allclose(again, motion.positions, atol=1e-12)


def test_what_was_assumed_is_said(small):
    motion = read(small[0])
    assert motion.rate_hz == 120
    assert "rate assumed 120 Hz" in motion.notes
    assert any("a_1.asf" in note for note in motion.notes)
    told = read(small[0], rate_hz=60)
    assert told.rate_hz == 60
    assert not any("assumed" in note for note in told.notes)


def test_frames_keep_their_numbers(tmp_path, small):
    _, bones, children, values = small
    text = files.amc_text(bones, values, first=41)
    path = write(tmp_path, files.asf_text(bones, children), text, name="b_2")
    assert read(path).first_frame == 41
    assert read(small[0]).first_frame == 1


@pytest.mark.parametrize("change", ["crlf", "cr", "latin-1", "blank lines", "comments", "tabs"])
def test_looks_of_a_file_do_not_matter(tmp_path, small, change):
    path, bones, children, values = small
    text = files.amc_text(bones, values)
    changed = {
        "crlf": text.replace("\n", "\r\n"),
        "cr": text.replace("\n", "\r"),
        "blank lines": text.replace("\n2\n", "\n\n \n2\n") + "\n\n",
        "comments": text.replace("\n2\n", "\n# the second frame\n2 # two\n"),
        "tabs": text.replace(" ", "\t"),
    }.get(change, text)
    encoding = "latin-1" if change == "latin-1" else "utf-8"
    other = tmp_path / change
    other.mkdir()
    copy = write(other, files.asf_text(bones, children), changed, encoding=encoding)
    np.testing.assert_array_equal(read(copy).positions, read(path).positions)


def test_suffix_in_capitals_and_names_beyond_ascii(tmp_path, small):
    path, bones, children, values = small
    folder = tmp_path / "für Bonn 日本"
    folder.mkdir()
    copy = write(folder, files.asf_text(bones, children), files.amc_text(bones, values))
    copy = copy.rename(copy.with_name("a 1.AMC"))
    motion = read(copy)
    assert motion.source == "a 1.AMC"
    np.testing.assert_array_equal(motion.positions, read(path).positions)


def test_bones_beyond_ascii(tmp_path, small):
    _, bones, children, values = small
    texts = [files.asf_text(bones, children), files.amc_text(bones, values)]
    asf, amc = (text.replace("bone1", "hüfte") for text in texts)
    assert "hüfte" in read(write(tmp_path, asf, amc, name="c")).names
    assert "hüfte" in read(write(tmp_path, asf, amc, name="d", encoding="latin-1")).names


def test_lines_of_a_frame_may_come_in_any_sequence(tmp_path, small):
    path, bones, children, values = small
    lines = files.amc_text(bones, values).split("\n")
    start = lines.index("3")
    stop = lines.index("4")
    lines[start + 1 : stop] = reversed(lines[start + 1 : stop])
    copy = write(tmp_path, files.asf_text(bones, children), "\n".join(lines), name="b")
    np.testing.assert_array_equal(read(copy).positions, read(path).positions)


def test_line_by_line_and_at_once_are_equal(data):
    body = amc._find_body(amc.read_text(data / "cmu" / "49_08.amc"))
    layout = amc._read_layout(body)
    at_once = amc._read_block(body, layout)
    np.testing.assert_array_equal(at_once, amc._read_lines(body, layout))


def replaced(old, new):
    return lambda text: text.replace(old, new, 1)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (replaced("\n3\n", "\n4\n"), r"frame 3 is missing"),
        (replaced("\n3\n", "\n"), r"line \d+: root occurs twice"),
        (lambda text: text[: text.rindex("bone")], r"last frame ends without"),
        (lambda text: text[: text.rindex(" ")], r"last frame ends|values"),
        (replaced("\nroot ", "\nroot x"), r"expected a number, got 'x"),
        (replaced("\nroot ", "\nroot nan "), r"values|expected a number"),
        (replaced("\nroot ", "\nroot 1 "), r"values"),
        (replaced("\nroot ", "\ntoor "), r"'toor' is not in|not among"),
        (lambda text: text[: text.index("\n1\n")], r"no frame number"),
        (lambda text: "", r"no frame number"),
        (lambda text: "\0\0\0", r"no frame number"),
        (lambda text: ":DEGREES\n1\n2\n", r"first frame is empty"),
    ],
)
def test_broken_motions_are_refused_with_the_place(tmp_path, small, change, words):
    _, bones, children, values = small
    text = change(files.amc_text(bones, values))
    path = write(tmp_path, files.asf_text(bones, children), text, name="b")
    with pytest.raises(UnreadableFile, match=words) as caught:
        read(path)
    assert "b.amc" in str(caught.value)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (replaced("length 0.45", "length 0"), r"line 5: .*positive"),
        (replaced("length 0.45", "length 1e-320"), r"line 5: .*positive"),
        (replaced("length 0.45", "length much"), r"line 5: .*numbers"),
        (replaced("name bone1", "name bone0"), "name of its own"),
        (replaced("dof r", "dof l r"), "degrees of freedom"),
        (replaced(":hierarchy", ":nothing"), "does not reach"),
        (replaced("    root ", "    root bone5 bone4 bone3 bone2 bone1 bone0 "), "twice"),
        (replaced("    root ", "    root nobody "), "nobody"),
        (replaced("direction", "direction nan"), "direction"),
        (lambda text: "", "no bones"),
        (lambda text: ":bonedata\nlength 3", "before the name"),
    ],
)
def test_broken_skeletons_are_refused_with_the_place(tmp_path, small, change, words):
    _, bones, children, values = small
    asf = change(files.asf_text(bones, children))
    path = write(tmp_path, asf, files.amc_text(bones, values), name="b")
    with pytest.raises(UnreadableFile, match=words) as caught:
        read(path)
    assert "b.asf" in str(caught.value)


def test_impossibly_large_numbers_are_refused(tmp_path, small):
    _, bones, children, values = small
    values[2]["root"]["tx"] = 1.7e308
    path = write(tmp_path, files.asf_text(bones, children), files.amc_text(bones, values), name="b")
    with pytest.raises(UnreadableFile, match="large"):
        read(path)


@pytest.mark.parametrize(
    ("place", "skeletons", "found"),
    [
        ("HDM_bd_squat_001.amc", ["HDM_bd.asf", "HDM_bk.asf"], "HDM_bd.asf"),
        ("squat/HDM_bd_squat_001.amc", ["HDM_bd.asf", "HDM_bk.asf"], "HDM_bd.asf"),
        ("a/b/86_01.amc", ["86.ASF", "8.asf"], "86.ASF"),
        ("86_01.amc", ["86.asf", "86_01.asf"], "86_01.asf"),
        ("take.amc", ["body.asf"], "body.asf"),
    ],
)
def test_a_skeleton_is_found_by_name_or_because_it_is_alone(tmp_path, place, skeletons, found):
    path = tmp_path / place
    path.parent.mkdir(parents=True, exist_ok=True)
    for name in skeletons:
        (tmp_path / name).touch()
    assert find_asf(path).name == found


def test_without_a_skeleton_the_names_looked_for_are_told(tmp_path):
    path = tmp_path / "clips" / "13_29.amc"
    path.parent.mkdir()
    (tmp_path / "86.asf").touch()
    with pytest.raises(UnreadableFile, match=r"13_29\.asf, 13\.asf.*--asf"):
        find_asf(path)


def test_the_skeleton_may_be_named(tmp_path, small):
    path, _, _, _ = small
    asf = path.with_suffix(".asf").rename(tmp_path / "other skeleton.asf")
    (tmp_path / "second.asf").touch()
    with pytest.raises(UnreadableFile, match="no skeleton"):
        read(path)
    named = read(path, asf=asf)
    np.testing.assert_array_equal(read(path, skeleton=str(asf)).positions, named.positions)
    with pytest.raises(InvalidInput, match="one of acclaim"):
        read(path, asf=asf, skeleton="horse")
    with pytest.raises(UnreadableFile, match=r"nowhere\.asf"):
        read(path, asf=tmp_path / "nowhere.asf")


def test_bones_without_values_stay_at_rest(tmp_path, small):
    _, bones, children, values = small
    asf = files.asf_text(bones, children)
    only_root = {"root": bones["root"]}
    path = write(tmp_path, asf, files.amc_text(only_root, values), name="b")
    motion = read(path)
    still = [{"root": frame["root"]} for frame in values]
    expected = oracle.acclaim_frame(bones, children, still[1], 0.0254 / 0.45)
    np.testing.assert_allclose(
        motion.positions[1], [expected[name] for name in motion.names], atol=1e-9
    )
    assert any("no values" in note for note in motion.notes)


def test_an_asf_states_its_bones(data):
    skeleton = read_asf(data / "cmu" / "86.asf")
    assert len(skeleton.bones) == 30
    assert skeleton.metres == pytest.approx(0.0254 / 0.45)
    assert skeleton.bones["ltibia"].dof == ("rx",)
