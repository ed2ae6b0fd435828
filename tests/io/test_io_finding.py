"""Which recordings are found, and what are they called?"""

from pathlib import Path

import pytest

from motionary.errors import UnreadableFile
from motionary.io import (
    MOTION_SUFFIXES,
    find_recordings,
    match_recording,
    name_recordings,
    read,
    recording_name,
    scan_folder,
)

FILES = ("b.bvh", "a.AMC", "sub/c.amc", "sub/deep er/d.bvh", "sub/notes.txt", "body.asf")
HIDDEN = (".e.bvh", ".cache/f.bvh", "sub/.g/h.amc")


@pytest.fixture
def folder(tmp_path):
    for name in (*FILES, *HIDDEN):
        path = tmp_path / "takes" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    (tmp_path / "takes" / "folder.bvh").mkdir()
    return tmp_path / "takes"


def test_a_folder_is_searched_to_the_bottom_hidden_files_are_not(folder):
    found = find_recordings([folder])
    assert found == sorted(folder / name for name in FILES if name[-4:].lower() in MOTION_SUFFIXES)
    assert find_recordings(folder) == find_recordings(str(folder)) == found


def test_linked_folders_are_searched_once_and_cycles_told(folder):
    away = folder.parent / "away"
    away.mkdir()
    (away / "z.bvh").touch()
    (folder / "first").symlink_to(away)
    (folder / "sub" / "up").symlink_to(folder)
    (away / "back").symlink_to(folder / "sub")
    skipped = []
    found = name_recordings(folder, on_skip=skipped.append)
    assert "first/z.bvh" in found
    assert [name for name in found if name.startswith(("sub/up", "first/back"))] == []
    assert len(skipped) == 2
    for name in ("up", "back"):
        assert any(f"{name}: leads to a folder that is searched already" in s for s in skipped)
    assert list(scan_folder(folder)) == list(found)


def test_a_link_to_itself_hides_no_other_file(folder):
    (folder / "self.bvh").symlink_to("self.bvh")
    assert {"a.AMC", "self.bvh"} <= name_recordings(folder).keys()
    assert "self.bvh" in scan_folder(folder)
    with pytest.raises(UnreadableFile, match="Too many levels"):
        read(folder / "self.bvh")


def test_names_are_paths_below_the_folder(folder):
    assert name_recordings([folder]) == {
        "a.AMC": folder / "a.AMC",
        "b.bvh": folder / "b.bvh",
        "sub/c.amc": folder / "sub" / "c.amc",
        "sub/deep er/d.bvh": folder / "sub" / "deep er" / "d.bvh",
    }
    assert list(name_recordings(folder / "sub" / "c.amc")) == ["c.amc"]


@pytest.mark.parametrize(
    ("pattern", "names"),
    [
        ("*.bvh", ["b.bvh"]),
        ("*", ["a.AMC", "b.bvh"]),
        ("**/*", ["a.AMC", "b.bvh", "c.amc", "d.bvh"]),
        ("s*/[cd].amc", ["c.amc"]),
    ],
)
def test_patterns(folder, monkeypatch, pattern, names):
    assert list(name_recordings(str(folder / pattern))) == names
    monkeypatch.chdir(folder)
    assert list(name_recordings(pattern)) == names


def test_each_recording_counts_once(folder, monkeypatch):
    monkeypatch.chdir(folder)
    paths = [folder, "b.bvh", "./b.bvh", folder / "*.bvh", "sub"]
    assert len(find_recordings(paths)) == 4


def test_recordings_of_one_name_are_called_by_their_folders(folder):
    other = folder.parent / "more"
    (other / "sub").mkdir(parents=True)
    for name in ("b.bvh", "sub/c.amc", "z.bvh"):
        (other / name).touch()
    names = name_recordings([folder, other])
    assert {"takes/b.bvh", "more/b.bvh", "takes/sub/c.amc", "more/sub/c.amc"} < set(names)
    assert {"a.AMC", "z.bvh"} < set(names)
    assert names["more/sub/c.amc"] == other / "sub" / "c.amc"


def test_names_with_brackets_are_files_before_they_are_patterns(tmp_path):
    (tmp_path / "take [1].bvh").touch()
    assert find_recordings(tmp_path / "take [1].bvh") == [tmp_path / "take [1].bvh"]


@pytest.mark.parametrize(
    ("given", "words"),
    [("nowhere", "no such file"), ("*.trc", "no recording"), ("empty", "no recordings in this")],
)
def test_nothing_found_is_an_error(folder, given, words):
    (folder / "empty").mkdir()
    with pytest.raises(UnreadableFile, match=words):
        find_recordings([folder / given])


def test_a_named_file_of_another_kind_is_left_to_the_reader(folder):
    (path,) = find_recordings([folder / "sub" / "notes.txt"])
    with pytest.raises(UnreadableFile, match=r"'\.txt'; known are \.amc, \.bvh"):
        read(path)


@pytest.mark.parametrize(
    ("path", "folder", "name"),
    [
        ("x/y/a.bvh", "x", "y/a.bvh"),
        ("x/y/a.bvh", "x/", "y/a.bvh"),
        ("x/y/a.bvh", None, "a.bvh"),
        ("x/y/a.bvh", "z", "a.bvh"),
        ("x/a.bvh", "x/a.bvh", "a.bvh"),
        (Path("/x/y/ä b.bvh"), Path("/x"), "y/ä b.bvh"),
    ],
)
def test_recording_names(path, folder, name):
    assert recording_name(path, folder=folder) == name


@pytest.mark.parametrize(
    ("name", "found"),
    [
        ("86_01.amc", "86_01.amc"),
        ("86_01", "86_01.amc"),
        ("86_01.bvh", "86_01.amc"),
        ("squat/a.AMC", "squat/a.amc"),
        ("squat\\a.amc", "squat/a.amc"),
        ("old/86_01.bvh", "86_01.amc"),
        ("b", "walk/b.bvh"),
        ("a", None),
        ("walk/a", "walk/a.bvh"),
        ("c", None),
        ("d", None),
        ("", None),
        ("v1.2", "v1.2.bvh"),
    ],
)
def test_tables_may_name_recordings_by_their_stem_if_it_is_unique(name, found):
    names = ["86_01.amc", "squat/a.amc", "walk/a.bvh", "walk/b.bvh", "d.bvh", "d.amc", "v1.2.bvh"]
    assert match_recording(name, names) == found
