"""What the body tells of axes, unit, sides and place, and what contradicts it."""

import itertools

import numpy as np
import pytest

from motionary.errors import InvalidInput
from motionary.features import FULL_BODY, compute_features
from motionary.io import read, write
from motionary.io.normalise.axes import UPS, find_stance, turn_back
from motionary.io.normalise.quality import count_rest_frames, is_in_place
from motionary.io.normalise.sides import exchange_names, mirror
from motionary.motion import GENERIC_JOINTS, Motion
from motionary.recording import Recording
from motionary.samples import synthetic_motion

SAMPLE = "cmu/07_04.amc"


@pytest.fixture(scope="module")
def walk():
    return synthetic_motion("walk", seed=3)


def save(path, motion, *, positions=None, names=None):
    """An array as others write it."""
    places = motion.positions if positions is None else positions
    np.savez(path, positions=places, names=np.array(names or motion.names), fps=motion.rate_hz)
    return path


@pytest.mark.parametrize("up", UPS)
def test_each_axis_may_be_up(tmp_path, walk, up):
    path = save(tmp_path / "a.npz", walk, positions=turn_back(walk.positions, up))
    motion = read(path)
    assert motion.notes[1].startswith(f"{up} up, by the body")
    np.testing.assert_allclose(motion.positions, walk.positions, atol=1e-12)
    told = read(path, up=up)
    np.testing.assert_array_equal(told.positions, motion.positions)


@pytest.mark.parametrize("up", UPS)
def test_a_rig_turns_with_its_joints(tmp_path, data, up):
    """A BVH file with another axis up is, once read, what it was: the rig is written again."""
    first = tmp_path / "y.bvh"
    write(read(data / SAMPLE), first)
    original = read(first)
    told = read(first, up=f"{up}!")
    again = tmp_path / "again.bvh"
    write(told, again)
    np.testing.assert_allclose(read(again, up="y!").positions, told.positions, atol=2e-4)
    if up != "y":
        with pytest.raises(InvalidInput, match=r"head is above its feet along y.*--up y"):
            read(first, up=up)
    np.testing.assert_array_equal(
        compute_features(read(again)).packed, compute_features(original).packed
    )


def test_acclaim_motions_are_looked_at_too(data):
    path = data / SAMPLE
    assert "y up, by the body" in read(path).notes
    with pytest.raises(InvalidInput, match=r"z points up as given.*along y"):
        read(path, up="z")
    with pytest.raises(InvalidInput, match=r"unit m as given makes legs of .* m"):
        read(path, unit="m")
    inches = read(path, unit=0.0254 / 0.45)
    np.testing.assert_allclose(inches.positions, read(path).positions, atol=1e-12)


@pytest.mark.parametrize(
    ("metres", "note"),
    [
        (1.0, "unit m, by legs"),
        (0.01, "unit cm, by legs"),
        (0.0254, "unit inch, by legs"),
        (0.003, "unit 0.00"),
    ],
)
def test_units_are_told_by_the_legs(tmp_path, walk, metres, note):
    path = save(tmp_path / "a.npz", walk, positions=walk.positions / metres)
    motion = read(path)
    assert motion.notes[0].startswith(note)
    np.testing.assert_array_equal(compute_features(motion).packed, compute_features(walk).packed)
    np.testing.assert_allclose(read(path, unit=metres).positions, walk.positions)


def test_a_unit_that_makes_giants_is_refused_unless_it_is_meant(tmp_path, walk):
    path = save(tmp_path / "a.npz", walk, positions=walk.positions * 1000)
    with pytest.raises(InvalidInput, match=r"unit m as given.*by the body it is mm.*number: 1"):
        read(path, unit="m")
    for unit in (1, "1.0", "m!"):
        np.testing.assert_allclose(read(path, unit=unit).positions, walk.positions * 1000)


def swapped_names():
    return [{"l": "r", "r": "l"}[n[0]] + n[1:] if paired(n) else n for n in GENERIC_JOINTS]


def paired(name):
    return {"l" + name[1:], "r" + name[1:]} <= set(GENERIC_JOINTS)


def test_exchanged_sides_are_an_error_and_can_be_put_right(tmp_path, walk):
    wrong = save(tmp_path / "a.npz", walk, names=swapped_names())
    with pytest.raises(InvalidInput, match=r"backward.*--sides swapped or --sides mirrored"):
        read(wrong)
    right = read(wrong, sides="swapped")
    assert right.names == walk.names
    np.testing.assert_array_equal(compute_features(right).packed, compute_features(walk).packed)
    assert "left and right named, as given" in read(wrong, sides="named").notes


def test_left_handed_axes_are_an_error_and_can_be_put_right(tmp_path, walk):
    positions = walk.positions * (1, 1, -1)
    wrong = save(tmp_path / "a.npz", walk, positions=positions)
    with pytest.raises(InvalidInput, match="left-handed"):
        read(wrong)
    right = read(wrong, sides="mirrored")
    np.testing.assert_array_equal(compute_features(right).packed, compute_features(walk).packed)


def test_a_person_in_the_mirror_is_a_person(tmp_path, walk):
    path = save(
        tmp_path / "a.npz", walk, positions=walk.positions * (-1, 1, 1), names=swapped_names()
    )
    mirrored = exchange_names(mirror(walk))
    np.testing.assert_array_equal(
        compute_features(read(path)).packed, compute_features(mirrored).packed
    )


