"""Are markers of TRC and points of OpenSim's tables where the files put them?"""

import numpy as np
import pytest

from motionary.errors import InvalidInput, UnreadableFile
from motionary.io import read, write
from motionary.motion import Motion
from motionary.recording import Recording

ROWS = ["1\t0.00\t1\t2\t3\t4\t5\t6", "2\t0.01\t7\t8\t9\t\t\t", "3\t0.02\t\t\t\t10\t11\t12"]


def trc_text(rows=ROWS, *, names="A\t\t\tB\t\t", rate="100", units="mm", n_frames=None, blank=True):
    lines = [
        "PathFileType\t4\t(X/Y/Z)\ta.trc",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits",
        f"{rate}\t{rate}\t{len(rows) if n_frames is None else n_frames}\t2\t{units}",
        f"Frame#\tTime\t{names}",
        "\t\tX1\tY1\tZ1\tX2\tY2\tZ2",
        *([""] if blank else []),
        *rows,
    ]
    return "\n".join([*lines, ""])


def put(folder, text, name="a.trc"):
    path = folder / name
    path.write_text(text)
    return path


@pytest.mark.parametrize("blank", [True, False])
@pytest.mark.parametrize(("units", "metres"), [("mm", 1e-3), ("m", 1), ("cm", 1e-2), ("MM", 1e-3)])
def test_places_and_empty_cells(tmp_path, blank, units, metres):
    motion = read(put(tmp_path, trc_text(blank=blank, units=units)))
    assert (motion.names, motion.rate_hz, motion.first_frame) == (("A", "B"), 100, 1)
    nan = [np.nan] * 3
    expected = np.array([[[1, 2, 3], [4, 5, 6]], [[7, 8, 9], nan], [nan, [10, 11, 12]]])
    np.testing.assert_allclose(motion.positions, expected * metres)
    assert motion.notes[:2] == (f"unit {units.lower()}, as the file says", "y up, assumed")


def test_rows_may_end_before_their_last_cells(tmp_path):
    motion = read(put(tmp_path, trc_text(["1\t0\t1\t2\t3", "2\t.01\t1\t2\t3\t4\t5\t6\t\t"])))
    assert np.isnan(motion.positions[0, 1]).all()
    assert motion.positions[1, 1, 2] == pytest.approx(0.006)


def test_zeros_and_half_seen_points_were_not_seen(tmp_path):
    motion = read(put(tmp_path, trc_text(["1\t0\t0\t0\t0\t4\t\t6", "2\t.01\t1\t0\t0\t1\t1\tnan"])))
    assert np.isnan(motion.positions[0]).all()
    assert np.isnan(motion.positions[1, 1]).all()
    assert motion.positions[1, 0, 0] == pytest.approx(0.001)


def test_unlabelled_markers_are_left_out(tmp_path):
    motion = read(put(tmp_path, trc_text(names="S:*1\t\t\tB\t\t")))
    assert motion.names == ("B",)
    assert "1 markers have no label and are left out" in motion.notes


def test_rate_and_times_must_agree(tmp_path):
    path = put(tmp_path, trc_text(rate="60"))
    with pytest.raises(InvalidInput, match="says 60 frames per second, its times 100; pass"):
        read(path)
    assert read(path, rate_hz=60).rate_hz == 60
    assert read(put(tmp_path, trc_text(rate=""))).rate_hz == 100


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("hello", "expected a TRC file"),
        (trc_text(n_frames=7), "promises 7 frames, the file ends after 3"),
        (trc_text(["1\t0\t1\t2\tx\t4\t5\t6"]), "line 7: expected a number, got 'x'"),
        (trc_text(["1\t0\t1\t2\t3\t4\t5\t6\t7"]), "line 7: a frame has 8 numbers, this one 9"),
        (trc_text([]), "holds no frames"),
        (trc_text(names="\t\t\t\t\t"), "names no markers|expected Frame#"),
        (trc_text(["1\t0\t1\t2\tinf\t4\t5\t6"]), "line 7: expected a number, got 'inf'"),
    ],
)
def test_broken_files_say_where(tmp_path, text, words):
    with pytest.raises(UnreadableFile, match=words):
        read(put(tmp_path, text))


def test_the_body_tells_which_way_is_up(data, tmp_path):
    motion = read(data / "cmu" / "85_02.c3d").cut(0, 60)
    write(motion, tmp_path / "a.trc")
    text = (tmp_path / "a.trc").read_text().split("\n")
    turned = text[:5]
    for line in text[5:-1]:
        cells = line.split("\t")
        for i in range(2, len(cells), 3):
            x, y, z = cells[i : i + 3]
            cells[i : i + 3] = x, str(-float(z)), y
        turned.append("\t".join(cells))
    again = read(put(tmp_path, "\n".join(turned), "z up.trc"))
    assert any(note.startswith("z up, by the body") for note in again.notes)
    np.testing.assert_allclose(again.positions, motion.positions, atol=1e-8)
    assert again.mapping == motion.mapping


@pytest.mark.parametrize("name", ["a\tb", "a\nb", " a", ""])
def test_names_that_a_table_does_not_hold(tmp_path, name):
    with pytest.raises(InvalidInput, match="without tabs"):
        write(Motion((name,), np.zeros((1, 1, 3)), Recording(rate_hz=30.0)), tmp_path / "a.trc")


