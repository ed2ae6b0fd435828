"""`motionary duplicates`: what people and programs get to see."""

import json
from dataclasses import replace

import pytest

from cli_cases import write_bvh
from motionary.recording import Recording
from motionary.samples import synthetic_stream


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    """A take, its copy at half the rate from the second second on, and something else."""
    folder = tmp_path_factory.mktemp("world")
    motion = synthetic_stream(("squat", "kick_left", "wave_right"), seed=1, rate_hz=60)[0]
    half = replace(
        motion,
        positions=motion.positions[60::2],
        rotations=motion.rotations[60::2],
        recording=Recording(rate_hz=30.0),
    )
    other = synthetic_stream(("bow", "jumping_jack"), seed=2, rate_hz=60)[0]
    write_bvh(motion, folder / "a" / "take.bvh")
    write_bvh(other, folder / "a" / "other.bvh")
    write_bvh(half, folder / "b" / "take.bvh")
    return folder


def test_copies_are_told(motionary, world):
    ran = motionary("duplicates", world, "--json")
    (found,) = [json.loads(line) for line in ran.out.splitlines()]
    assert (ran.code, ran.err) == (0, "")
    assert set(found) == {
        "recording", "start_s", "end_s", "other_recording", "other_start_s", "other_end_s",
        "mirrored", "bits", "agreement",
    }  # fmt: skip
    assert (found["recording"], found["other_recording"]) == ("a/take.bvh", "b/take.bvh")
    assert found["start_s"] - found["other_start_s"] == pytest.approx(1, abs=0.05)
    assert found["bits"] > 100
    assert not found["mirrored"]


def test_copies_as_a_table(motionary, world):
    ran = motionary("duplicates", world)
    header, row, *_ = ran.out.splitlines()
    assert header.split() == ["bits", "agreement", "recording", "start_s", "end_s", "other",
                              "start_s", "end_s"]  # fmt: skip
    assert "a/take.bvh" in row
    assert "b/take.bvh" in row


def test_two_folders_are_compared_with_each_other(motionary, world):
    ran = motionary("duplicates", world / "a", world / "b", "--json")
    (found,) = [json.loads(line) for line in ran.out.splitlines()]
    # Files of one name, each from its own folder.
    assert (found["recording"], found["other_recording"]) == ("take.bvh", "take.bvh")
    assert found["start_s"] - found["other_start_s"] == pytest.approx(1, abs=0.05)


def test_none_is_told(motionary, world):
    ran = motionary("duplicates", world / "a")
    assert ran.code == 1
    assert ran.out.startswith("no motion is in two of these recordings\n")
    assert motionary("duplicates", world, "--bits", 1e6).code == 1


def test_what_cannot_be_read_is_told(motionary, world, tmp_path):
    (tmp_path / "broken.bvh").write_text("HIERARCHY")
    ran = motionary("duplicates", world / "a", tmp_path)
    assert ran.code == 1
    assert "broken.bvh: no line MOTION found" in ran.err
    ran = motionary("duplicates", tmp_path / "none")
    assert ran.code == 1
    assert "no such file or folder" in ran.err
