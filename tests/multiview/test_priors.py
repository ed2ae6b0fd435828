"""Priors of recognised motion: what templates tell, what is lent, and what is refused."""

from itertools import pairwise

import numpy as np
import pytest

import motionary as mo
from cli_cases import run
from motionary.errors import InvalidInput, UnreadableFile
from motionary.motion import Motion
from motionary.multiview import PoseMemory, derive_priors, read_priors, remember_poses, write_priors
from motionary.multiview.allocation import allocate
from motionary.multiview.poses import (
    LENT,
    Track,
    blend,
    find_candidates,
    find_matches,
    keep_essential,
    own_axes,
)
from motionary.multiview.priors import (
    MARKED,
    Claims,
    NamedPrior,
    mark,
    named_priors,
    shape_limb,
)
from motionary.multiview.solving import Pull, SolverSettings
from motionary.recording import Recording
from motionary.skeletons import named_mapping
from oracles import lending
from view_cases import NAMES, walker

RATE_HZ = 60.0


def as_motion(points):
    recording = Recording("walk", rate_hz=RATE_HZ, n_frames=len(points))
    upright = points[..., [1, 2, 0]]
    return Motion(NAMES, upright, recording, mapping=named_mapping("body25", NAMES))


@pytest.fixture(scope="module")
def known():
    """A class of one step of each foot, its poses, and a walk of two that lacks the left leg."""
    whole = as_motion(walker(180))
    examples = {"walk": [whole.cut(first, first + 60) for first in (0, 60)]}
    library = mo.learn(examples, threshold=0.1)
    return library, remember_poses(library, examples), whole


def test_rectangles_of_a_template_are_named(known):
    library = known[0]
    (template, _), names = library["walk"].patterns[0], library.feature_set.names
    found = named_priors(template, names)
    assert {"left foot ahead", "left elbow straight"} <= {prior.name for prior in found}
    for prior in found:
        feature, value = MARKED[prior.name]
        row = names.index(feature)
        marked = prior.columns(len(template.values))
        assert marked.any()
        assert template.fixed[marked, row].all()
        assert (template.values[marked, row] == value).all()


def test_priors_are_edited_as_toml(known, tmp_path):
    library, _, _ = known
    path = tmp_path / "priors.toml"
    write_priors(derive_priors(library), path)
    assert read_priors(path, library) == derive_priors(library)
    path.write_text(
        '[[priors]]\nclass = "walk"\ntemplate = "walk"\nprior = "left elbow bent"\n'
        "columns = [[2, 9]]\n"
    )
    assert read_priors(path, library) == {
        ("walk", "walk"): [NamedPrior("left elbow bent", ((2, 9),))]
    }
    for old, new, message in [
        ("left elbow bent", "left elbow bend", "must be one of left foot rests.*line 4"),
        ('"walk"\nprior', '"run"\nprior', "must be one of the library's"),
        ("[2, 9]", "[9, 2]", "pairs of columns from 0 to"),
        ("priors", "prior", "priors is missing"),
    ]:
        wrong = tmp_path / "wrong.toml"
        wrong.write_text(path.read_text().replace(old, new))
        with pytest.raises(UnreadableFile, match=message):
            read_priors(wrong, library)


def lose_left_leg(motion, frames):
    """A track whose left leg is wrong where no view told it."""
    points, confidence = motion.positions.copy(), np.ones(motion.positions.shape[:2])
    for name in ("LKnee", "LAnkle", "LBigToe"):
        k = NAMES.index(name)
        points[frames, k] += [0.0, 0.3, 0.3]
        confidence[frames, k] = 0.0
    return Motion(NAMES, points, motion.recording, mapping=motion.mapping), confidence


def test_poses_are_lent_to_a_limb_that_no_view_tells(known):
    library, memory, whole = known
    frames = slice(100, 125)
    track, confidence = lose_left_leg(whole, frames)
    pull, priors, lent = allocate(
        track, confidence, library, settings=SolverSettings(), memory=memory
    )
    knee = NAMES.index("LKnee")
    assert any(prior.kept and prior.name.startswith("left leg") for prior in priors)
    off = np.linalg.norm(pull.places[frames, knee] - whole.positions[frames, knee], axis=1)
    assert off.mean() < 0.05
    assert lent[frames, knee].mean() > 0.5
    assert not lent[:, NAMES.index("RKnee")].any()
    assert not pull.matrices[:, NAMES.index("RKnee")].any()


