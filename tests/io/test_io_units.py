"""Do bodies without length, of odd size, or in decimetres keep their unit?"""

from dataclasses import replace

import numpy as np
import pytest

from motionary import read, write
from motionary.io.normalise.units import METRES, Length, detect_unit
from motionary.samples import synthetic_motion

LEG = (0.85, "legs")


def bvh_with_positions(motion, path, zeros):
    """A BVH whose joints all have position channels: offsets, or zero."""
    write(motion, path)
    lines = path.read_text().split("\n")
    head, frames = lines[: lines.index("MOTION")], lines[lines.index("MOTION") :]
    columns, place, name = [], 0, ""
    for i, line in enumerate(head):
        words = line.split()
        if words[:1] in (["JOINT"], ["ROOT"]):
            name = words[1]
        elif words[:1] == ["OFFSET"]:
            offset = words[1:]
        elif words[:1] == ["CHANNELS"]:
            if len(words) == 5:
                columns.append((place, ["0", "0", "0"] if name in zeros else offset))
                head[i] = "CHANNELS 6 Xposition Yposition Zposition " + " ".join(words[2:])
            place += len(words) - 2
    rows = []
    for row in filter(None, frames[3:]):
        values = row.split()
        for column, steps in reversed(columns):
            values[column:column] = steps
        rows.append(" ".join(values))
    path.write_text("\n".join([*head, *frames[:3], *rows]))


@pytest.mark.parametrize(
    "zeros",
    [("lknee", "lankle", "ltoes"), ("lknee", "rknee"), ("belly",)],
    ids=["one leg", "thighs", "spine"],
)
def test_position_channels_of_zero_leave_bones_and_unit_alone(zeros, tmp_path):
    motion = synthetic_motion("walk", seed=1)
    bvh_with_positions(motion, tmp_path / "whole.bvh", ())
    bvh_with_positions(motion, tmp_path / "zero.bvh", zeros)
    whole, zero = read(tmp_path / "whole.bvh"), read(tmp_path / "zero.bvh")
    np.testing.assert_allclose(zero.positions, whole.positions, atol=1e-6)
    assert zero.notes[0] == whole.notes[0]
    assert any(
        "without length" in note and f"channels of {zeros[0]}" in note for note in zero.notes
    )
    assert not any("position channels" in note for note in whole.notes)


def test_a_leg_without_length_does_not_tell_the_unit(tmp_path):
    motion = synthetic_motion("walk", seed=1)
    positions = motion.positions.copy()
    index = motion.names.index
    for joint in ("lknee", "lankle", "ltoes"):
        positions[:, index(joint)] = positions[:, index("lhip")]
    bare = replace(motion, positions=positions * 100, skeleton=None, rotations=None)
    np.save(tmp_path / "a.npy", bare.positions)
    made = read(tmp_path / "a.npy", skeleton="generic", rate_hz=120)
    assert made.notes[0].startswith("unit cm, by legs of 0.78 m")


@pytest.mark.parametrize(
    ("units", "unit"),
    [
        (0.85, "m"),
        (8.5, "dm"),
        (6.1, "dm"),
        (85, "cm"),
        (15.06, "1/0.45 inch"),
        (11, "1/0.45 inch"),
    ],
)
def test_decimetres_are_told_from_their_neighbour(units, unit):
    assert detect_unit(Length(units, *LEG)) == unit
    assert METRES["dm"] == 0.1


@pytest.mark.parametrize(
    ("size", "words"), [(0.55, "shorter"), (0.7, ""), (1.0, ""), (1.3, "longer")]
)
def test_legs_of_no_adult_are_doubted(size, words, tmp_path):
    motion = synthetic_motion("walk", seed=1)
    write(replace(motion, positions=motion.positions * size / 0.83, skeleton=None, rotations=None),
          tmp_path / "a.trc")  # fmt: skip
    notes = read(tmp_path / "a.trc").notes
    doubts = [note for note in notes if "adults" in note]
    assert [words in doubt and "--unit" in doubt for doubt in doubts] == ([True] if words else [])
