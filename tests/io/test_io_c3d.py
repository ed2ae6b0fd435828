"""Are markers, gaps and events of C3D files where the format puts them?"""

import ezc3d
import numpy as np
import pytest

from motionary.errors import InvalidInput, UnreadableFile
from motionary.features import compute_features
from motionary.io import read
from motionary.io.formats.c3d_writing import write_c3d
from motionary.motion import GENERIC_JOINTS, Event, Motion
from motionary.recording import Recording
from motionary.skeletons import named_mapping
from oracles.c3d_files import DEC, INTEL, MIPS, c3d_bytes

LABELS = ["a", "b", "c"]
RECORDINGS = {
    "hdm05_takes/HDM_dg_06-03_03_120.c3d": (202, 41, 120, 2925, "hdm05_markers"),
    "hdm05_takes/HDM_mm_01-02_03_120.c3d": (3990, 41, 120, 1, "hdm05_markers"),
    "cmu/85_02.c3d": (810, 41, 120, 1, "hdm05_markers"),
    "sensors/neura/S02-Trial-Walk-1-vicon.c3d": (2503, 30, 100, 1, "plug_in_gait"),
}


def put(folder, positions, labels=LABELS, **options):
    path = folder / "a.c3d"
    path.write_bytes(c3d_bytes(positions, labels, **options))
    return path


def some_points(n_frames=5, n_points=3, seed=0):
    return np.random.default_rng(seed).uniform(-900, 900, (n_frames, n_points, 3)).round(1)


def upright(positions_mm):
    """What z up in millimetres is in metres with y up."""
    x, y, z = np.moveaxis(positions_mm / 1000, -1, 0)
    return np.stack((x, z, -y), axis=-1)


@pytest.mark.parametrize("name", RECORDINGS)
def test_recordings_are_read_as_ezc3d_reads_them(data, name):
    frames, points, rate, first, skeleton = RECORDINGS[name]
    motion = read(data / name)
    assert motion.positions.shape == (frames, points, 3)
    assert (motion.rate_hz, motion.first_frame, motion.source) == (rate, first, name.split("/")[-1])
    assert motion.mapping.name == skeleton
    other = ezc3d.c3d(str(data / name))
    labels = other["parameters"]["POINT"]["LABELS"]["value"]
    places = other["data"]["points"][:3, [labels.index(n) for n in motion.names]]
    np.testing.assert_allclose(motion.positions, upright(places.T), atol=1e-4)
    assert compute_features(motion).known_features.any(axis=0).sum() >= 4


def test_unlabelled_points_are_left_out_and_counted(data):
    motion = read(data / "hdm05_takes" / "HDM_dg_06-03_03_120.c3d")
    assert "3 of 44 points have no label and are left out" in motion.notes
    assert not any("*" in name for name in motion.names)
    assert any(note.startswith("z up, by the body") for note in motion.notes)


def test_angles_among_the_points_are_left_out_and_counted(data):
    motion = read(data / "sensors" / "neura" / "S02-Trial-Walk-1-vicon.c3d")
    assert not any("Angles" in name for name in motion.names)
    assert any(note.startswith("11 of 41 points are angles") for note in motion.notes)
    # The legs are known, what was not recorded is not.
    generic = motion.generic_positions()
    seen = {j for j, p in zip(GENERIC_JOINTS, generic[0], strict=True) if np.isfinite(p).all()}
    legs = {f"{s}{j}" for s in "lr" for j in ("hip", "knee", "ankle", "toes")}
    assert seen == {"root"} | legs


@pytest.mark.parametrize("machine", [INTEL, DEC, MIPS])
@pytest.mark.parametrize("scale", [-1.0, -0.1, 0.1])
@pytest.mark.parametrize("analog", [0, 6])
def test_numbers_of_all_machines(tmp_path, machine, scale, analog):
    points = some_points()
    motion = read(put(tmp_path, points, machine=machine, scale=scale, analog=analog))
    np.testing.assert_allclose(motion.positions, upright(points), atol=1e-7)
    assert (motion.names, motion.rate_hz) == (tuple(LABELS), 100)
    assert motion.notes[:2] == ("unit mm, as the file says", "z up, assumed")


