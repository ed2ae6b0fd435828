"""The index of a folder: only what changed is read, and nothing is lost on the way."""

import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from cli_cases import write_bvh
from motionary.errors import InvalidInput, NotAMotion, UnreadableFile, UnwritableFile
from motionary.features import FULL_BODY, FULL_BODY_2006, load_everyday_set
from motionary.io import ReadOptions
from motionary.retrieval.index import CACHE_VARIABLE, Index, collect
from motionary.retrieval.index.shard_files import remove_shard
from motionary.retrieval.search import search
from motionary.samples import synthetic_motion

NAMES = ("b.bvh", "a.bvh", "deep/er/a.bvh", "deep/c.bvh")


def fill(folder, names=NAMES, *, seed=0):
    for i, name in enumerate(names, start=seed):
        write_bvh(synthetic_motion("squat", seed=i, rate_hz=30), folder / name)


@pytest.fixture(scope="module")
def filled(tmp_path_factory):
    folder = tmp_path_factory.mktemp("filled")
    fill(folder)
    return folder


@pytest.fixture
def folder(filled, tmp_path):
    return shutil.copytree(filled, tmp_path / "recordings")


@pytest.fixture
def place(tmp_path):
    return tmp_path / "index"


def update(folder, place, **settings):
    """The index, brought up to date, and the names of what was read for it."""
    read = []
    index = Index.open(folder, at=place, **settings)
    index.update(on_done=lambda file: read.append(file[0]))
    return index, read


def content(collection):
    """Everything that is known of a collection."""
    return [
        (s.recording, s.packed.tobytes(), s.known.tobytes())
        for s in collection.sequences
    ], [(f.item, str(f.error)) for f in collection.failures]  # fmt: skip


def assert_fresh(index, folder, tmp_path):
    """It is what an index made anew is."""
    fresh, _ = update(folder, tmp_path / f"fresh {time.monotonic_ns()}")
    for one in (index, Index.open(folder, at=index.place)):
        assert content(one.collection()) == content(fresh.collection())
    queries = [index.collection(), fresh.collection()]
    for a, b in zip(*(q.parts for q in queries), strict=False):
        assert a.shard.posting_index.n_sequences <= len(index)
        assert b.shard.feature_set is a.shard.feature_set
    assert np.array_equal(queries[0].feature_prior, queries[1].feature_prior)


# -- saved = fresh, appended = rebuilt ----------------------------------------------------


def test_what_is_kept_is_what_was_read(folder, place, tmp_path):
    index, read = update(folder, place)
    assert read == sorted(NAMES)
    assert len(index) == len(NAMES)
    assert index.n_frames == index.collection().n_frames
    assert index.n_bytes > 18 * index.n_frames
    everyday = collect(folder, feature_set=load_everyday_set())
    assert content(index.collection())[0] == content(everyday)[0]
    assert_fresh(index, folder, tmp_path)


def test_nothing_is_read_or_written_twice(folder, place):
    update(folder, place)
    before = {path: path.stat().st_mtime_ns for path in place.rglob("*")}
    index, read = update(folder, place)
    assert read == []
    assert len(index) == len(NAMES)
    assert {path: path.stat().st_mtime_ns for path in place.rglob("*")} == before


def test_a_new_file_is_read_alone(folder, place, tmp_path):
    update(folder, place)
    fill(folder, ["aa.bvh"], seed=9)
    index, read = update(folder, place)
    assert read == ["aa.bvh"]
    assert_fresh(index, folder, tmp_path)


def test_a_changed_file_is_read_alone(folder, place, tmp_path):
    update(folder, place)
    fill(folder, ["deep/c.bvh"], seed=9)
    changes = Index.open(folder, at=place).changes()
    assert (changes.new, changes.changed, changes.gone) == ((), ("deep/c.bvh",), ())
    index, read = update(folder, place)
    assert read == ["deep/c.bvh"]
    assert_fresh(index, folder, tmp_path)