def test_body_kinematics_of_opensim(tmp_path):
    text = (
        "Positions\nversion=1\nnRows=2\nnColumns=8\ninDegrees=yes\n\nUnits are S.I. units\n\n"
        "endheader\ntime\tpelvis_X\tpelvis_Y\tpelvis_Z\tpelvis_Ox\ttorso_X\ttorso_Y\ttorso_Z\n"
        "0\t1\t2\t3\t90\t4\t5\t6\n0.01\t1\t2\t3\t90\t4\tnan\t6\n"
    )
    motion = read(put(tmp_path, text, "a_pos_global.sto"))
    assert (motion.names, motion.rate_hz) == (("pelvis", "torso"), 100)
    np.testing.assert_array_equal(motion.positions[0], [[1, 2, 3], [4, 5, 6]])
    assert np.isnan(motion.positions[1, 1]).all()
    assert motion.notes[:2] == ("unit m, assumed", "y up, assumed")


def test_joint_angles_say_what_to_export(tmp_path):
    text = "Coordinates\nnRows=1\nendheader\ntime\tpelvis_tilt\tpelvis_tx\tpelvis_ty\tpelvis_tz\n"
    with pytest.raises(UnreadableFile, match=r"holds joint angles .* export markers as \.trc"):
        read(put(tmp_path, text + "0\t1\t2\t3\t4\n", "a.mot"))


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ("0\t1,2,3\n0.01\t1,2\n", "line 6: a frame has 4 numbers, this one 3"),
        ("0\t1,2,3\n", "give no frame rate"),
        ("0\t1,2,3\n0.01\t1,2,3\n0.005\t1,2,3\n0.05\t1,2,3\n", "time runs backward"),
        ("0\tx,2,3\n", "line 5: expected a number, got 'x'"),
    ],
)
def test_broken_tables_of_opensim(tmp_path, rows, words):
    with pytest.raises(UnreadableFile, match=words):
        read(put(tmp_path, f"x\nDataType=Vec3\nendheader\ntime\ta\n{rows}", "a.sto"))


def test_missing_frames_are_told_and_put_at_their_times_on_request(tmp_path):
    text = "x\nDataType=Vec3\nendheader\ntime\ta\n0\t1,2,3\n0.01\t1,2,3\n0.02\t1,2,3\n0.05\t4,5,6\n"
    path = put(tmp_path, text, "a.sto")
    motion = read(path)
    assert (motion.n_frames, motion.rate_hz) == (4, 100)
    assert any("2 frames are missing between 0.02 and 0.05 s" in note for note in motion.notes)
    even = read(path, even_times=True)
    np.testing.assert_array_equal(even.positions[:, 0, 0], [1, 1, 1, np.nan, np.nan, 4])


def test_uneven_times_are_told_and_resampled_on_request(tmp_path):
    times = [0, 0.012, 0.018, 0.03, 0.041, 0.05]
    rows = "".join(f"{t}\t{t},1,0\n" for t in times)
    path = put(tmp_path, f"x\nDataType=Vec3\nendheader\ntime\ta\n{rows}", "a.sto")
    assert not any("not evenly spaced" in note for note in read(path, rate_hz=100).notes)
    assert any("not evenly spaced" in note for note in read(path).notes)
    even = read(path, rate_hz=100, even_times=True)
    np.testing.assert_allclose(even.positions[:, 0, 0], np.arange(6) / 100, atol=1e-9)


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.replace("\t", ","),
        lambda text: text.replace("\n", "\r\r\n"),
        lambda text: text.replace(".", ","),
        lambda text: text.replace("A\t\t\tB\t\t", "A:X\tA:Y\tA:Z\tB:X\tB:Y\tB:Z"),
        lambda text: text.replace("A\t\t\tB\t\t", "A_x\tA_y\tA_z\tB_x\tB_y\tB_z"),
        lambda text: text.replace("A\t\t\tB\t\t", "A\tA\tA\tB\tB\tB"),
    ],
    ids=["commas", "lines ended twice", "decimal commas", "A:X", "A_x", "A A A"],
)
def test_other_spellings_of_the_same_table(tmp_path, change):
    wanted = read(put(tmp_path, trc_text(), "wanted.trc"))
    motion = read(put(tmp_path, change(trc_text()), "changed.trc"))
    assert motion.names == wanted.names
    np.testing.assert_array_equal(motion.positions, wanted.positions)


def test_a_table_without_the_line_of_axes_keeps_its_first_frame(tmp_path):
    wanted = read(put(tmp_path, trc_text(), "wanted.trc"))
    lines = trc_text().split("\n")
    motion = read(put(tmp_path, "\n".join(lines[:4] + lines[5:]), "changed.trc"))
    np.testing.assert_array_equal(motion.positions, wanted.positions)


def test_a_rate_that_no_body_is_recorded_at_is_doubted(tmp_path):
    motion = read(put(tmp_path, trc_text(), "slow.trc"), rate_hz=2)
    assert any(note.startswith("2 Hz is slow") for note in motion.notes)