@pytest.mark.parametrize("scale", [-1.0, 0.1])
def test_every_way_to_say_that_a_point_was_not_seen(tmp_path, scale):
    points, residuals = some_points(), np.zeros((5, 3))
    residuals[1, 0] = -1
    points[2, 1] = 0
    unseen = {(1, 0), (2, 1)}
    if scale < 0:
        points[3, 2, 1] = np.nan
        unseen.add((3, 2))
    points[4, 0, 0] = 0
    motion = read(put(tmp_path, points, scale=scale, residuals=residuals))
    gaps = np.isnan(motion.positions)
    assert {tuple(place) for place in np.argwhere(gaps.all(axis=2)).tolist()} == unseen
    assert gaps.sum() == 3 * len(unseen)


def test_infinite_places_were_not_seen(tmp_path):
    points = some_points()
    points[0, 0, 2] = np.inf
    assert np.isnan(read(put(tmp_path, points)).positions[0, 0]).all()


VALUES = {
    "by its group": (["a", "Weird", "c"], {"ANGLES": ["Weird"]}),
    "by its group with a prefix": (["P:a", "P:Weird", "P:c"], {"POWERS": ["Weird"]}),
    "by a group of its own": (["a", "Weird", "c"], {"TYPE_GROUPS": ["GOOFS"], "GOOFS": ["Weird"]}),
    "angles by name": (["a", "LKneeAngles", "c"], {}),
    "moments by name": (["a", "S:RHipMoment", "c"], {}),
    "powers by name": (["a", "RAnklePower", "c"], {}),
    "forces by name": (["a", "LGroundReactionForce", "c"], {}),
    "forces by short name": (["a", "LNormalisedGRF", "c"], {}),
    "by description": (["a", "q", "c"], {"DESCRIPTIONS": ["", "Left knee angles X, Y, Z", ""]}),
    "by unit": (["a", "q", "c"], {"UNITS": ["mm", "Nmm", "mm"]}),
}


@pytest.mark.parametrize("how", VALUES)
def test_points_that_are_no_places_are_left_out(tmp_path, how):
    labels, point = VALUES[how]
    motion = read(put(tmp_path, some_points(), labels, point=point))
    assert motion.names == (labels[0], labels[2])
    assert any(n.startswith("1 of 3 points are angles") and labels[1] in n for n in motion.notes)


def test_markers_whose_names_or_descriptions_resemble_values_stay(tmp_path):
    point = {"DESCRIPTIONS": ["inferior angle of the left scapula", "", ""]}
    labels = ["LIAS", "CentreOfMass", "ForceplateCorner"]
    assert read(put(tmp_path, some_points(), labels, point=point)).names == tuple(labels)


def test_events_have_sides_and_times_from_the_first_frame(tmp_path):
    # Frame 51 is the first of the file, 0.5 s after frame 1, from which its times count.
    event = {
        "USED": np.int16(3),
        "CONTEXTS": ["Right", "Left", "General"],
        "LABELS": ["Foot Off", "Foot Strike", "Event"],
        "TIMES": np.array([[0, 0, 1], [0.7, 0.52, 2.5]]),
    }
    motion = read(put(tmp_path, some_points(), first=51, groups={"EVENT": event}))
    assert motion.first_frame == 51
    names = [(e.name, e.side) for e in motion.events]
    assert names == [("Foot Strike", "left"), ("Foot Off", "right"), ("Event", "")]
    assert [e.time_s for e in motion.events] == pytest.approx([0.02, 0.2, 62.0], abs=1e-5)


def test_a_cut_takes_its_events_along():
    events = (Event("a", "left", 0.1), Event("b", "", 0.25), Event("c", "right", 0.4))
    motion = Motion(("p",), np.zeros((50, 1, 3)), Recording(rate_hz=100.0), events=events)
    assert motion.cut(20, 40).events == (Event("b", "", pytest.approx(0.05)),)