def test_a_file_that_is_gone_is_forgotten(folder, place, tmp_path):
    update(folder, place)
    (folder / "a.bvh").unlink()
    index, read = update(folder, place)
    assert read == []
    assert "a.bvh" not in [s.source for s in index.collection().sequences]
    assert_fresh(index, folder, tmp_path)


def test_all_may_be_gone(folder, place):
    update(folder, place)
    for name in NAMES:
        (folder / name).unlink()
    index, _ = update(folder, place)
    assert (len(index), len(index.collection())) == (0, 0)
    assert [path.name for path in place.iterdir()] == ["index.json"]


def test_many_small_additions_are_joined(folder, place, tmp_path):
    update(folder, place)
    for i in range(10):
        fill(folder, [f"more/{i}.bvh"], seed=20 + i)
        index, read = update(folder, place)
        assert read == [f"more/{i}.bvh"]
    shards = [path for path in place.iterdir() if path.is_dir()]
    assert len(shards) <= 8
    assert_fresh(index, folder, tmp_path)


@pytest.mark.usefixtures("two_processes")
def test_several_processes_give_the_same(folder, place, tmp_path):
    index = Index.open(folder, at=place)
    index.update(jobs=2)
    assert_fresh(index, folder, tmp_path)


def test_a_search_of_an_index_is_that_of_its_recordings(folder, place):
    update(folder, place)
    fill(folder, ["aa.bvh"], seed=9)
    index, _ = update(folder, place)
    assert len(index.collection().parts) == 2
    example = collect(folder / "b.bvh").sequences[0].part(5, 35)
    found, expected = search(example, index), search(example, folder)
    assert list(found) == list(expected)
    assert len(found) >= 5


# -- what cannot be read ------------------------------------------------------------------


def test_failures_are_told_and_not_tried_again(folder, place):
    (folder / "deep" / "broken.bvh").write_text("HIERARCHY\nnonsense")
    index, read = update(folder, place)
    assert "deep/broken.bvh" in read
    (failure,) = index.failures
    assert failure.item == ("deep/broken.bvh", folder / "deep/broken.bvh")
    assert str(failure.error).startswith("broken.bvh: no line MOTION")
    index, read = update(folder, place)
    assert read == []
    assert [f.item for f in index.failures] == [failure.item]
    assert index.collection().failures[0].item == failure.item


def test_an_index_keeps_the_kind_of_a_failure(folder, place):
    np.save(folder / "image.npy", np.ones((4, 4)))
    update(folder, place)
    (failure,) = Index.open(folder, at=place).failures
    assert type(failure.error) is NotAMotion
    # An index that was written before kinds were kept: the file is tried again.
    manifest = json.loads((place / "index.json").read_text())
    edit(place, failures={name: told[:-1] for name, told in manifest["failures"].items()})
    index, read = update(folder, place)
    assert read == ["image.npy"]
    assert type(index.failures[0].error) is NotAMotion


def test_a_failure_is_tried_again_when_the_file_has_changed(folder, place, tmp_path):
    (folder / "broken.bvh").write_text("HIERARCHY")
    update(folder, place)
    fill(folder, ["broken.bvh"])
    index, read = update(folder, place)
    assert read == ["broken.bvh"]
    assert index.failures == ()
    assert_fresh(index, folder, tmp_path)


def test_a_recording_that_broke_is_a_failure_and_no_longer_found(folder, place):
    update(folder, place)
    (folder / "a.bvh").write_text("HIERARCHY")
    index, read = update(folder, place)
    assert read == ["a.bvh"]
    assert [f.item[0] for f in index.failures] == ["a.bvh"]
    assert len(index) == len(NAMES) - 1


def test_paths_are_not_written(folder, place):
    (folder / "broken.bvh").write_text("HIERARCHY")
    update(folder, place, reading=ReadOptions(asf=str(folder / "person.asf")))
    assert str(folder) not in (place / "index.json").read_text("utf-8")
    assert "person.asf" in (place / "index.json").read_text("utf-8")


