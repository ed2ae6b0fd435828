"""Work by the workers of a cluster: the same results, and what goes wrong is told."""

import json
import os
import subprocess
import sys
import warnings
from pathlib import Path

import pytest

from cli_cases import write_bvh
from motionary.batch import Cluster, Failure, map_ordered
from motionary.errors import Unreachable
from motionary.features import compute_features, files
from motionary.io import ReadOptions, read, save_skeleton
from motionary.models.keyframes import parse_queries
from motionary.models.library import learn
from motionary.retrieval import duplicates
from motionary.retrieval.index import Index, building, collect, collection
from motionary.retrieval.search import search
from motionary.samples import synthetic_motion, synthetic_stream

distributed = pytest.importorskip("distributed")
pytestmark = pytest.mark.slow

measure = files._measure
KILLS = """
import json, sys, tempfile
from pathlib import Path
from evidence.cluster_kills import kill_each
with tempfile.TemporaryDirectory() as folder:
    print(json.dumps(kill_each(Path(folder), 12)))
"""


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory):
    """Address of a scheduler with two workers, threads that are spoken to as processes are."""
    with warnings.catch_warnings():
        # What a library leaves open is no defect of ours.
        warnings.simplefilter("ignore")
        with distributed.LocalCluster(
            n_workers=2,
            threads_per_worker=1,
            processes=False,
            protocol="tcp://",
            dashboard_address=None,
            local_directory=str(tmp_path_factory.mktemp("workers")),
        ) as cluster:
            yield cluster.scheduler_address


@pytest.fixture(scope="module")
def cluster(scheduler):
    with Cluster(scheduler) as connected:
        yield connected


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """More recordings than one portion holds, one of them broken."""
    monkeypatch.setattr(building, "_FILES", 2)
    folder = tmp_path / "recordings"
    for name in ("a.bvh", "b.bvh", "c.bvh"):
        motion = synthetic_motion("squat", seed=ord(name[0]), rate_hz=30)
        write_bvh(motion.cut(0, 40), folder / name)
    (folder / "d.bvh").write_text("HIERARCHY")
    return folder


def files_of(place):
    return {path.relative_to(place): path.read_bytes() for path in place.glob("**/*.*")}


def test_an_index_is_the_same_to_the_byte_whoever_makes_it(folder, cluster, tmp_path):
    made = {}
    for jobs in (1, cluster):
        done = []
        index = Index.open(folder, at=tmp_path / str(len(made)))
        index.update(jobs=jobs, on_done=lambda file, done=done: done.append(file[0]))
        made[jobs] = files_of(index.place), done
        assert [failure.item[0] for failure in index.failures] == ["d.bvh"]
    assert made[1] == made[cluster]
    assert len(made[1][1]) == 4
    assert len(index.collection().parts) == 2
    example = compute_features(read(folder / "a.bvh"), feature_set=index.feature_set).part(5, 30)
    for query, more in (
        (example, {}),
        (example, {"preselect": True}),
        (parse_queries("right knee bent"), {}),
    ):
        here, there = (search(query, index, jobs=jobs, **more) for jobs in (1, cluster))
        assert hits_of(here) == hits_of(there)
        assert {hit.recording.name for hit in here} >= {"a.bvh", "c.bvh"}


def test_a_folder_may_be_named_from_where_one_is(cluster, tmp_path, monkeypatch):
    write_bvh(synthetic_motion("squat", seed=1, rate_hz=30).cut(0, 12), tmp_path / "here" / "a.bvh")
    monkeypatch.chdir(tmp_path)
    index = Index.open("here", at="index")
    index.update(jobs=cluster)
    assert (index.failures, len(index)) == ((), 1)