def test_a_first_frame_beyond_the_header(tmp_path):
    trial = {
        "ACTUAL_START_FIELD": np.array([70000 % 65536, 1], dtype=np.int16),
        "ACTUAL_END_FIELD": np.array([70004 % 65536, 1], dtype=np.int16),
    }
    motion = read(put(tmp_path, some_points(), groups={"TRIAL": trial}))
    assert (motion.first_frame, motion.n_frames) == (70000, 5)


def test_a_long_recording_goes_on_where_the_header_stops_counting(tmp_path):
    points = np.random.default_rng(1).uniform(1, 9, (70_000, 1, 3))
    path = tmp_path / "long.c3d"
    write_c3d(Motion(("p",), points, Recording(rate_hz=120.0, first_frame=1)), path)
    motion = read(path)
    np.testing.assert_allclose(motion.positions, points, atol=1e-6)
    assert not any("counting" in note for note in motion.notes)
    # Programs that know nothing of more leave no other count; the file itself tells.
    content = path.read_bytes().replace(b"ACTUAL_", b"BCTUAL_").replace(b"LONG_", b"MONG_")
    path.write_bytes(content)
    motion = read(path)
    assert motion.n_frames == 70_000
    assert any("stops counting at 65535" in note for note in motion.notes)


def test_a_file_that_was_cut_off_says_after_which_frame(tmp_path):
    path = put(tmp_path, some_points())
    path.write_bytes(path.read_bytes()[:-60])
    with pytest.raises(UnreadableFile, match="promises 5 frames, the file ends after 3"):
        read(path)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"point": {"USED": np.int16(0)}, "words": {"n_points": 0}}, "holds no points"),
        ({"rate_hz": 0.0}, "frames per second; pass the rate with --rate"),
        ({"point": {"SCALE": 0.0}}, "no scale"),
        ({"labels": ["*0", "*1", ""]}, "none of its 3 points has a name"),
        ({"machine": 83}, "no known processor"),
    ],
)
def test_what_cannot_be_read_says_why(tmp_path, changes, words):
    with pytest.raises(UnreadableFile, match=words):
        read(put(tmp_path, some_points(), **{"labels": LABELS, **changes}))


def test_a_file_that_ends_within_its_head_is_said_to_end(tmp_path):
    path = put(tmp_path, some_points())
    path.write_bytes(path.read_bytes()[:900])
    with pytest.raises(UnreadableFile, match="at least 1024 bytes, this one ends after 900"):
        read(path)


def test_other_files_are_no_c3d(tmp_path):
    path = tmp_path / "a.c3d"
    for content in (b"", b"HIERARCHY", bytes(5000)):
        path.write_bytes(content)
        with pytest.raises(UnreadableFile, match="expected a C3D file"):
            read(path)
    with pytest.raises(UnreadableFile, match="cannot be read"):
        read(tmp_path / "missing.c3d")


@pytest.mark.parametrize("unit", ["m", "cm", "mm"])
def test_units_of_the_file(tmp_path, unit):
    path = put(tmp_path, some_points(), point={"UNITS": [unit]})
    metres = {"m": 1000, "cm": 10, "mm": 1}[unit]
    np.testing.assert_allclose(read(path).positions, upright(some_points() * metres), rtol=1e-6)
    np.testing.assert_allclose(
        read(path, unit=0.5).positions, upright(some_points() * 500), rtol=1e-6
    )


def test_labels_go_on_in_further_parameters(tmp_path):
    names = [f"p{i}" for i in range(300)]
    points = some_points(2, 300)
    path = put(tmp_path, points, names[:255], point={"LABELS2": names[255:]})
    assert read(path).names == tuple(names)


def test_names_that_occur_twice_get_a_number(tmp_path):
    assert read(put(tmp_path, some_points(), ["a", "a", "b"])).names == ("a", "a (2)", "b")