# -- skeletons beside motions -------------------------------------------------------------


@pytest.fixture
def acclaim(data, tmp_path):
    """Motions of two people, and their skeletons."""
    folder = tmp_path / "acclaim"
    folder.mkdir()
    clips = data / "hdm05" / "squat1Reps"
    for clip, name in (("bd_squat1Reps_001", "take_1"), ("bd_squat1Reps_002", "take_2"),
                       ("bk_squat1Reps_013", "other_1")):  # fmt: skip
        (folder / f"{name}.amc").write_bytes((clips / f"HDM_{clip}_120.amc").read_bytes())
    for actor, name in (("bd", "take"), ("bk", "other")):
        (folder / f"{name}.asf").write_bytes((data / "hdm05" / f"HDM_{actor}.asf").read_bytes())
    return folder


def test_a_changed_skeleton_changes_its_motions_alone(acclaim, place):
    index, read = update(acclaim, place)
    assert read == ["other_1.amc", "take_1.amc", "take_2.amc"]
    assert index.failures == ()
    os.utime(acclaim / "take.asf", ns=(1, 1))
    assert update(acclaim, place)[1] == ["take_1.amc", "take_2.amc"]
    assert update(acclaim, place)[1] == []


def test_a_nearer_skeleton_is_noticed(acclaim, place):
    update(acclaim, place)
    (acclaim / "nobody.asf").write_bytes((acclaim / "take.asf").read_bytes())
    assert update(acclaim, place)[1] == []
    (acclaim / "take_2.asf").write_bytes((acclaim / "take.asf").read_bytes())
    assert update(acclaim, place)[1] == ["take_2.amc"]


def test_a_motion_without_skeleton_is_tried_again_when_there_is_one(acclaim, place):
    skeleton = (acclaim / "other.asf").read_bytes()
    (acclaim / "other.asf").unlink()
    # A skeleton that is alone in its folder is anybody's.
    (acclaim / "nobody.asf").write_bytes(skeleton)
    index, _ = update(acclaim, place)
    assert [f.item[0] for f in index.failures] == ["other_1.amc"]
    assert update(acclaim, place)[1] == []
    (acclaim / "other.asf").write_bytes(skeleton)
    index, read = update(acclaim, place)
    assert read == ["other_1.amc"]
    assert index.failures == ()


# -- interrupted = fresh ------------------------------------------------------------------


@pytest.mark.parametrize("after", [1, 2, 4])
def test_what_was_read_before_an_interruption_is_kept(folder, place, tmp_path, after):
    read = []

    def stop(file):
        if len(read) == after - 1:
            raise KeyboardInterrupt
        read.append(file[0])

    index = Index.open(folder, at=place)
    with pytest.raises(KeyboardInterrupt):
        index.update(on_done=stop)
    ready = [s.source for s in index.collection().sequences]
    assert index.count_ready(NAMES) == len(ready)
    assert ready == read == sorted(NAMES)[: after - 1]
    assert [s.source for s in Index.open(folder, at=place).collection().sequences] == ready
    index, rest = update(folder, place)
    assert rest == sorted(NAMES)[after - 1 :]
    assert_fresh(index, folder, tmp_path)


def test_an_interrupted_change_leaves_no_old_words(folder, place, tmp_path):
    update(folder, place)
    fill(folder, ["a.bvh", "b.bvh"], seed=9)

    def stop(file):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        Index.open(folder, at=place).update(on_done=stop)
    left = [s.source for s in Index.open(folder, at=place).collection().sequences]
    assert left == ["deep/c.bvh", "deep/er/a.bvh"]
    index, read = update(folder, place)
    assert read == ["a.bvh", "b.bvh"]
    assert_fresh(index, folder, tmp_path)


