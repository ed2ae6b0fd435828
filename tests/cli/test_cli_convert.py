"""Does `motionary convert` write what it was given, and say what it could not?"""

import json

import numpy as np
import pytest

from cli_cases import RATE_HZ, write_bvh
from motionary.io import read
from motionary.samples import synthetic_motion


@pytest.fixture
def takes(tmp_path):
    for seed, name in enumerate(("one", "sub/two")):
        path = tmp_path / "takes" / f"{name}.bvh"
        path.parent.mkdir(parents=True, exist_ok=True)
        write_bvh(synthetic_motion("squat", seed=seed, rate_hz=RATE_HZ), path)
    return tmp_path / "takes"


@pytest.mark.parametrize("suffix", [".npz", ".trc", ".c3d", ".bvh", ".bvh.gz"])
def test_a_file_becomes_another(motionary, takes, suffix):
    target = takes.parent / f"x{suffix}"
    ran = motionary("convert", takes / "one.bvh", "-o", target, "--json")
    assert ran.code == 0, ran.err
    row = json.loads(ran.out)
    assert (row["recording"], row["written"]) == ("one.bvh", str(target))
    assert row["not_kept"] == (["rig"] if suffix in (".trc", ".c3d") else [])
    one, other = read(takes / "one.bvh"), read(target)
    assert other.mapping == one.mapping
    np.testing.assert_allclose(other.positions, one.positions, atol=2e-6)


@pytest.mark.parametrize("to", ["npz", ".npz"])
def test_a_folder_keeps_its_names(motionary, takes, to):
    (takes / "broken.bvh").write_text("nonsense")
    (takes / "one.trc").write_text("nonsense")
    ran = motionary("convert", takes, takes / "gone.bvh", "-o", takes.parent / "out", "--to", to)
    assert ran.code == 1
    files = sorted(p.relative_to(takes.parent / "out") for p in (takes.parent / "out").rglob("*.*"))
    assert [path.as_posix() for path in files] == ["one.npz", "sub/two.npz"]
    assert len(ran.err.splitlines()) == 3
    assert all(name in ran.err for name in ("broken.bvh", "one.trc", "gone.bvh"))
    assert "sub/two.bvh" in ran.out


def test_takes_in_two_formats_do_not_overwrite_each_other(motionary, takes):
    assert motionary("convert", takes / "one.bvh", "-o", takes / "one.trc").code == 0
    ran = motionary("convert", takes, "-o", takes.parent / "out", "--to", ".npz", "--json")
    assert ran.code == 0, ran.err
    written = [json.loads(line)["written"].rpartition("/")[2] for line in ran.out.splitlines()]
    assert written == ["one.npz", "one.trc.npz", "two.npz"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("-o", "out"), "--to SUFFIX"),
        (("-o", "x.npz"), "need a folder"),
        (("-o", "out", "--to", "mp4"), "must be one of"),
    ],
)
def test_wrong_use_is_told_before_anything_is_read(motionary, takes, monkeypatch, arguments, words):
    monkeypatch.chdir(takes)
    ran = motionary("convert", "one.bvh", "sub/two.bvh", *arguments)
    assert ran.code == 2
    assert words in " ".join(ran.err.split())
    assert ran.out == ""


@pytest.mark.usefixtures("two_processes")
def test_results_do_not_depend_on_processes(motionary, takes):
    outputs = []
    for jobs in (1, 2):
        folder = takes.parent / f"out{jobs}"
        ran = motionary("convert", takes, "-o", folder, "--to", ".npz", "--jobs", jobs, "--json")
        assert ran.code == 0
        outputs.append([(folder / n).read_bytes() for n in ("one.npz", "sub/two.npz")])
    assert outputs[0] == outputs[1]


def test_an_axis_that_is_told(motionary, takes):
    assert motionary("convert", takes / "one.bvh", "-o", takes / "x.trc").code == 0
    assert motionary("convert", takes / "x.trc", "-o", takes / "y.npz", "--up", "z!").code == 0
    one, other = read(takes / "x.trc"), read(takes / "y.npz", up="y!")
    x, y, z = np.moveaxis(one.positions, -1, 0)
    np.testing.assert_allclose(other.positions, np.stack((x, z, -y), -1))
    ran = motionary("convert", takes / "x.trc", "-o", takes / "y.npz", "--up", "z", "--force")
    assert ran.code == 1
    assert "head is above its feet along y; say which with --up y" in ran.err
    ran = motionary("convert", takes / "x.trc", "-o", takes / "y.npz", "--up", "sideways")
    assert ran.code == 2
    assert "up must be one of" in " ".join(ran.err.split())


def test_a_batch_becomes_a_file_of_each_of_its_recordings(motionary, tmp_path):
    motion = synthetic_motion("squat", seed=1)
    body = motion.generic_positions()
    np.savez(tmp_path / "batch.npz", positions=np.stack([body, body + 1]), rate_hz=motion.rate_hz)
    batch, out, one = tmp_path / "batch.npz", tmp_path / "out", tmp_path / "one.npz"
    run = motionary("convert", batch, "-o", out, "--to", ".npz", "--json")
    assert run.code == 0
    rows = [json.loads(line) for line in run.out.splitlines()]
    assert [row["recording"] for row in rows] == ["batch.npz#001", "batch.npz#002"]
    for row, shift in zip(rows, (0, 1), strict=True):
        written = read(tmp_path / row["written"])
        np.testing.assert_allclose(written.positions, body + shift)
    # One file holds one recording, and what is there stays.
    run = motionary("convert", batch, "-o", one)
    assert run.code == 2
    assert "2 recordings need a folder with --to SUFFIX" in " ".join(run.err.split())
    assert motionary("convert", batch, "-o", one, "--take", "2").code == 0
    run = motionary("convert", batch, "-o", out, "--to", ".npz")
    assert run.code == 1
    assert "exists; say --force" in run.err