def test_hips_lie_below_the_markers_of_the_pelvis(tmp_path):
    # A person who looks along +y, z up: the steps go down on both sides.
    places = {"LFWT": (-100, 100, 1000), "RFWT": (100, 100, 1000)}
    places |= {"LBWT": (-80, -100, 1000), "RBWT": (80, -100, 1000)}
    mapping = named_mapping("hdm05_markers")
    path = put(tmp_path, np.array([list(places.values())] * 2, dtype=float), list(places))
    motion = read(path, up="z")
    motion = Motion(motion.names, motion.positions, Recording(rate_hz=100.0), mapping)
    generic = motion.generic_positions()[0]
    length = np.hypot(20, 200)
    for joint, x in (("lhip", -0.7 * 100 - 0.3 * 80), ("rhip", 0.7 * 100 + 0.3 * 80)):
        place = (x, 0.7 * 100 - 0.3 * 100, 1000 - 0.4 * length)
        got = generic[GENERIC_JOINTS.index(joint)]
        np.testing.assert_allclose(got, upright(np.array(place)), atol=1e-6)


def test_joints_equal_a_plain_transcription(data):
    motion = read(data / "hdm05_takes" / "HDM_dg_06-03_03_120.c3d")
    p = {n.split(":")[1]: motion.positions[:, i] for i, n in enumerate(motion.names)}
    generic = dict(zip(GENERIC_JOINTS, np.moveaxis(motion.generic_positions(), 1, 0), strict=True))
    assert not np.isnan(motion.generic_positions()).any()
    for s, o in (("L", "R"), ("R", "L")):
        front, back, other = p[f"{s}FWT"], p[f"{s}BWT"], p[f"{o}BWT"]
        n = np.cross(back - front, back - other)
        n *= (1 if s == "L" else -1) / np.linalg.norm(n, axis=1, keepdims=True)
        n *= np.linalg.norm(back - front, axis=1).mean()
        knee = p[f"{s}KNE"] + 0.6 * (p[f"{s}TOE"] - p[f"{s}MT5"])
        knee += 0.2 * (p[f"{s}MT5"] - p[f"{s}ANK"])
        expected = {
            "hip": 0.7 * front + 0.3 * back + 0.4 * n,
            "knee": knee,
            "ankle": p[f"{s}ANK"] + 0.3 * (p[f"{s}TOE"] - p[f"{s}MT5"]),
            "toes": (p[f"{s}TOE"] + p[f"{s}MT5"]) / 2,
            "wrist": (p[f"{s}WRA"] + p[f"{s}WRB"]) / 2,
        }
        for joint, place in expected.items():
            np.testing.assert_allclose(generic[s.lower() + joint], place, atol=1e-9)
    # Below the belt, above the knees.
    assert (generic["lhip"][:, 1] < p["LFWT"][:, 1]).all()
    assert (generic["rhip"][:, 1] < p["RFWT"][:, 1]).all()


def test_an_axis_that_the_body_contradicts_is_an_error(data, tmp_path):
    motion = read(data / "cmu" / "85_02.c3d")
    path = tmp_path / "a.c3d"
    write_c3d(motion, path)
    content = path.read_bytes()
    assert b"+Z" in content
    path.write_bytes(content.replace(b"+Z", b"+Y", 1))
    with pytest.raises(InvalidInput, match=r"y points up, .* along z; say which with --up"):
        read(path)
    np.testing.assert_allclose(read(path, up="z").positions, motion.positions, atol=1e-6)
    with pytest.raises(InvalidInput, match="up must be one of"):
        read(path, up="sideways")


def test_what_is_written_is_read_by_ezc3d(tmp_path):
    positions = some_points(7) / 1000
    positions[2, 1] = np.nan
    positions[3, 0] = 0
    events = (Event("Foot Strike", "left", 0.03), Event("x", "", 0.0))
    motion = Motion(
        ("a", "b", "Ä"), positions, Recording(rate_hz=59.94, first_frame=12), events=events
    )
    path = tmp_path / "a.c3d"
    write_c3d(motion, path)
    other = ezc3d.c3d(str(path))
    point = other["parameters"]["POINT"]
    assert point["RATE"]["value"][0] == pytest.approx(59.94)
    assert point["LABELS"]["value"] == ["a", "b", "Ä"]
    places = other["data"]["points"][:3].T
    np.testing.assert_allclose(upright(places), positions, atol=1e-6)
    assert other["header"]["points"]["first_frame"] == 11
    assert other["data"]["meta_points"]["residuals"][0, 1, 2] == -1
    again = read(path)
    assert again.rate_hz == 59.94
    np.testing.assert_allclose(again.positions, positions, atol=1e-6)