@pytest.mark.skipif(os.name != "posix", reason="signals as terminals send them")
def test_a_stopped_command_leaves_what_is_ready(tmp_path, place):
    folder = tmp_path / "recordings"
    fill(folder, ["0.bvh"])
    for i in range(1, 130):
        (folder / f"{i}.bvh").write_bytes((folder / "0.bvh").read_bytes())
    command = [sys.executable, "-m", "motionary", "index", str(folder), "--index", str(place)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        # Its first portion is kept: it is in the middle of reading.
        while process.poll() is None and not list(place.glob("[!.]*/words.array")):
            time.sleep(0.005)
        process.send_signal(signal.SIGINT)
        output, errors = process.communicate(timeout=60)
    assert process.returncode == 130, errors
    index = Index.open(folder, at=place)
    assert 64 <= len(index) < 130
    assert f"; read {len(index)}, 0 gone" in output.decode()
    assert f"stopped: {len(index)} of 130 recordings are ready" in errors.decode()
    index, read = update(folder, place)
    assert len(read) < 130
    assert_fresh(index, folder, tmp_path)


def test_leftovers_are_removed_when_they_are_old(folder, place):
    index, _ = update(folder, place)
    (place / ".unfinished-young").mkdir()
    (place / ".unfinished-old").mkdir()
    (place / "orphan__").mkdir()
    for name in (".unfinished-old", "orphan__"):
        os.utime(place / name, (1, 1))
    index, _ = update(folder, place)
    left = {path.name for path in place.iterdir() if path.is_dir()}
    assert ".unfinished-young" in left
    assert not left & {".unfinished-old", "orphan__"}
    assert len(index) == len(NAMES)


@pytest.mark.parametrize("name", ["..", ".", "", "../recordings", "abcdefgh/x", "UPPER_CA"])
def test_shards_of_other_names_are_refused_and_nothing_is_removed(folder, place, name):
    update(folder, place)
    edit(place, shards=[name])
    before = sorted(path for path in folder.parent.rglob("*"))
    with pytest.raises(UnreadableFile, match="a name that no index gives"):
        Index.open(folder, at=place)
    for other in ("..", ".", "", "../recordings"):
        remove_shard(place, other)
    assert sorted(path for path in folder.parent.rglob("*")) == before


def test_folders_that_hold_other_files_stay(folder, place):
    index, _ = update(folder, place)
    (shard,) = (path for path in place.iterdir() if path.is_dir())
    (shard / "mine.txt").write_text("mine")
    os.utime(shard, (1, 1))
    fill(folder, ["a.bvh", "b.bvh"], seed=9)
    index.update()
    assert (shard / "mine.txt").read_text() == "mine"


# -- where it lies, and what it is made with ----------------------------------------------


def test_the_cache_has_an_index_for_each_way_of_reading(folder, tmp_path, monkeypatch):
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "cache"))
    indexes = [
        Index.open(folder),
        Index.open(folder, feature_set=FULL_BODY_2006),
        Index.open(folder, reading=ReadOptions(unit="cm")),
        Index.open(folder / "deep"),
    ]
    assert len({index.place for index in indexes}) == len(indexes)
    monkeypatch.chdir(folder.parent)
    assert Index.open("recordings").place == indexes[0].place
    for index in indexes[:2]:
        index.update()
        assert index.place.is_relative_to(tmp_path / "cache")
    assert len(Index.open(folder)) == len(NAMES)
    assert Index.open(folder, feature_set=FULL_BODY_2006).collection().feature_set.name == (
        FULL_BODY_2006.name
    )


def test_an_index_of_other_features_is_refused(folder, place):
    update(folder, place)
    with pytest.raises(InvalidInput, match=r"index of 'everyday-448' .* asked for is"):
        Index.open(folder, at=place, feature_set=FULL_BODY_2006)


def test_an_index_of_the_published_features_stays_one(folder, place):
    update(folder, place, feature_set=FULL_BODY)
    index, read = update(folder, place)
    assert (index.feature_set, read) == (FULL_BODY, [])
    hits = search(synthetic_motion("squat", seed=1, rate_hz=30), index)
    assert {hit.recording.name for hit in hits} == set(NAMES)
    assert all(hit.comparison is None for hit in hits)