def test_poses_that_do_not_fit_what_is_seen_are_refused(known):
    library, memory, whole = known
    rng = np.random.default_rng(0)
    wrong = PoseMemory({k: v + rng.normal(0, 0.5, v.shape) for k, v in memory.poses.items()})
    track, confidence = lose_left_leg(whole, slice(100, 125))
    _, priors, taken = allocate(track, confidence, library, settings=SolverSettings(), memory=wrong)
    assert not taken.any()
    lent = [prior for prior in priors if "moves as in" in prior.name]
    assert lent
    assert not any(prior.kept for prior in lent)


def test_what_is_marked_must_be_seen_to_hold(known):
    """In this walk arms hang: an elbow that is bent all the time is a wrong prior."""
    library, _, whole = known
    confidence = np.ones(whole.positions.shape[:2])
    confidence[100:115, NAMES.index("LWrist")] = 0.0
    given = {"settings": SolverSettings(), "memory": PoseMemory({})}
    plain = allocate(whole, confidence, library, priors={}, **given)
    assert not plain.priors
    for name, holds in (("left elbow bent", False), ("left elbow straight", True)):
        marks = {("walk", "walk"): [NamedPrior(name, ((0, 30),))]}
        told = allocate(whole, confidence, library, priors=marks, **given)
        assert {prior.kept for prior in told.priors} == {holds}
        assert "seen to hold" in told.priors[0].reason
        assert told.pull.places == pytest.approx(plain.pull.places)
    other = {("walk", "run"): [NamedPrior("left elbow bent", ((0, 30),))]}
    with pytest.raises(InvalidInput, match="not of the library's"):
        allocate(whole, confidence, library, priors=other, **given)


@pytest.mark.parametrize("name", [name for name in MARKED if not name.endswith("rests")])
def test_hidden_points_take_the_shape_of_a_prior(known, name):
    """On random places: each prior holds afterwards, and other points stay."""
    whole = known[2]
    rng = np.random.default_rng(1)
    points = whole.positions[:20]
    confidence = np.zeros(points.shape[:2])
    pull = Pull(
        np.broadcast_to(np.eye(3), (*confidence.shape, 3, 3)).copy(),
        points + rng.normal(0, 0.2, points.shape),
    )
    before = pull.places.copy()
    frame = own_axes({one: points[:, k] for k, one in enumerate(NAMES)})[1]
    assert shape_limb(name, Track(NAMES, points, confidence, RATE_HZ), slice(5, 15), pull, frame)
    changed = np.flatnonzero((pull.places != before).any(axis=(0, 2)))
    assert len(changed) == 1
    assert (pull.places[:5] == before[:5]).all()
    side, after = name[0].upper(), pull.places[5:15]
    if name.endswith("ahead"):
        ahead = frame.to_own(pull.places)[5:15, :, 2]
        if "foot" in name:
            other = "R" if side == "L" else "L"
            assert (ahead[:, changed[0]] >= ahead[:, NAMES.index(f"{other}Ankle")] - 1e-9).all()
        else:
            assert (ahead[1:, changed[0]] > ahead[0, changed[0]]).all()
        return
    root = after[:, NAMES.index(f"{side}{'Shoulder' if 'elbow' in name else 'Hip'}")]
    far = np.linalg.norm(after[:, changed[0]] - root, axis=1)
    a, b = (0.3, 0.26) if "elbow" in name else (0.43, 0.42)
    limit = np.sqrt(a * a + b * b + a * b)
    assert (far >= limit - 0.03).all() if "straight" in name else (far <= limit + 0.03).all()


