"""Only regular files are opened; results are written whole or not at all."""

import os
import stat
import sys
import threading
from pathlib import Path

import pytest

from motionary.errors import NotAFile, UnreadableFile, UnwritableFile
from motionary.files import open_regular, read_bytes, write_atomically

needs_pipes = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
needs_rights = pytest.mark.skipif(os.name != "posix", reason="rights as POSIX has them")


def begin_to_write(path, text, error):
    with write_atomically(path) as beside:
        beside.write_text(text)
        raise error


def test_a_file_is_written_whole(tmp_path):
    path = tmp_path / "new" / "résult one.csv"
    with write_atomically(path) as beside:
        assert (beside.suffix, beside.parent) == (".csv", path.parent)
        assert not path.exists()
        beside.write_text("all")
    assert path.read_text() == "all"
    assert [p.name for p in path.parent.iterdir()] == [path.name]


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, MemoryError])
def test_after_an_exception_the_old_file_stands_and_nothing_else(tmp_path, error):
    path = tmp_path / "labels.csv"
    path.write_text("old")
    with pytest.raises(error):
        begin_to_write(path, "ne", error())
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_failed_first_write_leaves_nothing(tmp_path):
    full = OSError(28, "No space left on device")
    with pytest.raises(UnwritableFile, match=r"a\.npz: cannot be written: No space"):
        begin_to_write(tmp_path / "a.npz", "ne", full)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("place", ["file/a.csv", "folder"])
def test_places_that_cannot_be_written(tmp_path, place):
    (tmp_path / "file").touch()
    (tmp_path / "folder").mkdir()
    with pytest.raises(UnwritableFile, match=r"cannot be written.*choose a folder"):
        begin_to_write(tmp_path / place, "ne", AssertionError("there is nothing to write to"))


@pytest.mark.skipif(
    os.name != "posix" or os.geteuid() == 0, reason="this user may write to every folder"
)
def test_a_read_only_folder(tmp_path):
    tmp_path.chmod(0o555)
    try:
        with pytest.raises(UnwritableFile, match="cannot be written"):
            begin_to_write(tmp_path / "a.csv", "ne", AssertionError("there is nothing to write to"))
    finally:
        tmp_path.chmod(0o755)


@pytest.mark.skipif(os.name != "posix", reason="rights of files are POSIX's here")
def test_results_have_the_rights_of_any_new_file(tmp_path):
    with write_atomically(tmp_path / "a.csv") as beside:
        beside.write_text("x")
    Path(tmp_path / "b.csv").write_text("x")
    rights = [stat.S_IMODE((tmp_path / name).stat().st_mode) for name in ("a.csv", "b.csv")]
    assert rights[0] == rights[1]


def test_a_regular_file_is_read(tmp_path):
    (tmp_path / "a").write_bytes(b"some")
    (tmp_path / "link").symlink_to("a")
    assert read_bytes(tmp_path / "a") == read_bytes(str(tmp_path / "link")) == b"some"


@needs_pipes
def test_a_named_pipe_is_refused_at_once(tmp_path):
    os.mkfifo(tmp_path / "pipe.bvh")
    with pytest.raises(NotAFile, match=r"pipe\.bvh: is no regular file but a named pipe"):
        read_bytes(tmp_path / "pipe.bvh")


@needs_pipes
def test_what_became_a_pipe_since_it_was_looked_at_is_refused(tmp_path, monkeypatch):
    os.mkfifo(tmp_path / "pipe.bvh")
    (tmp_path / "file").touch()
    before = (tmp_path / "file").stat()
    monkeypatch.setattr(Path, "stat", lambda _: before)
    with pytest.raises(NotAFile, match="named pipe"):
        open_regular(tmp_path / "pipe.bvh")


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="no such device here")
def test_a_device_is_refused(tmp_path):
    (tmp_path / "zero.bvh").symlink_to("/dev/zero")
    with pytest.raises(NotAFile, match=r"zero\.bvh: is no regular file but a device"):
        read_bytes(tmp_path / "zero.bvh")


def test_folders_links_to_themselves_and_nothing(tmp_path):
    (tmp_path / "self").symlink_to("self")
    with pytest.raises(NotAFile, match="a folder"):
        read_bytes(tmp_path)
    with pytest.raises(UnreadableFile, match="self: cannot be read: Too many levels"):
        read_bytes(tmp_path / "self")
    with pytest.raises(UnreadableFile, match="gone: cannot be read: no such file"):
        read_bytes(tmp_path / "gone")


def write(path, text):
    with write_atomically(path) as beside:
        beside.write_text(text)


def test_a_link_stays_and_its_target_is_written(tmp_path):
    (tmp_path / "elsewhere").mkdir()
    target, link = tmp_path / "elsewhere" / "target.csv", tmp_path / "link.csv"
    link.symlink_to("elsewhere/target.csv")
    for text in ("new", "newer"):
        write(link, text)
        assert link.is_symlink()
        assert target.read_text() == text
    assert sorted(p.name for p in tmp_path.iterdir()) == ["elsewhere", "link.csv"]
    assert [p.name for p in target.parent.iterdir()] == ["target.csv"]


def test_a_link_to_itself_is_refused_and_stays(tmp_path):
    link = tmp_path / "self.csv"
    link.symlink_to("self.csv")
    with pytest.raises(UnwritableFile, match=r"self\.csv: cannot be written"):
        write(link, "new")
    assert link.is_symlink()


@needs_pipes
def test_a_named_pipe_is_written_to(tmp_path):
    pipe, got = tmp_path / "pipe.csv", []
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: got.append(pipe.read_text()))
    reader.start()
    write(pipe, "through")
    reader.join(20)
    assert got == ["through"]
    assert stat.S_ISFIFO(pipe.stat().st_mode)


@pytest.mark.skipif(not Path("/dev/null").exists(), reason="no such device here")
def test_a_device_is_written_to_and_stays(tmp_path):
    link = tmp_path / "null.csv"
    link.symlink_to("/dev/null")
    write(link, "nowhere")
    assert stat.S_ISCHR(Path("/dev/null").stat().st_mode)
    assert list(tmp_path.iterdir()) == [link]


def test_a_dash_is_standard_output(tmp_path, monkeypatch, capfdbinary):
    monkeypatch.chdir(tmp_path)
    write("-", "résult")
    sys.stdout.flush()
    assert capfdbinary.readouterr().out == "résult".encode()
    assert list(tmp_path.iterdir()) == []


@needs_rights
@pytest.mark.parametrize("mode", [0o600, 0o640, 0o755])
def test_a_file_that_is_replaced_keeps_its_rights(tmp_path, mode):
    path = tmp_path / "a.csv"
    path.write_text("old")
    path.chmod(mode)
    write(path, "new")
    assert path.read_text() == "new"
    assert stat.S_IMODE(path.stat().st_mode) == mode


@needs_rights
def test_a_write_protected_file_is_refused(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("old")
    path.chmod(0o444)
    with pytest.raises(UnwritableFile, match=r"a\.csv: cannot be written: it is write-protected"):
        write(path, "new")
    assert path.read_text() == "old"
    assert stat.S_IMODE(path.stat().st_mode) == 0o444