@pytest.mark.parametrize("name", ["x" * 128, " "])
def test_names_that_the_format_does_not_hold(tmp_path, name):
    with pytest.raises(InvalidInput, match="1 to 127 bytes"):
        write_c3d(Motion((name,), np.zeros((1, 1, 3)), Recording(rate_hz=30.0)), tmp_path / "a.c3d")


def test_more_events_than_the_format_holds_are_refused(tmp_path):
    events = tuple(Event("step", "left", 0.1 * i) for i in range(256))
    motion = Motion(("a",), np.zeros((1, 1, 3)), Recording(rate_hz=30.0), events=events)
    with pytest.raises(InvalidInput, match=r"at most 255 events, got 256; write \.npz"):
        write_c3d(motion, tmp_path / "a.c3d")


# fmt: off
PLUG_IN_GAIT = [
    "LFHD", "RFHD", "LBHD", "RBHD", "C7", "T10", "CLAV", "STRN", "RBAK", "LSHO", "LUPA",
    "LELB", "LFRM", "LWRA", "LWRB", "LFIN", "RSHO", "RUPA", "RELB", "RFRM", "RWRA", "RWRB",
    "RFIN", "LASI", "RASI", "LPSI", "RPSI", "LTHI", "LKNE", "LTIB", "LANK", "LHEE", "LTOE",
    "RTHI", "RKNE", "RTIB", "RANK", "RHEE", "RTOE",
]
# fmt: on


@pytest.mark.parametrize(
    ("more", "hip", "knee"),
    [
        ([], {"LASI": 0.7, "LPSI": 0.3}, {"LKNE": 1.0}),
        (["LHJC", "RHJC"], {"LHJC": 1.0}, {"LKNE": 1.0}),
        (["LFEP", "LFEO"], {"LFEP": 1.0}, {"LFEO": 1.0}),
        (["LKNM", "RKNM"], {"LASI": 0.7, "LPSI": 0.3}, {"LKNE": 0.5, "LKNM": 0.5}),
    ],
)
def test_joint_centres_of_the_model_count_before_markers(tmp_path, more, hip, knee):
    names = [f"Subject:{name}" for name in [*PLUG_IN_GAIT, *more]]
    points = some_points(4, len(names), seed=2)
    motion = read(put(tmp_path, points, names))
    assert motion.mapping.name == "plug_in_gait"
    for joint, weights in (("lhip", hip), ("lknee", knee)):
        got = {n.removeprefix("Subject:"): w for n, w in motion.mapping.weights[joint].items()}
        assert got == weights
    # A step away from the skin is for markers only.
    assert ("lhip" in motion.mapping.normals) == ("LASI" in hip)
    assert not np.isnan(motion.generic_positions()).any()
    if "lhip" in motion.mapping.normals:
        place = {
            n.removeprefix("Subject:"): motion.positions[:, i] for i, n in enumerate(motion.names)
        }
        away = motion.generic_positions()[:, GENERIC_JOINTS.index("lhip")]
        away = away - (0.7 * place["LASI"] + 0.3 * place["LPSI"])
        length = np.linalg.norm(place["LPSI"] - place["LASI"], axis=1).mean()
        np.testing.assert_allclose(np.linalg.norm(away, axis=1), 0.4 * length)
        np.testing.assert_allclose(
            (away * (place["LPSI"] - place["LASI"])).sum(axis=1), 0, atol=1e-9
        )


def test_a_sacrum_marker_stands_for_the_back_of_the_pelvis(tmp_path):
    names = [n for n in PLUG_IN_GAIT if n not in ("LPSI", "RPSI")] + ["SACR"]
    motion = read(put(tmp_path, some_points(4, len(names)), names))
    assert motion.mapping.weights["root"] == {"LASI": 0.25, "RASI": 0.25, "SACR": 0.5}
    generic = motion.generic_positions()
    assert not np.isnan(generic).all(axis=(0, 2)).any()
    # Hips lie below the plane of the three.
    assert motion.mapping.weights["lhip"] == {"LASI": 0.7, "SACR": 0.3}
    assert motion.mapping.normals["lhip"][:3] == ("LASI", "SACR", "RASI")