def test_what_one_frame_or_one_foot_cannot_tell_is_left_out(known):
    library, _, whole = known
    match = find_matches(mo.compute_features(whole, feature_set=library.feature_set), library)[0]
    points = whole.positions[:20]
    frame = own_axes({one: points[:, k] for k, one in enumerate(NAMES)})[1]
    zeros = np.zeros(points.shape[:2])
    pull = Pull(np.ones((*zeros.shape, 3, 3)), points.copy())
    columns = np.full(20, -1)
    columns[5] = 1
    claims = Claims(match, [NamedPrior("left foot rests", ((0, 3),))], columns, 1.0)
    assert mark(claims, Track(NAMES, points, zeros + 1, 10.0), pull, frame, None) == []
    own = [k for k, name in enumerate(NAMES) if name != "RAnkle"]
    names = tuple(NAMES[k] for k in own)
    one_foot = Track(names, points[:, own], zeros[:, own], 60.0)
    pull = Pull(pull.matrices[:, own], pull.places[:, own])
    assert not shape_limb("left foot ahead", one_foot, slice(5, 15), pull, frame)


def test_poses_count_by_how_they_agree_with_the_rest_of_the_body():
    rng = np.random.default_rng(4)
    poses = rng.normal(0, 0.05, (3, 9, len(LENT), 3))
    own = rng.normal(0, 0.05, (12, len(LENT), 3))
    seen = rng.uniform(size=own.shape[:2]) < 0.7
    seen[5] = False
    columns = np.array([-1, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, -1])
    limb = [0, 1, 2]
    offer = find_candidates(poses, columns, own, seen, RATE_HZ)
    expected = lending.blend(
        poses, columns, own, seen, limb, rate_hz=RATE_HZ, beside=6, moved=2, moved_s=0.08,
        agrees=0.04,
    )  # fmt: skip
    assert blend([offer], limb, 12) == pytest.approx(expected, nan_ok=True, abs=1e-12)
    twice = blend([offer, offer], limb, 12)
    assert twice == pytest.approx(expected, nan_ok=True, abs=1e-12)


def test_one_match_for_each_place(known):
    library, _, whole = known
    sequence = mo.compute_features(whole, feature_set=library.feature_set)
    every = find_matches(sequence, library)
    matches = keep_essential(every, len(sequence))
    assert matches[0] is every[0]
    spans = sorted((match.alignment.start, match.alignment.end) for match in matches)
    assert spans
    assert all(b[0] > (a[0] + a[1]) / 2 for a, b in pairwise(spans))


def test_memories_are_kept_and_checked(known, tmp_path):
    library, memory, whole = known
    memory.save(tmp_path / "poses.npz")
    again = PoseMemory.load(tmp_path / "poses.npz")
    assert again.poses.keys() == memory.poses.keys()
    for key, poses in memory.poses.items():
        assert poses.shape[2:] == (len(LENT), 3)
        assert again.poses[key] == pytest.approx(poses, nan_ok=True)
    np.savez(tmp_path / "means.npz", **{"walk\twalk": memory.poses["walk", "walk"][0]})
    assert PoseMemory.load(tmp_path / "means.npz").poses["walk", "walk"].shape[0] == 1
    short = PoseMemory({key: poses[:, :-1] for key, poses in memory.poses.items()})
    confidence = np.ones(whole.positions.shape[:2])
    with pytest.raises(InvalidInput, match="other templates"):
        allocate(whole, confidence, library, settings=SolverSettings(), memory=short)
    (tmp_path / "bad.npz").write_bytes(b"no")
    with pytest.raises(UnreadableFile, match="no memory of poses"):
        PoseMemory.load(tmp_path / "bad.npz")


def test_the_command_writes_priors_and_the_picture_of_a_template_shows_them(
    known, tmp_path, capsys, monkeypatch
):
    folder = tmp_path / "classes"
    known[0].save(folder)
    done = run(capsys, monkeypatch, "library", "priors", folder)
    assert (done.code, "priors written" in done.out) == (0, True)
    assert read_priors(folder / "priors.toml", known[0]) == derive_priors(known[0])
    picture = tmp_path / "walk.svg"
    given = ("walk", "--plot", picture)
    assert run(capsys, monkeypatch, "library", "show", folder, *given).code == 0
    assert "#009e73" in picture.read_text()
