"""A person tracked image by image in synthetic views of a walk."""

import numpy as np
import pytest

from motionary.errors import InvalidInput
from motionary.multiview import ViewTracker
from view_cases import NAMES, as_calibrated, detect, exchange, ring, walker

FRAMES, RATE_HZ = 54, 60
LEGS = ("Hip", "Knee", "Ankle", "BigToe", "SmallToe", "Heel")
LOST = slice(32, 48)


@pytest.fixture(scope="module")
def poses():
    """A walk whose legs one camera exchanges, and that no camera sees for a quarter of a second."""
    pixels, scores = detect(walker(FRAMES), ring(3), noise_px=3.0)
    for values in (pixels, scores):
        exchange(values, 1, slice(20, 30), LEGS)
    scores[:, LOST] = 0
    tracker = ViewTracker(as_calibrated(ring(3)), NAMES, rate_hz=RATE_HZ, start_s=0.2)
    told = [tracker.track(pixels[:, k], scores[:, k]) for k in range(FRAMES)]
    assert tracker.names == tuple(name for name in tracker.names if name in NAMES)
    return tracker, told


def test_poses_are_told_after_the_start_and_again_after_a_gap(poses):
    tracker, told = poses
    status = [pose.status for pose in told]
    assert status[:11] == ["starting"] * 11
    assert set(status[11:32]) == {"tracked"}
    assert set(status[LOST]) == {"unsure", "none"}
    assert set(status[49:]) == {"tracked"}
    truth = walker(FRAMES)[:, [NAMES.index(name) for name in tracker.names]][..., [1, 2, 0]]
    for k in (*range(11, 32), *range(49, FRAMES)):
        assert np.linalg.norm(told[k].points - truth[k], axis=1).mean() < 0.03
        assert told[k].confidence.mean() > 0.5


def test_nobody_has_neither_points_nor_confidence(poses):
    last = poses[1][LOST.stop - 1]
    assert np.isnan(last.points).all()
    assert not last.confidence.any()
    assert "two cameras see 0 points" in last.reason


def test_what_does_not_fit_is_told():
    cameras = as_calibrated(ring(2))
    with pytest.raises(InvalidInput, match="two cameras or more"):
        ViewTracker(cameras[:1], NAMES, rate_hz=60)
    with pytest.raises(InvalidInput, match="must be positive"):
        ViewTracker(cameras, NAMES, rate_hz=0)
    tracker = ViewTracker(cameras, NAMES, rate_hz=60)
    with pytest.raises(InvalidInput, match=r"got \(1, 26, 2\) and \(2, 26\)"):
        tracker.track(np.zeros((1, 26, 2)), np.zeros((2, 26)))


def test_a_start_that_does_not_fit_begins_anew():
    pixels, scores = detect(walker(22), ring(3), noise_px=2.0)
    scores[:, :11, NAMES.index("LHip")] = 0
    pixels[0, 20] = np.inf
    tracker = ViewTracker(as_calibrated(ring(3)), NAMES, rate_hz=RATE_HZ, start_s=11 / RATE_HZ)
    told = [tracker.track(pixels[:, k], scores[:, k]) for k in range(10)]
    with pytest.raises(InvalidInput, match="both hips"):
        tracker.track(pixels[:, 10], scores[:, 10])
    told += [tracker.track(pixels[:, k], scores[:, k]) for k in range(11, 22)]
    assert told[10].reason == "1 of 11 images"
    assert told[-1].status == "tracked"