def test_an_index_read_otherwise_is_refused(folder, place):
    update(folder, place)
    with pytest.raises(InvalidInput, match="read with unit not given, now cm"):
        Index.open(folder, at=place, reading=ReadOptions(unit="cm"))


def edit(place, **values):
    path = place / "index.json"
    content = json.loads(path.read_text("utf-8")) | values
    # An index of the first versions has none, and is read.
    content.pop("checksum", None)
    path.write_text(json.dumps(content))


def test_a_newer_index_is_refused(folder, place):
    update(folder, place)
    edit(place, version=99)
    with pytest.raises(UnreadableFile, match=r"newer motionary \(version 99.*update motionary"):
        Index.open(folder, at=place)


def test_another_version_reads_everything_again(folder, place, tmp_path):
    update(folder, place)
    (folder / "a.bvh").unlink()
    edit(place, written_by="0.0.1")
    index, read = update(folder, place)
    assert read == sorted(set(NAMES) - {"a.bvh"})
    assert_fresh(index, folder, tmp_path)


HARMS = {
    "no JSON": lambda place: (place / "index.json").write_text("{"),
    "no index": lambda place: (place / "index.json").write_text("[]"),
    "a missing key": lambda place: edit(place, shards=None),
    "a shard elsewhere": lambda place: edit(place, shards=["../index"]),
    "a failure of another form": lambda place: edit(place, failures={"a": [1]}),
    "the parent": lambda place: edit(place, shards=[".."]),
    "the index itself": lambda place: edit(place, shards=[""]),
    "a shard of another name": lambda place: edit(place, shards=["nothing"]),
}
# Harm to a part, whose recordings are read again.
PARTIAL_HARMS = {
    "half a file": lambda place: halve(next(place.glob("*/words.array"))),
    "a missing file": lambda place: next(place.glob("*/table.array")).unlink(),
    "no checksums": lambda place: next(place.glob("*/checksums.json")).write_text("{}"),
    "a missing shard": lambda place: edit(place, shards=["nothing_"]),
    "a folder that is none": lambda place: replace_by_photos(next(place.glob("*/"))),
    "a changed manifest": lambda place: flip(place / "index.json", b'"written_by": "', 15),
    **{
        f"a bit of {name}": lambda place, name=name: flip(next(place.glob(f"*/{name}")), b"", -9)
        for name in ("names.json", "table.array", "words.array", "masks.array", "planes.array")
    },
}


def flip(path, after, place):
    """Change one bit, so many bytes after where some bytes stand, or before the end."""
    content = bytearray(path.read_bytes())
    content[content.index(after) + place if after else place] ^= 1
    path.write_bytes(content)


def replace_by_photos(shard):
    for file in shard.iterdir():
        file.rename(shard / f"{file.name}.jpg")


def halve(path):
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


@pytest.mark.parametrize("harm", HARMS)
def test_a_damaged_index_is_refused_where_it_is_named(folder, place, harm):
    update(folder, place)
    HARMS[harm](place)
    with pytest.raises(UnreadableFile, match="index"):
        Index.open(folder, at=place)


@pytest.mark.parametrize(
    ("harm", "is_named"), [*((harm, True) for harm in PARTIAL_HARMS), ("half a file", False)]
)
def test_what_is_damaged_is_read_again_and_told(
    folder, place, tmp_path, monkeypatch, harm, is_named
):
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "cache"))
    at = place if is_named else None
    index, _ = update(folder, at)
    PARTIAL_HARMS[harm](index.place)
    damaged = Index.open(folder, at=at)
    assert len(damaged.damage) == 1
    assert "read again" in damaged.damage[0]
    index, read = update(folder, at)
    assert read == sorted(NAMES)
    assert_fresh(index, folder, tmp_path)
    assert Index.open(folder, at=at).damage == ()


