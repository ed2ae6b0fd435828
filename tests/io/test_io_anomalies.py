"""Is what no body does told, and is a body that does nothing wrong left alone?"""

import re
from dataclasses import replace

import numpy as np
import pytest

from motionary import read, write
from motionary.io.normalise.gaps import find_zeros
from motionary.io.normalise.jumps import track_points
from motionary.io.normalise.quality import find_anomalies
from motionary.motion import GENERIC_JOINTS
from motionary.samples import synthetic_motion

FIRST, STOP = 60, 100
KNEE = GENERIC_JOINTS.index("lknee")
WRISTS = [GENERIC_JOINTS.index(joint) for joint in ("lwrist", "rwrist")]


def bare(name="walk", seed=3):
    motion = synthetic_motion(name, seed=seed)
    return replace(motion, skeleton=None, rotations=None)


def constant(places):
    places[:] = places[FIRST]


def frozen(places):
    places[FIRST:STOP] = places[FIRST]


def repeated(places):
    places[FIRST + 45 : STOP + 45] = places[FIRST:STOP]


def one_held(places):
    places[FIRST:STOP, WRISTS[0]] = places[FIRST, WRISTS[0]]


def teleported(places):
    places[FIRST:STOP] += [2.0, 0, 0]


def knee_moved(places):
    places[FIRST:STOP, KNEE] += [0.3, 0, 0]


def wrists_swapped(places):
    places[FIRST:STOP, WRISTS] = places[FIRST:STOP, WRISTS[::-1]]


PLANTED = {
    constant: "the pose is constant",
    frozen: rf"the pose is frozen from .*frames {FIRST}-{STOP - 1}",
    repeated: rf"frames {FIRST + 45}-{STOP + 44}.* repeats exactly .*frame {FIRST}\b",
    one_held: rf"lwrist is held in the same place from .*frames {FIRST}-{STOP - 1}",
    teleported: rf"the body jumps 2\.0. m .*frame {FIRST}\).*frame {STOP}\)",
    knee_moved: rf"lknee jumps 0\.\d+ m away .*frame {FIRST}\)",
    wrists_swapped: rf"lwrist and rwrist exchange places at .*frame {FIRST}\)",
}


@pytest.mark.parametrize("plant", PLANTED, ids=lambda plant: plant.__name__)
@pytest.mark.parametrize("ending", [".npz", ".trc", ".c3d"])
def test_what_no_body_does_is_told_with_its_place(plant, ending, tmp_path):
    motion = bare()
    places = motion.positions.copy()
    plant(places)
    write(replace(motion, positions=places), tmp_path / f"a{ending}")
    notes = read(tmp_path / f"a{ending}").notes
    assert [note for note in notes if re.search(PLANTED[plant], note)], notes


def test_nothing_is_above_the_root_of_a_rig():
    motion = synthetic_motion("walk", seed=3)
    track = track_points(motion, 0)
    above = dict(zip(track.names, track.above, strict=True))
    root = motion.skeleton.names[0]
    assert motion.skeleton.parents[0] == -1
    assert above[root] == -1
    assert track.names[above["lknee"]] == "lhip"


