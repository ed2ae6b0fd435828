"""An index over several sources: folders, lists of files, and URLs."""

import builtins
import json
import logging

import pytest

from cli_cases import write_bvh
from motionary.errors import InvalidInput, UnreadableFile
from motionary.retrieval.index import Index
from motionary.retrieval.index.sources import Source, fetch, find_sources
from motionary.samples import synthetic_motion

fsspec = pytest.importorskip("fsspec")


@pytest.fixture(scope="module")
def short(tmp_path_factory):
    """The text of a short recording."""
    path = tmp_path_factory.mktemp("short") / "a.bvh"
    write_bvh(synthetic_motion("squat", seed=1, rate_hz=30).cut(0, 12), path)
    return path.read_bytes()


@pytest.fixture
def folders(short, tmp_path):
    for name in ("one/takes/a.bvh", "one/takes/deep/b.bvh", "two/takes/a.bvh", "three/c.bvh"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(short)
    return tmp_path


@pytest.fixture
def bucket(short):
    files = fsspec.filesystem("memory")
    files.store.clear()
    for name in ("a.bvh", "deep/b.bvh", ".hidden/d.bvh"):
        files.pipe(f"/bucket/{name}", short)
    files.pipe("/bucket/broken.bvh", b"HIERARCHY")
    yield files
    files.store.clear()


@pytest.fixture(scope="module")
def s3():
    """Address of a server that answers as S3 does, on this computer."""
    server_of = pytest.importorskip("moto.server").ThreadedMotoServer
    logging.getLogger("werkzeug").setLevel(logging.ERROR)
    server = server_of(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    with pytest.MonkeyPatch.context() as patch:
        for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
            patch.setenv(name, "none")
        patch.setenv("AWS_DEFAULT_REGION", "us-east-1")
        patch.setenv("AWS_ENDPOINT_URL", f"http://{host}:{port}")
        yield f"http://{host}:{port}"
    server.stop()


@pytest.fixture
def elsewhere(s3, short):
    """Another computer's access to a bucket with two recordings."""
    pytest.importorskip("s3fs")
    files = fsspec.filesystem("s3", skip_instance_cache=True)
    files.mkdir("takes")
    for name in ("a.bvh", "deep/b.bvh"):
        files.pipe(f"takes/{name}", short)
    yield files
    files.rm("takes", recursive=True)


def names(index):
    return sorted(sequence.source for sequence in index.collection().sequences)


def test_labels_keep_the_names_of_several_folders_apart(folders, tmp_path):
    index = Index.open([folders / "one/takes", folders / "two/takes"], at=tmp_path / "index")
    index.update()
    expected = ["one/takes/a.bvh", "one/takes/deep/b.bvh", "two/takes/a.bvh"]
    assert names(index) == expected
    assert [index.address(name) for name in expected] == [str(tmp_path / n) for n in expected]
    assert not index.changes().to_read
    (folders / "two/takes/a.bvh").unlink()
    assert index.changes().gone == ("two/takes/a.bvh",)


def test_no_label_begins_another():
    urls = ["memory://x/p", "memory://y/p/a", "memory://z/a"]
    assert [source.label for source in find_sources(urls)] == ["x/p", "p/a", "z/a"]
    assert [source.label for source in find_sources(["m://p/a/b", "m://q/a"])] == ["b", "a"]


def test_what_lies_in_another_source_counts_once(folders):
    given = [str(folders / "one"), str(folders / "one/takes"), str(folders / "one/takes/a.bvh")]
    assert find_sources(given) == (Source(given[0]),)


def test_a_list_names_files_folders_and_comments(folders, tmp_path):
    listed = tmp_path / "list.txt"
    listed.write_text("# chosen\none/takes/a.bvh\n\nthree\none/takes/gone.bvh\n")
    index = Index.open([f"@{listed}"], at=tmp_path / "index")
    index.update()
    assert names(index) == ["takes/a.bvh", "three/c.bvh"]
    (failure,) = index.failures
    assert failure.item[0] == "takes/gone.bvh"
    assert "no such file" in str(failure.error)
    listed.write_text("#\n")
    with pytest.raises(InvalidInput, match="is the list empty"):
        Index.open(f"@{listed}", at=tmp_path / "index")


def test_a_list_in_a_list_is_a_folder_of_that_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "list.txt").write_text("@list.txt\n")
    assert find_sources("@list.txt") == (Source("@list.txt"),)


def test_a_bucket_is_indexed_as_the_same_files_here(bucket, short, folders, tmp_path):
    index = Index.open("memory://bucket", at=tmp_path / "index")
    done = []
    index.update(on_done=lambda file: done.append(file[0]))
    assert done == ["a.bvh", "broken.bvh", "deep/b.bvh"]
    assert names(index) == ["a.bvh", "deep/b.bvh"]
    assert [failure.item[0] for failure in index.failures] == ["broken.bvh"]
    here = Index.open(folders / "one/takes", at=tmp_path / "here")
    here.update()
    pairs = zip(index.collection().sequences, here.collection().sequences, strict=True)
    assert all(a.packed.tobytes() == b.packed.tobytes() for a, b in pairs)
    again = Index.open("memory://bucket", at=tmp_path / "index")
    assert not again.changes().to_read
    bucket.pipe("/bucket/broken.bvh", short)
    bucket.rm("/bucket/a.bvh")
    changes = again.changes()
    assert (changes.changed, changes.gone) == (("broken.bvh",), ("a.bvh",))
    again.update(changes)
    assert not again.failures


def test_a_file_that_leaves_a_bucket_meanwhile_is_a_failure(bucket, tmp_path):
    index = Index.open(["memory://bucket/a.bvh", "memory://bucket/b.bvh"], at=tmp_path / "index")
    changes = index.changes()
    bucket.rm("/bucket/a.bvh")
    index.update(changes)
    assert [str(failure.error) for failure in index.failures] == [
        "a.bvh: cannot be fetched: there is no such place",
        "b.bvh: cannot be fetched: there is no such place",
    ]


def test_a_skeleton_beside_an_acclaim_motion_is_fetched(bucket, tmp_path):
    bucket.pipe({"/bucket/s.asf": b"bones", "/bucket/s_1.amc": b"frames"})
    (source,) = find_sources("memory://bucket")
    before = source.scan(on_skip=print)
    assert fetch(source.address("s_1.amc"), tmp_path / "f").read_bytes() == b"frames"
    assert (tmp_path / "f/s.asf").read_bytes() == b"bones"
    bucket.pipe("/bucket/s.asf", b"other bones")
    after = source.scan(on_skip=print)
    assert [name for name in after if after[name] != before[name]] == ["s_1.amc"]


@pytest.mark.parametrize(
    ("url", "error", "told"),
    [
        ("memory://none", UnreadableFile, "memory://none: cannot be searched: there is no such"),
        ("nope://bucket", InvalidInput, "expected a URL that fsspec knows"),
    ],
)
def test_a_url_that_leads_nowhere_is_told(url, error, told, bucket, tmp_path):
    with pytest.raises(error, match=told):
        Index.open(url, at=tmp_path / "index").changes()


def test_a_bucket_that_may_not_be_read_is_told(bucket, tmp_path, monkeypatch):
    def refuse(*_, **__):
        raise PermissionError(13, "Access Denied")

    monkeypatch.setattr(type(bucket), "ls", refuse)
    with pytest.raises(UnreadableFile, match="cannot be searched: Access Denied; check"):
        Index.open("memory://bucket", at=tmp_path / "index").changes()


@pytest.mark.parametrize(
    ("missing", "told"),
    [("fsspec", r"pip install 'motionary\[cloud\]'"), ("s3fs", "s3:// needs another package")],
)
def test_a_package_that_is_missing_is_told(missing, told, tmp_path, monkeypatch):
    import_real = builtins.__import__

    def refuse(name, *args, **rest):
        if name.partition(".")[0] == missing:
            raise ImportError(f"No module named {name}")
        return import_real(name, *args, **rest)

    monkeypatch.setattr(builtins, "__import__", refuse)
    with pytest.raises(InvalidInput, match=told):
        Index.open("s3://bucket", at=tmp_path / "index").changes()


def test_a_bucket_of_s3_is_read_and_its_changes_are_seen(elsewhere, short, tmp_path):
    index = Index.open("s3://takes", at=tmp_path / "index")
    index.update()
    assert names(index) == ["a.bvh", "deep/b.bvh"]
    assert not index.failures
    assert not index.changes().to_read
    (chosen,) = find_sources(["s3://takes/a.bvh"])
    before = chosen.scan(on_skip=print)
    elsewhere.pipe("takes/c.bvh", short)
    elsewhere.pipe("takes/a.bvh", short + b"\n")
    elsewhere.rm("takes/deep/b.bvh")
    changes = index.changes()
    assert (changes.new, changes.changed, changes.gone) == (
        ("c.bvh",),
        ("a.bvh",),
        ("deep/b.bvh",),
    )
    assert chosen.scan(on_skip=print)["a.bvh"] != before["a.bvh"]


def test_a_bucket_of_s3_that_may_not_be_read_is_told(s3, elsewhere, motionary, tmp_path):
    requests = pytest.importorskip("requests")
    ran = motionary("index", "s3://none", "--index", tmp_path / "none")
    assert ran.code == 1
    assert "s3://none: cannot be searched: there is no such place" in ran.err
    # From now on requests need rights, which nobody has.
    requests.post(f"{s3}/moto-api/reset-auth", data=b"0", timeout=10)
    try:
        ran = motionary("index", "s3://takes", "--index", tmp_path / "index")
    finally:
        requests.post(f"{s3}/moto-api/reset-auth", data=b"inf", timeout=10)
    assert ran.code == 1
    assert "s3://takes: cannot be searched: " in ran.err
    assert "check the address and your rights" in ran.err


def test_commands_take_sources(motionary, bucket, folders, tmp_path):
    place = tmp_path / "index"
    sources = (folders / "one", folders / "three/c.bvh", "memory://bucket/deep")
    ran = motionary("index", *sources, "--index", place, "--json")
    assert (ran.code, json.loads(ran.out)["recordings"]) == (0, 4)
    ran = motionary("search", *sources, "--index", place, "--query", "right hand fast", "--json")
    assert ran.code in (0, 1), ran.err
    assert "reading" not in ran.err
    ran = motionary("search", "memory://bucket", "--no-index", "--query", "right hand fast")
    assert ran.code == 2
