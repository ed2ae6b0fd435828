"""Files of several recordings: each is one, to folders, commands, indexes and learning."""

import json
import os
import pickle

import numpy as np
import pytest

import motionary as mo
from library_cases import Listening
from motionary.errors import InvalidInput, SeveralRecordings
from motionary.io import ReadOptions, find_recordings, name_recordings, read_all
from motionary.io.formats import file_of, label_takes, split_take
from motionary.retrieval.index import Index
from motionary.samples import synthetic_motion

KINDS = ("squat", "kick_left", "wave_right")


@pytest.fixture(scope="module")
def motions():
    return [synthetic_motion(kind, seed=1, rate_hz=30).cut(0, 30) for kind in KINDS]


def put(folder, motions, name="batch.npz"):
    folder.mkdir(exist_ok=True)
    body = np.stack([motion.generic_positions() for motion in motions])
    if name.endswith(".npz"):
        np.savez(folder / name, positions=body, rate_hz=30.0)
    elif name.endswith(".json"):
        (folder / name).write_text(json.dumps({"fps": 30, "frames": body.tolist()}))
    else:
        content = {f"my {k}" if name.startswith("odd") else k: {"keypoints3d": one[:, :17]}
                   for k, one in zip(KINDS, body, strict=True)}  # fmt: skip
        (folder / name).write_bytes(pickle.dumps(content))
    return folder / name


@pytest.mark.parametrize(
    ("name", "takes"),
    [("batch.npz", ["001", "002", "003"]), ("batch.json", ["001", "002", "003"]),
     ("batch.pkl", list(KINDS)), ("odd.pkl", ["001", "002", "003"])],
)  # fmt: skip
def test_each_recording_has_a_name_that_is_a_path(tmp_path, motions, name, takes):
    path = put(tmp_path / "in", motions, name)
    named = name_recordings(path)
    assert named == {f"{name}#{take}": path.with_name(f"{name}#{take}") for take in takes}
    for i, (called, place) in enumerate(named.items()):
        motion = mo.read(place, sides="named", up="y!", unit=1)
        assert motion.source == called
        expected = motions[i].generic_positions()[:, : len(motion.names)]
        np.testing.assert_allclose(motion.positions, expected, atol=1e-9)
        assert file_of(place) == path
    assert [motion.source for motion in read_all(path, sides="named", up="y!", unit=1)] == list(
        named
    )
    assert name_recordings(path.with_name(f"{name}#2")) == {
        f"{name}#2": path.with_name(f"{name}#2")
    }
    assert find_recordings(path) == [path]
    with pytest.raises(SeveralRecordings, match="holds 3 recordings"):
        mo.read(path)
    with pytest.raises(InvalidInput, match="has no take '9'"):
        mo.read(f"{path}#9")
    with pytest.raises(InvalidInput, match="names a take; leave out take="):
        mo.read(f"{path}#2", take=1)


def test_a_file_that_is_called_so_itself(tmp_path, motions):
    path = put(tmp_path, motions[:1], "a#1.npz")
    assert name_recordings(path) == {"a#1.npz": path}
    mo.write(motions[0], tmp_path / "b.npz")
    (tmp_path / "b.npz").rename(tmp_path / "b.npz#1")
    assert split_take(tmp_path / "b.npz#1") == (tmp_path / "b.npz#1", "")
    assert mo.read(tmp_path / "b.npz#1").n_frames == 30


def test_a_batch_is_loaded_once_and_again_when_it_changed(tmp_path, motions, monkeypatch):
    from motionary.io.formats import arrays

    loads = []
    monkeypatch.setattr(
        arrays, "read_npy", lambda path, r=arrays.read_npy: loads.append(1) or r(path)
    )
    path = tmp_path / "a.npy"
    body = np.stack([motion.generic_positions() for motion in motions])
    given = {"rate_hz": 30, "up": "y!", "unit": 1, "sides": "named"}
    np.save(path, body)
    os.utime(path, ns=(1, 1))
    for motion, one in zip(read_all(path, **given), body, strict=True):
        np.testing.assert_array_equal(motion.positions, one)
    assert len(loads) == 1
    # Reading does not change what is kept.
    np.testing.assert_array_equal(mo.read(f"{path}#1", **given).positions, body[0])
    # Written again and again, within one tick of the clock.
    for shift in range(5):
        np.save(path, body + shift)
        np.testing.assert_array_equal(mo.read(f"{path}#2", **given).positions, body[1] + shift)


def test_names_of_takes():
    assert label_takes(["1", "2"]) == ["001", "002"]
    assert label_takes([str(i + 1) for i in range(1000)])[-1] == "1000"
    assert label_takes(["7", "12"]) == ["7", "12"]
    assert label_takes(["a/b", "c"]) == label_takes(["..", "c.npy"]) == ["001", "002"]