def test_a_limb_that_is_fast_still_has_bones():
    motion = bare("walk")
    places = motion.positions[::4].copy()
    places += np.arange(len(places))[:, None, None] * [0.15, 0, 0]
    places[FIRST // 4 : STOP // 4, KNEE] += [0.3, 0, 0]
    (note,) = find_anomalies(at_rate(motion, places, 30))
    assert re.match(r"lknee jumps 0\.\d+ m away", note)


def test_places_in_steps_of_half_a_millimetre_stand_still():
    motion = bare("squat")
    places = np.round(motion.positions[:1] + np.zeros((120, 1, 1)), 3)
    places[1::2, 3] += 0.0005
    places[50:80, WRISTS[0]] += [0, 0, 0.3]
    assert any("lwrist jumps" in note for note in find_anomalies(at_rate(motion, places, 120)))


def test_a_wrist_is_held_while_its_arm_alone_moves():
    motion = bare("squat")
    places = np.repeat(motion.positions[:1], 120, axis=0)
    arm = [GENERIC_JOINTS.index(joint) for joint in ("lelbow", "lwrist", "lfingers")]
    places[:, arm, 1] += 0.3 * np.sin(np.arange(120) / 15)[:, None]
    assert find_anomalies(at_rate(motion, places, 120)) == []
    places[40:80, arm[1]] = places[40, arm[1]]
    notes = find_anomalies(at_rate(motion, places, 120))
    assert any(note.startswith("lwrist is held") for note in notes), notes


def at_rate(motion, positions, rate_hz):
    recording = replace(motion.recording, rate_hz=rate_hz)
    return replace(motion, positions=positions, recording=recording)


@pytest.mark.parametrize("name", ["kick_left", "walk", "squat"])
@pytest.mark.parametrize("rate", [120, 30])
def test_a_body_that_moves_as_bodies_do_is_left_alone(name, rate):
    motion = bare(name)
    step = 120 // rate
    slower = replace(
        motion,
        positions=motion.positions[::step],
        recording=replace(motion.recording, rate_hz=rate),
    )
    assert find_anomalies(slower) == []
    # Frames shown several times, as in a file of a higher rate than the camera's.
    shown = at_rate(motion, np.repeat(slower.positions, 4, axis=0), 4 * rate)
    assert find_anomalies(shown) == []


def test_a_body_that_waits_before_and_after_its_motion_is_left_alone():
    motion = bare()
    places = motion.positions
    waits = np.concatenate([places[:1].repeat(60, axis=0), places, places[-1:].repeat(60, axis=0)])
    assert find_anomalies(replace(motion, positions=waits)) == []


def test_a_foot_on_the_floor_is_no_held_point():
    motion = bare("walk")
    places = motion.positions.copy()
    feet = [GENERIC_JOINTS.index(joint) for joint in ("rankle", "rtoes")]
    # It goes on from where it stood.
    places[80:, feet] -= places[79, feet] - places[20, feet]
    places[20:80, feet] = places[20, feet]
    notes = find_anomalies(replace(motion, positions=places))
    assert not [note for note in notes if note.startswith(("rtoes", "rankle"))], notes


def test_zeros_are_points_that_were_not_seen(tmp_path):
    motion = bare()
    places = motion.positions + np.array([1.0, 0, 0.5])
    places[10:20] = 0
    places[40:45, KNEE] = 0
    places[:, WRISTS[0]] = 0
    np.save(tmp_path / "a.npy", places)
    found = read(tmp_path / "a.npy", skeleton="generic", rate_hz=120)
    unseen = np.isnan(found.positions).all(axis=2)
    expected = ~places.any(axis=2)
    np.testing.assert_array_equal(unseen, expected)
    assert any("10 frames have all points at zero" in note for note in found.notes)
    assert any("lknee" in note and "lwrist" in note for note in found.notes)


@pytest.mark.parametrize("kind", ["root at the origin", "starts at the origin", "all zero"])
def test_a_point_that_is_at_the_origin_rightly_stays(kind):
    places = bare("walk").positions.copy()
    root = GENERIC_JOINTS.index("root")
    places -= places[:, root : root + 1] if kind == "root at the origin" else places[0, root]
    if kind == "all zero":
        places[:] = 0
    assert (~places.any(axis=2)).any()
    assert not find_zeros(places).any()


def test_a_point_that_is_held_while_little_moves_goes_on_with_a_step():
    motion = bare("squat")
    places = np.round(motion.positions[:1] + np.zeros((120, 1, 1)), 4)
    sways = 0.012 * np.sin(np.arange(120) / 25)[:, None]
    places[:, :, 2] = np.round(places[:, :, 2] + sways, 4)
    assert find_anomalies(at_rate(motion, places, 120)) == []
    places[30:70, WRISTS[0]] = places[30, WRISTS[0]]
    (note,) = find_anomalies(at_rate(motion, places, 120))
    assert re.match(r"lwrist is held in the same place from .* 0\.57 s", note), note


@pytest.mark.parametrize("n_frames", [1, 50])
def test_a_recording_in_which_nothing_is_seen_says_so(n_frames):
    motion = bare().cut(0, n_frames)
    nothing = replace(motion, positions=np.full_like(motion.positions, np.nan))
    assert find_anomalies(nothing) == ["no point is seen in any frame"]
