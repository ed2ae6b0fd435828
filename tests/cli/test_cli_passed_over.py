"""What becomes of files in a folder that are no motion of a person: told, passed over."""

import json

import numpy as np
import pytest

from motionary.io import write
from motionary.models.library import learn
from motionary.samples import synthetic_motion
from rig_cases import dog


@pytest.fixture
def folder(tmp_path):
    """A motion, arrays that are none, and a dog."""
    folder = tmp_path / "takes"
    folder.mkdir()
    write(synthetic_motion("squat", seed=1), folder / "squat.npz")
    np.savez(folder / "weights.npz", layer=np.ones((4, 4)))
    np.save(folder / "image.npy", np.ones((4, 4)))
    write(dog(), folder / "dog.npz")
    return folder


def test_a_batch_finishes_and_tells(motionary, folder, tmp_path):
    learn({"squat": [synthetic_motion("squat", seed=i) for i in range(3)]}).save(tmp_path / "lib")
    ran = motionary("annotate", folder, "--library", tmp_path / "lib")
    assert (ran.code, ran.err.count("passed over")) == (0, 3)
    assert "weights.npz: holds no motion; expected poses and trans (AMASS)" in ran.err
    assert "image.npy: holds no motion; expected joint positions" in ran.err
    assert "an animal on four legs" in ran.err
    for command in (("index", folder), ("search", folder, "--like", folder / "squat.npz")):
        ran = motionary(*command)
        assert (ran.code, ran.err.count("passed over")) == (0, 3)


def test_info_lists_them(motionary, folder):
    ran = motionary("info", folder, "--json")
    rows = {row["recording"]: row for row in map(json.loads, ran.out.splitlines())}
    assert ran.code == 0
    assert "holds no motion" in rows["weights.npz"]["error"]
    assert rows["dog.npz"]["skeleton"] is None


def test_a_file_that_was_named_is_a_failure(motionary, folder):
    ran = motionary("info", folder / "weights.npz")
    assert ran.code == 1
    ran = motionary("convert", folder / "weights.npz", "-o", folder / "x.trc")
    assert (ran.code, "passed over" in ran.err) == (1, False)


def test_damage_is_a_failure_wherever_it_is(motionary, folder):
    (folder / "broken.npz").write_bytes(b"PK\x03\x04 nothing")
    assert motionary("info", folder).code == 1
