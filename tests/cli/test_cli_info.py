"""`motionary info`: a mapping saved and given back, a picture of first poses, tables."""

import csv
import json

import numpy as np
import pytest

from motionary.io import read, read_labels, write, write_labels, write_table
from motionary.labels import Label, LabelTrack
from motionary.motion import GENERIC_JOINTS, Motion
from motionary.plots import describe_facing, plot_recordings
from motionary.recording import Recording
from motionary.samples import synthetic_motion
from motionary.skeletons import named_mapping
from rig_cases import rig_motion, standing


@pytest.fixture
def rig(tmp_path):
    """A file of a rig that no table knows."""

    def rename(joint):
        joint = joint.removeprefix("mixamorig:")
        return joint.replace("Left", "l").replace("Right", "r")

    write(rig_motion("mixamo", rename=rename), tmp_path / "rig.bvh")
    return tmp_path / "rig.bvh"


def test_a_mapping_is_saved_edited_and_given_back(motionary, rig, tmp_path):
    table = tmp_path / "rig.toml"
    assert motionary("info", rig, "--save-mapping", table).code == 0
    text = table.read_text()
    assert 'lknee = "lLeg"' in text
    table.write_text(text.replace('lfingers = "lHandMiddle4"\n', ""))
    ran = motionary("info", rig, "--skeleton", table)
    assert "rig.bvh: not there: lfingers" in ran.out
    assert " rig  " in ran.out
    # Every command that reads takes it.
    out = tmp_path / "x.csv"
    assert motionary("features", rig, "-o", out, "--skeleton", table).code == 0
    column = [row["left hand fast"] for row in csv.DictReader(out.read_text().splitlines())]
    assert set(column) == {""}


def test_a_slip_in_an_edited_mapping_is_told(motionary, rig, tmp_path):
    table = tmp_path / "rig.toml"
    motionary("info", rig, "--save-mapping", table)
    table.write_text(table.read_text().replace('lknee = "lLeg"', 'lknee = "lLegg"'))
    ran = motionary("info", rig, "--skeleton", table)
    assert "rig: lknee is 'lLegg', which is not there; is it 'lLeg'?" in ran.out


def test_a_mapping_is_of_one_rig(motionary, rig, tmp_path):
    write(synthetic_motion("squat", seed=1), tmp_path / "other.bvh")
    ran = motionary("info", tmp_path, "--save-mapping", tmp_path / "rig.toml")
    assert (ran.code, "a mapping is written of recordings of one rig" in ran.err) == (1, True)
    ran = motionary("info", rig, "--save-mapping", tmp_path / "rig.txt")
    assert "a skeleton is written as .toml" in ran.err
    ran = motionary("info", rig, "--skeleton", tmp_path / "none.toml")
    assert (ran.code, "cannot be read" in " ".join(ran.err.split())) == (2, True)


def test_a_rig_of_unknown_joints_gets_a_template_to_fill_in(motionary, tmp_path):
    figure = synthetic_motion("squat", seed=1)
    names = tuple(f"Objekt {i}" for i in range(len(figure.names)))
    unknown = Motion(names, figure.positions, Recording(rate_hz=figure.rate_hz))
    write(unknown, tmp_path / "props.trc")
    table = tmp_path / "rig.toml"
    ran = motionary("info", tmp_path / "props.trc", "--save-mapping", table)
    assert ran.code == 0, ran.err
    assert "--save-mapping RIG.toml writes what to fill in" in " ".join(ran.out.split())
    text = table.read_text()
    assert text.startswith("# No joint is mapped yet")
    assert "Objekt 23" in text
    # As it is, it maps nothing; filled in, everything.
    ran = motionary("info", tmp_path / "props.trc", "--skeleton", table)
    assert "has none of the joints" in ran.out
    for joint, name in zip(figure.names, names, strict=True):
        text = text.replace(f"# {joint} =\n", f'{joint} = "{name}"\n')
    table.write_text(text)
    ran = motionary("info", tmp_path / "props.trc", "--skeleton", table, "--json")
    assert json.loads(ran.out)["relations_known"] == 40


