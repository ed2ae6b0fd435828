"""Priors of recognised motion: what templates tell, what is lent, and what is refused."""

from itertools import pairwise

import numpy as np
import pytest

import motionary as mo
from motionary.errors import InvalidInput, UnreadableFile
from motionary.motion import Motion
from motionary.multiview import PoseMemory, remember_poses
from motionary.multiview.allocation import allocate
from motionary.multiview.priors import LENT, find_matches, named_priors
from motionary.multiview.solving import SolverSettings
from motionary.recording import Recording
from motionary.skeletons import named_mapping
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


def test_a_foot_that_is_slow_in_a_template_rests():
    library = mo.learn({"walk": [as_motion(walker(60)), as_motion(walker(60))]})
    template, pattern = library["walk"].patterns[0]
    assert pattern is not None
    names = library.feature_set.names
    found = {prior.name: prior.columns for prior in named_priors(template, names)}
    for side in ("left", "right"):
        column = names.index(f"{side} foot fast")
        slow = template.fixed[:, column] & ~template.values[:, column]
        columns = found.get(f"{side} foot rests", np.zeros(len(slow), dtype=bool))
        assert not (columns & ~slow).any()


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
    pull, priors = allocate(track, confidence, library, settings=SolverSettings(), memory=memory)
    knee = NAMES.index("LKnee")
    assert any(prior.kept and prior.name.startswith("left leg") for prior in priors)
    off = np.linalg.norm(pull.places[frames, knee] - whole.positions[frames, knee], axis=1)
    assert off.mean() < 0.05
    assert not pull.matrices[:, NAMES.index("RKnee")].any()


def test_poses_that_do_not_fit_what_is_seen_are_refused(known):
    library, memory, whole = known
    rng = np.random.default_rng(0)
    wrong = PoseMemory({k: v + rng.normal(0, 0.5, v.shape) for k, v in memory.poses.items()})
    track, confidence = lose_left_leg(whole, slice(100, 125))
    _, priors = allocate(track, confidence, library, settings=SolverSettings(), memory=wrong)
    lent = [prior for prior in priors if "moves as in" in prior.name]
    assert lent
    assert not any(prior.kept for prior in lent)


def test_one_match_for_each_place(known):
    library, _, whole = known
    matches = find_matches(mo.compute_features(whole, feature_set=library.feature_set), library)
    spans = sorted((match.alignment.start, match.alignment.end) for match in matches)
    assert spans
    assert all(b[0] > (a[0] + a[1]) / 2 for a, b in pairwise(spans))


def test_memories_are_kept_and_checked(known, tmp_path):
    library, memory, whole = known
    memory.save(tmp_path / "poses.npz")
    again = PoseMemory.load(tmp_path / "poses.npz")
    assert again.poses.keys() == memory.poses.keys()
    for key, poses in memory.poses.items():
        assert poses.shape[1:] == (len(LENT), 3)
        assert again.poses[key] == pytest.approx(poses, nan_ok=True)
    short = PoseMemory({key: poses[:-1] for key, poses in memory.poses.items()})
    confidence = np.ones(whole.positions.shape[:2])
    with pytest.raises(InvalidInput, match="other templates"):
        allocate(whole, confidence, library, settings=SolverSettings(), memory=short)
    (tmp_path / "bad.npz").write_bytes(b"no")
    with pytest.raises(UnreadableFile, match="no memory of poses"):
        PoseMemory.load(tmp_path / "bad.npz")