def test_rigs_are_put_right_with_all_they_have(tmp_path, data):
    motion = read(data / SAMPLE)
    for change, told in ((mirror, "mirrored"), (exchange_names, "swapped")):
        path = tmp_path / f"{told}.npz"
        write(change(motion), path)
        with pytest.raises(InvalidInput, match="sides"):
            read(path)
        right = read(path, sides=told)
        assert right.names == right.skeleton.names == motion.names
        np.testing.assert_allclose(right.rotations, motion.rotations, atol=1e-12)
        np.testing.assert_allclose(right.positions, motion.positions, atol=1e-12)


def test_arms_alone_exchanged_are_an_error(tmp_path, walk):
    arms = ("shoulder", "elbow", "wrist", "fingers", "clavicle")
    names = [new if old[1:] in arms else old
             for old, new in zip(GENERIC_JOINTS, swapped_names(), strict=True)]  # fmt: skip
    with pytest.raises(InvalidInput, match="shoulders face the other way than the hips"):
        read(save(tmp_path / "a.npz", walk, names=names))


def test_points_that_are_no_body_are_not_judged(tmp_path):
    rng = np.random.default_rng(0)
    nothing = Motion(GENERIC_JOINTS, rng.uniform(-1, 1, (30, 24, 3)), Recording(rate_hz=30.0))
    motion = read(save(tmp_path / "a.npz", nothing))
    assert "left and right as named; the body does not tell" in motion.notes


def test_names_of_points_that_are_not_mapped_are_not_exchanged(tmp_path, walk):
    names = [f"p{i}" for i in range(len(walk.names))]
    path = save(tmp_path / "a.npz", walk, names=names)
    assert not any("left and right" in note for note in read(path, sides="swapped").notes)
    mirrored = read(path, sides="mirrored")
    assert "left and right mirrored, as given" in mirrored.notes
    np.testing.assert_allclose(mirrored.positions, walk.positions * (-1, 1, 1))


def test_a_walk_on_the_spot_has_no_known_speeds(tmp_path, walk):
    still = walk.positions - walk.positions[:, :1] * (1, 0, 1)
    motion = read(save(tmp_path / "a.npz", walk, positions=still))
    assert motion.in_place
    assert any(note.startswith("kept in place") for note in motion.notes)
    known = compute_features(motion).known_features.any(axis=0)
    lost = {id_ for id_, there in zip(FULL_BODY.ids, known, strict=True) if not there}
    assert lost == {"F13", "F14", "F25", "F26", "F39"}
    assert not read(save(tmp_path / "b.npz", walk)).in_place


def test_feet_that_turn_about_toes_or_ankle_do_not_slide(data):
    motion = read(data / "hdm05" / "squat1Reps" / "HDM_bd_squat1Reps_006_120.amc")
    starts = range(0, motion.n_frames - 60, 6)
    assert not any(is_in_place(motion.cut(first, first + 60)) for first in starts)


def test_without_feet_nothing_is_known_of_the_lowest_joint(walk):
    feet = [GENERIC_JOINTS.index(s + j) for s, j in itertools.product("lr", ("ankle", "toes"))]
    positions = walk.positions.copy()
    positions[:, feet] = np.nan
    known = compute_features(positions, rate_hz=walk.rate_hz).known_features.any(axis=0)
    unknown = {id_ for id_, there in zip(FULL_BODY.ids, known, strict=True) if not there}
    assert {"F17", "F18", "F33", "F34", "F37"} <= unknown


@pytest.mark.parametrize("n_rest", [0, 1, 5])
def test_frames_of_rest_are_counted(walk, n_rest):
    rest = np.repeat(walk.positions[:1] * (3.0, 1.0, 1.0), n_rest, axis=0)
    positions = np.concatenate([rest, walk.positions])
    assert count_rest_frames(positions, walk.rate_hz) == n_rest


def test_who_lies_still_may_as_well_stand(tmp_path, data):
    motion = read(data / "hdm05" / "lieDownFloor" / "HDM_bd_lieDownFloor_001_120.amc")
    lying = motion.cut(motion.n_frames - 60, motion.n_frames)
    write(lying, tmp_path / "a.bvh")
    with pytest.raises(InvalidInput, match=r"stands along z, or lies still where y points up"):
        read(tmp_path / "a.bvh")
    told = read(tmp_path / "a.bvh", up="y")
    np.testing.assert_allclose(told.positions[:, 0], lying.positions[:, 0], atol=1e-5)
    # In our own file there is no doubt, even where a moving body seems to stand.
    path = data / "hdm05" / "lieDownFloor" / "HDM_dg_lieDownFloor_011_120.amc"
    moving = read(path).cut(139, 259)
    write(moving, tmp_path / "a.npz")
    np.testing.assert_array_equal(read(tmp_path / "a.npz").positions, moving.positions)
    # The whole recording tells.
    write(motion, tmp_path / "b.bvh")
    assert "y up, by the body" in read(tmp_path / "b.bvh").notes


def test_who_is_not_seen_has_no_stance():
    assert find_stance(np.full((5, 24, 3), np.nan)) is None


def test_sides_are_one_of_three(tmp_path, walk):
    with pytest.raises(InvalidInput, match="sides must be one of named, swapped, mirrored"):
        read(save(tmp_path / "a.npz", walk), sides="both")