def test_paths_hold_for_workers_in_other_folders(cluster, tmp_path, monkeypatch):
    motion = synthetic_motion("squat", seed=1, rate_hz=30).cut(0, 12)
    write_bvh(motion, tmp_path / "here" / "a.bvh")
    save_skeleton(motion, tmp_path / "rig.toml")
    (tmp_path / "away").mkdir()
    monkeypatch.chdir(tmp_path)
    reading = ReadOptions(skeleton="rig.toml")
    (expected,) = collect("here", reading=reading).sequences
    # Workers are threads of this process: its folder is theirs.
    monkeypatch.setattr(files, "_measure", measure_elsewhere)
    found = collect("here", reading=reading, jobs=cluster)
    assert Path.cwd() == tmp_path / "away"
    assert not found.failures
    assert found.sequences[0].packed.tobytes() == expected.packed.tobytes()


def measure_elsewhere(files, **how):
    os.chdir(files[0][1].parents[1] / "away")
    return measure(files, **how)


def hits_of(result):
    return [(hit, hit.evidence.alignment.path.tolist()) for hit in result]


def halve(number):
    if number % 2:
        raise ValueError("odd")
    return number // 2


def test_items_that_fail_are_failures_among_others(cluster):
    results = list(map_ordered(halve, [0, 1, 2], jobs=cluster))
    assert (results[0], results[2]) == (0, 1)
    assert isinstance(results[1], Failure)
    assert "ValueError: odd" in str(results[1].error)


@pytest.mark.skipif(os.name != "posix", reason="processes are forks")
def test_an_index_is_the_same_after_client_scheduler_and_worker_were_killed():
    root = Path(__file__).parents[1]
    done = subprocess.run(
        [sys.executable, "-c", KILLS], cwd=root, capture_output=True, encoding="utf-8", check=True
    )
    assert json.loads(done.stdout) == []


def test_a_scheduler_that_does_not_answer_is_told():
    with pytest.raises(Unreachable, match=r"no scheduler answers at tcp://127\.0\.0\.1:1 within"):
        Cluster("tcp://127.0.0.1:1", timeout_s=0.2)


def test_a_worker_of_another_version_is_told(scheduler, monkeypatch):
    # A worker that is a thread of this process has what is here.
    monkeypatch.setattr("motionary.batch.pkgutil.resolve_name", other_version)
    with pytest.raises(Unreachable, match=r"has version 0\.0\.0, here is .*; install the same"):
        Cluster(scheduler)


def other_version(_):
    return "0.0.0"


def test_labels_and_counts_are_the_same_whoever_makes_them(
    folder, scheduler, motionary, monkeypatch, tmp_path
):
    monkeypatch.setattr(collection, "_PORTION_FRAMES", 50)
    write_bvh(synthetic_motion("squat", seed=97, rate_hz=30), folder / "whole.bvh")
    monkeypatch.chdir(folder)
    made = {name: [synthetic_motion(name, seed=1, rate_hz=30)] for name in ("squat", "bow")}
    learn(made).save(tmp_path / "library")
    kept = ("--index", tmp_path / "index")
    for command, *given in (
        ("annotate", "whole.bvh", "d.bvh"),
        ("count", "whole.bvh", "d.bvh"),
        ("annotate", ".", *kept, "--explain"),
        ("count", ".", *kept),
    ):
        given = (command, *given, "--library", tmp_path / "library", "--json")
        there, here = motionary(*given, "--scheduler", scheduler), motionary(*given)
        assert (there.code, there.out) == (here.code, here.out) == (1, here.out)
        assert '"recording": "whole.bvh"' in there.out


def test_duplicates_are_the_same_whoever_compares(scheduler, motionary, monkeypatch, tmp_path):
    monkeypatch.setattr(duplicates, "_PORTION", 1)
    take = synthetic_stream(("squat", "kick_left", "wave_right"), seed=1, rate_hz=30)[0]
    write_bvh(take, tmp_path / "takes" / "a.bvh")
    write_bvh(take.cut(30, take.n_frames), tmp_path / "takes" / "b.bvh")
    write_bvh(take.cut(0, take.n_frames - 20), tmp_path / "takes" / "c.bvh")
    monkeypatch.chdir(tmp_path)
    command = ("duplicates", "takes", "--index", "index", "--json")
    there, here = motionary(*command, "--scheduler", scheduler), motionary(*command)
    assert (there.code, there.out) == (here.code, here.out) == (0, here.out)
    assert len(here.out.splitlines()) == 3