def test_files_that_cannot_be_read_do_not_stop_a_mapping(motionary, rig, tmp_path):
    (tmp_path / "a.bvh").write_text("HIERARCHY\nROOT")
    (tmp_path / "z.c3d").write_bytes(b"\0" * 700)
    table = tmp_path / "rig.toml"
    ran = motionary("info", tmp_path, "--save-mapping", table)
    assert ran.code == 1
    assert "a.bvh" in ran.out
    assert 'lknee = "lLeg"' in table.read_text()
    rig.unlink()
    ran = motionary("info", tmp_path, "--save-mapping", table, "--force")
    assert (ran.code, "no recording whose joints could be" in ran.err) == (1, True)


def test_first_poses_are_drawn(motionary, rig, tmp_path):
    picture = tmp_path / "first.png"
    (tmp_path / "broken.bvh").write_text("nonsense")
    assert motionary("info", tmp_path, "--plot", picture).code == 1
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert motionary("info", rig, "--plot", tmp_path / "first.gif").code == 2


def test_a_picture_says_name_unit_axes_and_facing(rig):
    squat = synthetic_motion("squat", seed=1)
    points = Motion(
        ("a", "b"), np.random.default_rng(0).random((3, 2, 3)), Recording("thing", rate_hz=30.0)
    )
    figure = plot_recordings([read(rig), squat, points])
    written = [text.get_text() for axes in figure.axes for text in axes.texts]
    assert "rig.bvh" in written
    assert "thing" in written
    assert "skeleton guessed, 60 Hz" in written
    assert "unit cm, by legs of 0.83 m" in written
    assert "y up, by the body" in written
    assert describe_facing(squat) in written


@pytest.mark.parametrize(
    ("degrees", "words"),
    [
        (0, "faces +z"),
        (90, "faces +x"),
        (180, "faces -z"),
        (-90, "faces -x"),
        (30, "faces 30° from +z to +x"),
        (-95, "faces -x"),
        (-120, "faces 30° from -x to -z"),
    ],
)
def test_facing_is_that_of_the_hips(degrees, words):
    turn = np.radians(degrees)
    about_y = np.array(
        [[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]]
    )
    # At rest the figure faces +z.
    positions = np.array([list(standing().values())]) @ about_y.T
    turned = Motion(GENERIC_JOINTS, positions, Recording(rate_hz=120.0), named_mapping("generic"))
    assert describe_facing(turned) == words


def test_the_table_is_written_for_programs_and_for_excel(motionary, rig, tmp_path):
    assert motionary("info", rig, "-o", tmp_path / "a.csv").code == 0
    (row,) = csv.DictReader((tmp_path / "a.csv").read_text().splitlines())
    assert (row["recording"], row["skeleton"], row["rate_hz"]) == ("rig.bvh", "guessed", "60.0")
    assert row["facing"].startswith("11° from")
    assert motionary("info", rig, "-o", tmp_path / "b.csv", "--excel").code == 0
    content = (tmp_path / "b.csv").read_bytes()
    assert content.startswith(b"\xef\xbb\xbfrecording;format;")
    assert b";60,0;1,0;" in content
    assert b"\r\n" in content


def test_labels_for_excel_are_read_again(tmp_path):
    track = LabelTrack(
        Recording("wörd.bvh"), (Label("squat; deep", 0.25, 1.5, cost=0.015, start_frame=7),)
    )
    write_labels(track, tmp_path / "labels.csv", excel=True)
    content = (tmp_path / "labels.csv").read_bytes()
    assert b'"squat; deep";0,25;1,5;7;0,015' in content
    (again,) = read_labels(tmp_path / "labels.csv")["wörd.bvh"]
    assert (again.name, again.start_s, again.end_s) == ("squat; deep", 0.25, 1.5)
    assert (again.cost, again.start_frame) == (0.015, 7)


def test_text_with_points_stays_text(tmp_path):
    write_table([["a.b", 1.5, 2, None, "1.5"]], tmp_path / "t.csv", excel=True)
    assert (tmp_path / "t.csv").read_text(encoding="utf-8-sig") == "a.b;1,5;2;;1.5\n"