def test_a_shard_without_checksums_is_read(folder, place):
    update(folder, place)
    for path in place.glob("*/checksums.json"):
        path.unlink()
    assert len(Index.open(folder, at=place)) == len(NAMES)


@pytest.mark.parametrize("shard", ["..", "", ".", "photos", "photos__", "link____", "/tmp"])
def test_a_crafted_index_deletes_nothing(folder, place, tmp_path, shard):
    update(folder, place)
    outside = tmp_path / "outside"
    shutil.copytree(next(place.glob("*/")), outside)
    (place / "link____").symlink_to(outside)
    for name in ("photos", "photos__"):
        (place / name).mkdir()
        (place / name / "precious.jpg").touch()
    (place.parent / "precious.txt").touch()
    edit(place, shards=[shard])
    before = sorted(place.parent.rglob("*"))
    with contextlib.suppress(UnreadableFile):
        update(folder, place)
    assert set(before) - {place / "index.json"} <= set(place.parent.rglob("*"))


def test_leftovers_of_killed_runs_are_removed_and_foreign_folders_stay(folder, place):
    place.mkdir()
    old = time.time() - 7200
    (place / ".index-abcd1234.json").write_text("{")
    (place / ".unfinished-abcd1234").mkdir()
    (place / ".unfinished-abcd1234" / "words.array").touch()
    (place / "abcd1234").mkdir()
    update(folder, place)
    for name in ("photos", "photos__"):
        (place / name).mkdir()
        (place / name / "precious.jpg").touch()
    (place / "empty").mkdir()
    for path in place.iterdir():
        os.utime(path, (old, old))
    # Young ones may belong to a process that is at work.
    (place / ".index-young_12.json").touch()
    update(folder, place)
    names = {path.name for path in place.iterdir()}
    assert {"photos", "photos__", "empty", ".index-young_12.json"} <= names
    assert not {".index-abcd1234.json", ".unfinished-abcd1234", "abcd1234"} & names
    assert len(Index.open(folder, at=place)) == len(NAMES)


@pytest.mark.parametrize("harm", [*HARMS, "newer"])
def test_a_damaged_index_in_the_cache_is_made_anew(folder, tmp_path, monkeypatch, harm):
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "cache"))
    index, _ = update(folder, None)
    if harm == "newer":
        edit(index.place, version=99)
    else:
        HARMS[harm](index.place)
    index, read = update(folder, None)
    assert read == sorted(NAMES)
    assert len(Index.open(folder)) == len(index) == len(NAMES)


def test_other_peoples_files_are_not_written_among(folder, place):
    place.mkdir()
    (place / "thesis.tex").write_text("")
    with pytest.raises(UnwritableFile, match=r"holds files but no index \(thesis.tex"):
        update(folder, place)
    assert [path.name for path in place.iterdir()] == ["thesis.tex"]


def test_an_index_may_lie_among_the_recordings(folder, tmp_path):
    index, _ = update(folder, folder / "words")
    assert len(index) == len(NAMES)
    assert update(folder, folder / "words")[1] == []
    assert len(collect(folder)) == len(NAMES)


def test_a_missing_folder_is_told(tmp_path, place):
    with pytest.raises(UnreadableFile, match="no such file or folder"):
        update(tmp_path / "none", place)
    (tmp_path / "file.bvh").touch()
    with pytest.raises(UnreadableFile, match="cannot be searched: Not a directory"):
        update(tmp_path / "file.bvh", place)


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write all")
def test_a_folder_of_recordings_may_be_read_only(folder, place):
    folder.chmod(0o555)
    try:
        assert len(update(folder, place)[0]) == len(NAMES)
    finally:
        folder.chmod(0o755)


def test_a_place_that_cannot_be_written_is_told(folder, tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(UnwritableFile, match="cannot be written"):
        update(folder, tmp_path / "file" / "index")