def test_two_subjects_in_a_file_are_told(tmp_path):
    groups = {"SUBJECTS": {"NAMES": ["A", "B"], "USED": np.int16(2)}}
    names = [f"{person}:{n}" for person in "AB" for n in PLUG_IN_GAIT]
    motion = read(put(tmp_path, some_points(4, len(names)), names, groups=groups))
    assert "2 subjects in the file" in motion.notes
    # Whose relations are meant cannot be known, unless it is told.
    assert motion.mapping is None
    assert "2 people in one file (A, B): save one file for each" in " ".join(motion.notes)
    told = read(tmp_path / "a.c3d", skeleton="plug_in_gait")
    assert all(name.startswith("A:") for w in told.mapping.weights.values() for name in w)


# ---- header, parameters and the size of the file disagree


WRONG_HEADERS = {
    "no analog values": {"n_analog": 0},
    "channels for samples": {"n_analog": 3},
    "another number": {"n_analog": 7},
    "no points": {"n_points": 0},
    "too many points": {"n_points": 9},
}


@pytest.mark.parametrize("n_frames", [2, 5, 60])
@pytest.mark.parametrize("scale", [-1.0, 0.1])
@pytest.mark.parametrize("machine", [INTEL, DEC, MIPS])
@pytest.mark.parametrize("wrong", WRONG_HEADERS)
def test_the_size_of_the_file_decides_between_header_and_parameters(
    tmp_path, wrong, machine, scale, n_frames
):
    points = np.cumsum(np.random.default_rng(1).normal(0, 2, (n_frames, 3, 3)), axis=0) + 900
    analog = {"ANALOG": {"USED": np.int16(3), "RATE": 400.0}}
    right = {"analog": 12, "groups": analog, "machine": machine, "scale": scale}
    expected = read(put(tmp_path, points.round(1), **right), up="z", unit="mm").positions
    path = put(tmp_path, points.round(1), **right, words=WRONG_HEADERS[wrong])
    motion = read(path, up="z", unit="mm")
    np.testing.assert_array_equal(motion.positions, expected)
    told = any("analog values a frame, the size of the file 12" in note for note in motion.notes)
    assert told == ("points" not in wrong)


@pytest.mark.parametrize("used", [1, 2, 7])
def test_a_wrong_number_of_points_is_overruled_and_told(tmp_path, used):
    points = some_points(40)
    path = put(tmp_path, points, point={"USED": np.int16(used)})
    motion = read(path, up="z", unit="mm")
    np.testing.assert_allclose(motion.positions, upright(points), atol=1e-6)
    assert f"POINT:USED says {used} points, the size of the file 3" in motion.notes


def test_a_file_that_is_cut_off_does_not_fit_by_accident(tmp_path):
    # Without its analog values, frames would end where this file ends.
    points = np.cumsum(np.random.default_rng(1).normal(0, 2, (64, 4, 3)), axis=0) + 900
    path = put(tmp_path, points, "abcd", analog=16)
    content = path.read_bytes()
    path.write_bytes(content[: 1024 + 64 * 64])
    with pytest.raises(UnreadableFile, match="promises 64 frames, the file ends after 32"):
        read(path)


# ---- places that are none, and places that are said to be none


@pytest.mark.parametrize("far", [9999999.0, -9999999.0, 1e8, -3e7])
def test_sentinels_are_not_seen_and_told(tmp_path, far):
    points = some_points(30)
    points[4, 1] = far
    motion = read(put(tmp_path, points), up="z", unit="mm")
    assert (
        np.isnan(motion.positions).all(axis=2).tolist()
        == np.isin(np.arange(90).reshape(30, 3), [13]).tolist()
    )
    assert any(note.startswith("1 place of b is impossibly far away") for note in motion.notes)


