"""Do gaps stay unless one asks, and are short ones filled as told, counted, and no others?"""

from dataclasses import replace

import numpy as np
import pytest

from motionary import compute_features, read, write
from motionary.errors import InvalidInput
from motionary.io.normalise.gaps import fill_gaps
from motionary.samples import synthetic_motion

RATE_HZ = 100.0


@pytest.fixture
def gappy():
    """A kick with gaps of 10, 20 and 21 frames, and one at the end."""
    motion = synthetic_motion("kick_left", seed=2, rate_hz=RATE_HZ)
    positions = motion.positions.copy()
    wrist, toes = motion.names.index("rwrist"), motion.names.index("ltoes")
    positions[30:40, wrist] = np.nan
    positions[60:80, toes] = np.nan
    positions[100:121, wrist] = np.nan
    positions[-3:, toes] = np.nan
    return motion, replace(motion, positions=positions)


def test_short_gaps_are_filled_on_request_and_counted(gappy, tmp_path):
    whole, motion = gappy
    write(motion, tmp_path / "a.npz")
    kept = read(tmp_path / "a.npz")
    assert np.array_equal(np.isnan(kept.positions), np.isnan(motion.positions))
    filled = read(tmp_path / "a.npz", fill_gaps_s=0.2)
    unseen = np.isnan(filled.positions).any(axis=2)
    wrist, toes = motion.names.index("rwrist"), motion.names.index("ltoes")
    assert unseen.sum() == 21 + 3
    assert unseen[100:121, wrist].all()
    assert unseen[-3:, toes].all()
    note = "2 gaps up to 0.2 s filled (cubic), 30 frames of 2 points; 2 longer or at the ends"
    assert any(note in n for n in filled.notes)
    seen = ~np.isnan(motion.positions)
    np.testing.assert_array_equal(filled.positions[seen], motion.positions[seen])
    # The gap hides a toe in full swing: neither way knows where it turned.
    linear = read(tmp_path / "a.npz", fill_gaps_s=0.2, fill_by="linear")
    truth = whole.positions[60:80, toes]
    cubic, straight = (
        np.linalg.norm(m.positions[60:80, toes] - truth, axis=1).max() for m in (filled, linear)
    )
    assert cubic < straight
    before, after = (compute_features(m).known_features.mean() for m in (kept, filled))
    assert before < after


def test_cubic_is_exact_on_cubics_with_known_ends_and_linear_on_lines():
    t = np.arange(60.0)[:, None]
    line = np.concatenate([t, 2 * t + 1, -t], axis=1)
    parabola = np.concatenate([t**2 / 100, t, t * 0], axis=1)
    motion = synthetic_motion("squat", seed=1, rate_hz=RATE_HZ)
    for track, fill_by, exact in (
        (line, "linear", True),
        (line, "cubic", True),
        (parabola, "linear", False),
    ):
        positions = np.full((60, len(motion.names), 3), 1.0)
        positions[:, 0] = track
        positions[20:30, 0] = np.nan
        gap = replace(motion, positions=positions, rotations=None)
        filled = fill_gaps(gap, longest_s=0.1, fill_by=fill_by).positions[:, 0]
        assert np.allclose(filled, track) == exact
    # Of a parabola, velocities beside the gap are those half the stretch before it.
    cubic = fill_gaps(gap, longest_s=0.1, fill_by="cubic").positions[:, 0]
    straight = fill_gaps(gap, longest_s=0.1, fill_by="linear").positions[:, 0]
    assert np.abs(cubic - parabola).max() < np.abs(straight - parabola).max()


def test_single_frames_between_gaps_are_no_velocity():
    motion = synthetic_motion("squat", seed=1, rate_hz=RATE_HZ)
    positions = motion.positions.copy()
    positions[10:15, 0] = np.nan
    positions[16:20, 0] = np.nan
    filled = fill_gaps(replace(motion, positions=positions), longest_s=0.1)
    assert not np.isnan(filled.positions).any()
    assert np.abs(filled.positions[:, 0] - motion.positions[:, 0]).max() < 0.02


def test_nothing_to_fill_and_wrong_limits_are_told(gappy, tmp_path):
    whole, motion = gappy
    assert fill_gaps(motion, longest_s=0.01).notes[-1].startswith("no gaps up to 0.01 s to fill; 4")
    assert fill_gaps(whole, longest_s=1).notes[-1].endswith("; 0 longer or at the ends are kept")
    write(motion, tmp_path / "a.npz")
    with pytest.raises(InvalidInput, match="above 0, got 0"):
        read(tmp_path / "a.npz", fill_gaps_s=0)
    with pytest.raises(InvalidInput, match="cubic, linear, got 'spline'"):
        read(tmp_path / "a.npz", fill_gaps_s=0.2, fill_by="spline")