def test_a_batch_is_searched_and_indexed(tmp_path, motions):
    path = put(tmp_path / "in", motions)
    mo.write(motions[0], tmp_path / "in" / "other.npz")
    hits = mo.search(motions[1], tmp_path / "in")
    assert hits[0].recording.name == "batch.npz#002"
    index = Index.open(tmp_path / "in", at=tmp_path / "index")
    names = [f"batch.npz#00{i}" for i in (1, 2, 3)]
    assert list(index.update().new) == [*names, "other.npz"]
    assert index.changes().to_read == []
    again = Index.open(tmp_path / "in", at=tmp_path / "index")
    assert again.changes().to_read == []
    put(tmp_path / "in", motions[:2])
    os.utime(path, ns=(1, 1))
    changes = again.update()
    assert (list(changes.changed), list(changes.gone)) == (names[:2], names[2:])
    assert len(again) == 3
    # As one recording, where one is named.
    one = Index.open(tmp_path / "in", at=tmp_path / "one", reading=ReadOptions(take=2))
    assert list(one.update().new) == ["batch.npz", "other.npz"]
    assert len(one) + len(one.failures) == 2


def test_an_index_that_was_stopped_reads_the_rest(tmp_path, motions):
    put(tmp_path / "in", motions)
    index = Index.open(tmp_path / "in", at=tmp_path / "index")

    def stop(file):
        if file[0].endswith("#002"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        index.update(on_done=stop)
    again = Index.open(tmp_path / "in", at=tmp_path / "index")
    assert "batch.npz#003" in again.changes().to_read
    again.update()
    assert len(again) == 3


def test_a_damaged_batch_is_one_failure(tmp_path, motions):
    path = put(tmp_path / "in", motions)
    path.write_bytes(path.read_bytes()[:-300])
    assert name_recordings(path) == {"batch.npz": path}
    index = Index.open(tmp_path / "in", at=tmp_path / "index")
    index.update()
    assert [failure.item[0] for failure in index.failures] == ["batch.npz"]


def test_examples_in_batches_are_learned(tmp_path, motionary):
    for kind in KINDS[:2]:
        some = [synthetic_motion(kind, seed=i, rate_hz=30).cut(0, 32) for i in range(3)]
        (tmp_path / "in").mkdir(exist_ok=True)
        put(tmp_path / "in" / kind, some)
    library = mo.learn(tmp_path / "in")
    assert set(library.names) == set(KINDS[:2])
    assert [c.prototypes[0].template.n_examples for c in library] == [3, 3]
    heard = Listening()
    library = mo.learn(tmp_path / "in", take=2, monitor=heard)
    assert [c.prototypes[0].template.n_examples for c in library] == [1, 1]
    assert heard.stages["reading"] == (2, 2)
    library.save(tmp_path / "lib")
    page = ("--report", tmp_path / "a.html", "--recordings", tmp_path / "in" / "squat")
    ran = motionary("library", "show", tmp_path / "lib", *page, "--take", 2)
    assert (ran.code, "names a take" in ran.err) == (0, False), ran.err


def test_commands_take_each_recording(tmp_path, motions, motionary):
    path = put(tmp_path / "in", motions)
    ran = motionary("info", path, "--json")
    rows = [json.loads(line) for line in ran.out.splitlines()]
    assert ran.code == 0, ran.err
    assert [row["recording"] for row in rows] == [f"batch.npz#00{i}" for i in (1, 2, 3)]
    assert {row["format"] for row in rows} == {"NPZ"}
    ran = motionary("info", path, "--take", 2, "--json")
    assert [json.loads(line)["recording"] for line in ran.out.splitlines()] == ["batch.npz"]
    ran = motionary("info", f"{path}#3", "--json")
    assert json.loads(ran.out)["recording"] == "batch.npz#3"
    body = np.stack([motion.generic_positions()[:, :22] for motion in motions])
    results = {"motion": np.moveaxis(body, 1, 3), "lengths": np.array([20, 30, 30]), "text": []}
    np.save(tmp_path / "results.npy", results, allow_pickle=True)
    given = ("--up", "y!", "--unit", "1", "--sides", "named")
    ran = motionary("info", tmp_path / "results.npy", "--json", *given)
    rows = [json.loads(line) for line in ran.out.splitlines()]
    assert [(row["recording"], row["frames"]) for row in rows] == [
        ("results.npy#001", 20),
        ("results.npy#002", 30),
        ("results.npy#003", 30),
    ]
    ran = motionary("annotate", path, "-o", tmp_path / "labels.csv", "--json")
    found = [json.loads(line)["recording"] for line in ran.out.splitlines()]
    assert found == [f"batch.npz#00{i}" for i in (1, 2, 3)]
    (tmp_path / "cuts.csv").write_text(
        "recording,label,start_s,end_s\nbatch.npz#002,kick,0.2,0.6\nbatch-003,wave,0.1,0.5\n"
    )
    ran = motionary("cut", tmp_path / "cuts.csv", path, "-o", tmp_path / "clips")
    assert ran.code == 0, ran.err
    clips = sorted(file.name for file in (tmp_path / "clips").iterdir())
    assert [name[:9] for name in clips] == ["batch-002", "batch-003"]
    clip = mo.read(tmp_path / "clips" / clips[0])
    np.testing.assert_allclose(clip.positions, motions[1].generic_positions()[6:18], atol=1e-9)