def test_points_that_are_marked_unseen_throughout_are_told_and_read_on_request(tmp_path):
    points, residuals = some_points(), np.zeros((5, 3))
    residuals[:, 2], residuals[1, 0] = -1, -1
    path = put(tmp_path, points, residuals=residuals)
    motion = read(path, up="z")
    assert np.isnan(motion.positions[:, 2]).all()
    assert any("1 points are marked unseen throughout" in note for note in motion.notes)
    trusted = read(path, up="z", trust_points=True)
    np.testing.assert_allclose(trusted.positions, upright(points), atol=1e-6)
    residuals[:] = -1
    path = put(tmp_path, points, residuals=residuals)
    with pytest.raises(UnreadableFile, match=r"every point is marked unseen .* --trust-points"):
        read(path)


def test_a_file_of_angles_only_is_named_as_such(tmp_path):
    path = put(tmp_path, some_points(), ["LKneeAngles", "RKneeAngles", "RHipMoment"])
    with pytest.raises(UnreadableFile, match=r"holds angles.*\(LKneeAngles,.*no places"):
        read(path)


def test_an_event_without_its_seconds_is_refused(tmp_path):
    events = {"EVENT": {"LABELS": ["a", "b"], "TIMES": np.arange(3.0), "USED": np.int16(2)}}
    with pytest.raises(UnreadableFile, match="EVENT:TIMES has 3 numbers"):
        read(put(tmp_path, some_points(), groups=events))


def test_a_rate_of_zero_is_that_of_the_header(tmp_path):
    path = put(tmp_path, some_points(), point={"RATE": 0.0})
    assert read(path, up="z").rate_hz == 100


def test_signs_of_qualisys_axes_do_not_count(tmp_path):
    axes = {"point": {"X_SCREEN": ["-X"], "Y_SCREEN": ["-Z"]}}
    maker = {"MANUFACTURER": {"COMPANY": ["Qualisys"]}}
    points = some_points()
    motion = read(put(tmp_path, points, **axes, groups=maker), unit="mm")
    np.testing.assert_allclose(motion.positions, upright(points), atol=1e-6)
    motion = read(put(tmp_path, points, **axes), unit="mm")
    assert (motion.positions[..., 1] * upright(points)[..., 1] < 0).all()


def theia(folder, turns, places, *, n_there=None):
    """A file of rotations only: matrices column after column, each with its reliability."""
    n_frames, n_segments = places.shape[:2]
    matrices = np.zeros((n_frames, n_segments, 4, 4))
    matrices[..., :3, :3], matrices[..., :3, 3], matrices[..., 3, 3] = turns, places, 1
    labels = ["pelvis_4X4", "l_thigh_4X4", "l_shank_4X4"][:n_segments]
    group = {"USED": np.int16(n_segments), "LABELS": labels, "RATE": 100.0, "RATIO": np.int16(1)}
    path = put(
        folder, np.zeros((n_frames, 0, 3)), [], groups={"ROTATION": group}, point={"LABELS": None}
    )
    head = path.read_bytes()
    group["DATA_START"] = np.int16(1 + len(head) // 512)
    put(folder, np.zeros((n_frames, 0, 3)), [], groups={"ROTATION": group}, point={"LABELS": None})
    raw = b"".join(
        m.T.astype("<f4").tobytes() + np.float32(1).tobytes() for m in matrices.reshape(-1, 4, 4)
    )
    path.write_bytes(path.read_bytes() + raw[: n_there and n_there * 68])
    return path


def test_segments_of_rotations_are_read_where_they_begin(tmp_path):
    places = some_points(7)
    motion = read(theia(tmp_path, np.eye(3), places), up="z", unit="mm")
    assert motion.names == ("pelvis", "l_thigh", "l_shank")
    np.testing.assert_allclose(motion.positions, upright(places), atol=1e-6)
    assert any("where 3 segments begin" in note for note in motion.notes)
    with pytest.raises(UnreadableFile, match=r"rotations of 3 segments .* ends before the last"):
        read(theia(tmp_path, np.eye(3), places, n_there=20))
    with pytest.raises(UnreadableFile, match="none of its matrices is a rotation"):
        read(theia(tmp_path, 2 * np.eye(3), places))
