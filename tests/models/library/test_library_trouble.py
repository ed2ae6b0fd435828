"""What if a library is broken, edited into nonsense, or its writing is cut short?"""

import io
import os
import pickle
import re
import tomllib
import zipfile
from pathlib import Path

import numpy as np
import pytest
from test_library import contents, files, make_library

from motionary.errors import UnreadableFile, UnwritableFile
from motionary.features import FULL_BODY, FULL_BODY_2006
from motionary.models.library import ClassLibrary

# -- edited by hand ----------------------------------------------------------------------

INDEX_KEYS = {
    "version": ['"one"', "true", "99", "0", "1.5"],
    "feature_set": ["3", '"arms"', "[]"],
    "features": ['"F1"', "[]", "[1, 2]"],
    "provenance": ["3", "[]"],
    "licence": ["false"],
    "classes": ["3", "[]", "{ squat = 3 }", '{ squat = "../squat" }', '{ squat = "gone" }'],
}
CLASS_KEYS = {
    "name": ["3", '"kick"', '""'],
    "threshold": ["7", "-0.1", "nan", "inf", '"0.06"', "true", "[]"],
    "tolerance": ["0.5", "-1", "nan", '"low"'],
    "background": ["3", "[0.5]", '["a"]', "[nan]", "[[]]"],
    "values": ["3", '"gone.npz"', '"../other.npz"', '""', '"."', '"squat.toml"'],
    "templates": ["3", "[]", "[1]", '["name"]', "[[]]", "{}"],
}
TEMPLATE_KEYS = {
    "name": ["3"],
    "examples": ["0", "-1", "1.5", '"two"', "true"],
    "columns": ["5", "0", '"four"'],
    "provenance": ["3"],
}
EDITS = [
    ("library.toml", "", key, value)
    for key, values in INDEX_KEYS.items()
    for value in [None, *values]
] + [
    ("squat.toml", place, key, value)
    for place, keys in (("", CLASS_KEYS), ("templates[0].", TEMPLATE_KEYS))
    for key, values in keys.items()
    for value in [None, *values]
]


@pytest.fixture
def folder(tmp_path):
    """A library of one class."""
    make_library("squat").save(tmp_path / "library")
    return tmp_path / "library"


def edit(path: Path, place: str, key: str, value: str | None) -> None:
    """Give a key another value, or none."""
    text = path.read_text("utf-8")
    if key in ("classes", "templates"):
        head, _, _ = re.split(rf"(?m)^(\[+{key}\]+)$", text)[:3]
        text = head + ("" if value is None else f"{key} = {value}\n")
    else:
        before, start, after = text.partition("[[templates]]") if place else ("", "", text)
        line = rf"(?m)^{key} = .*\n"
        assert re.search(line, after)
        after = re.sub(line, "" if value is None else f"{key} = {value}\n", after, count=1)
        text = before + start + after
    tomllib.loads(text)
    path.write_text(text, "utf-8")


@pytest.mark.parametrize(("file", "place", "key", "value"), EDITS)
def test_a_missing_or_wrong_value_is_named_with_its_file(folder, file, place, key, value):
    edit(folder / file, place, key, value)
    with pytest.raises(UnreadableFile) as caught:
        ClassLibrary.load(folder)
    message = str(caught.value)
    assert key in message
    # A class that is not there is missed where it should be.
    assert file in message or ("gone" in str(value) and "gone" in message)


@pytest.mark.parametrize("file", ["library.toml", "squat.toml"])
@pytest.mark.parametrize(
    "content", [b"\xff\xfe\x00", b"= 3", b"[", b"version = 1\nversion = 2", b"\x00", b""]
)
def test_a_file_that_is_no_table_is_named(folder, file, content):
    (folder / file).write_bytes(content)
    with pytest.raises(UnreadableFile, match=re.escape(file)) as caught:
        ClassLibrary.load(folder)
    assert "codec" not in str(caught.value)


@pytest.mark.parametrize(
    "lines", ["3", '"right hand fast"', "[3]", "[]", '["hand glows"]', '["then"]']
)
def test_a_query_that_is_none_is_named(folder, lines):
    path = folder / "squat.toml"
    path.write_text(path.read_text("utf-8") + f"query = {lines}\n", "utf-8")
    with pytest.raises(UnreadableFile, match=r"squat\.toml: templates\[0\]: query"):
        ClassLibrary.load(folder)


def test_a_newer_library_asks_for_a_newer_motionary(folder):
    edit(folder / "library.toml", "", "version", "2")
    with pytest.raises(UnreadableFile, match=r"newer motionary \(version 2.*up to 1.*update"):
        ClassLibrary.load(folder)


def test_an_unknown_feature_set_names_those_that_are_known(folder):
    edit(folder / "library.toml", "", "feature_set", '"arms-12"')
    known = f"'arms-12'.*{FULL_BODY.name}.*{FULL_BODY_2006.name}"
    with pytest.raises(UnreadableFile, match=known):
        ClassLibrary.load(folder)


@pytest.mark.parametrize("file", ["library.toml", "squat.toml"])
def test_a_missing_file_is_named(folder, file):
    (folder / file).unlink()
    with pytest.raises(UnreadableFile, match=re.escape(file)):
        ClassLibrary.load(folder)


def test_a_folder_without_a_library_says_so(tmp_path):
    for path in (tmp_path, tmp_path / "nowhere"):
        with pytest.raises(UnreadableFile, match="no library there"):
            ClassLibrary.load(path)


# -- values ------------------------------------------------------------------------------


def npz(**arrays):
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


class Danger:
    """What a pickle could do."""

    def __reduce__(self):
        return (os.mkdir, ("danger",))


def pickled():
    buffer = io.BytesIO()
    np.savez(buffer, values_0=np.array([Danger()]), weights_0=np.ones(4))
    return buffer.getvalue()


def huge():
    """A header that claims more than any memory holds."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        header = "{'descr': '<f8', 'fortran_order': False, 'shape': (4000000000000, 40), }"
        text = header.encode().ljust(117) + b"\n"
        archive.writestr("values_0.npy", b"\x93NUMPY\x01\x00v\x00" + text)
        archive.writestr("weights_0.npy", b"\x93NUMPY\x01\x00v\x00" + text)
    return buffer.getvalue()


def npy():
    buffer = io.BytesIO()
    np.save(buffer, np.ones((4, 40)))
    return buffer.getvalue()


VALUES = np.full((4, 40), 0.5)
NONSENSE = {
    "empty": b"",
    "text": b"values = 3",
    "a pickle": pickle.dumps(Danger()),
    "a pickle within": pickled(),
    "one array": npy(),
    "no arrays": npz(),
    "names of others": npz(a=VALUES, b=np.ones(4)),
    "weights missing": npz(values_0=VALUES),
    "another shape": npz(values_0=VALUES.T, weights_0=np.ones(4)),
    "weights of another shape": npz(values_0=VALUES, weights_0=np.ones(3)),
    "weights of 0": npz(values_0=VALUES, weights_0=np.zeros(4)),
    "values above 1": npz(values_0=3 * VALUES, weights_0=np.ones(4)),
    "no number": npz(values_0=np.full((4, 40), np.nan), weights_0=np.ones(4)),
    "words": npz(values_0=np.full((4, 40), "half"), weights_0=np.ones(4)),
    "complex": npz(values_0=VALUES * 1j, weights_0=np.ones(4)),
    "weights in words": npz(values_0=VALUES, weights_0=np.full(4, "one")),
    "dates": npz(values_0=np.zeros((4, 40), "datetime64[s]"), weights_0=np.ones(4)),
    "bytes": npz(values_0=np.zeros((4, 40), "S3"), weights_0=np.ones(4)),
    "a number": npz(values_0=np.float64(0.5), weights_0=np.ones(4)),
    "huge": huge(),
}


@pytest.mark.parametrize("content", NONSENSE.values(), ids=NONSENSE.keys())
def test_values_that_are_none_are_refused(folder, monkeypatch, content):
    monkeypatch.chdir(folder)
    (values,) = folder.glob("*.npz")
    values.write_bytes(content)
    with pytest.raises(UnreadableFile, match="squat"):
        ClassLibrary.load(folder)
    assert not (folder / "danger").exists()


def test_missing_values_are_named(folder):
    (values,) = folder.glob("*.npz")
    values.unlink()
    with pytest.raises(UnreadableFile, match=re.escape(values.name)):
        ClassLibrary.load(folder)


def test_truncated_and_flipped_values_are_refused_or_harmless(folder):
    (values,) = folder.glob("*.npz")
    content, expected = values.read_bytes(), contents(ClassLibrary.load(folder))
    rng = np.random.default_rng(4)
    broken = [content[: int(n)] for n in rng.integers(0, len(content), 40)]
    for place in rng.integers(0, len(content), 200):
        flipped = bytearray(content)
        flipped[place] ^= 1 << int(rng.integers(8))
        broken.append(bytes(flipped))
    refused = 0
    for change in broken:
        values.write_bytes(change)
        try:
            assert contents(ClassLibrary.load(folder)) == expected
        except UnreadableFile:
            refused += 1
    assert refused > 150


# -- cut short ---------------------------------------------------------------------------


class Stop(BaseException):
    """The program ends."""


def stop_at(monkeypatch, number):
    """End the program when a file takes its place for the n-th time, or is removed."""
    done = 0

    def counted(original):
        def guarded(self, *arguments, **options):
            nonlocal done
            done += 1
            if done == number:
                raise Stop
            return original(self, *arguments, **options)

        return guarded

    # Temporary files are removed by the same call; only files that people see count.
    unlink = Path.unlink

    def guarded_unlink(self, *arguments, **options):
        if self.name.startswith("."):
            return unlink(self, *arguments, **options)
        return counted_unlink(self, *arguments, **options)

    counted_unlink = counted(unlink)
    monkeypatch.setattr(Path, "replace", counted(Path.replace))
    monkeypatch.setattr(Path, "unlink", guarded_unlink)


def classes_of(library):
    return {entry[0]: entry for entry in contents(library)[3]}


def changed(*names, seed, **about):
    return make_library(*names, seed=seed, **about)


PAIRS = {
    "other values": (make_library("a", "b"), make_library("a", "b", seed=9)),
    "one more, one less": (make_library("a", "b"), make_library("b", "c", seed=9)),
    "other order of alike names": (make_library("a b", "a_b"), make_library("a_b", "a b", seed=9)),
    "none of the old": (make_library("a", "b"), make_library("c", seed=9)),
    "emptied": (make_library("a", "b"), make_library()),
    "another feature set": (
        make_library("a", "b"),
        make_library("a", "c", seed=9, feature_set=FULL_BODY_2006),
    ),
}


@pytest.mark.parametrize(("old", "new"), PAIRS.values(), ids=PAIRS.keys())
def test_wherever_saving_ends_each_class_is_the_old_or_the_new_one(tmp_path, old, new):
    were, become = classes_of(old), classes_of(new)
    for number in range(1, 30):
        folder = tmp_path / str(number)
        old.save(folder)
        with pytest.MonkeyPatch.context() as patch:
            stop_at(patch, number)
            try:
                new.save(folder)
                ended = True
            except Stop:
                ended = False
        found = ClassLibrary.load(folder)
        for name, entry in classes_of(found).items():
            assert entry in (were.get(name), become.get(name))
        assert found.names in (old.names, new.names)
        new.save(folder)
        assert contents(ClassLibrary.load(folder)) == contents(new)
        if ended:
            break
    assert ended
    assert number > len(new)


def test_a_first_save_that_ends_early_can_be_done_again(tmp_path):
    library = make_library("a", "b")
    for number in range(1, 6):
        folder = tmp_path / str(number)
        with pytest.MonkeyPatch.context() as patch:
            stop_at(patch, number)
            with pytest.raises(Stop):
                library.save(folder)
        library.save(folder)
        assert contents(ClassLibrary.load(folder)) == contents(library)


def test_saving_over_a_broken_library_mends_it(folder):
    for file in ("library.toml", "squat.toml"):
        (folder / file).write_text("= nonsense")
        make_library("squat", seed=5).save(folder)
        assert ClassLibrary.load(folder).names == ("squat",)
        assert len(files(folder)) == 3


def test_an_error_of_the_disk_is_an_unwritable_file(tmp_path, monkeypatch):
    def full(self, target):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(UnwritableFile, match="No space left"):
        make_library("squat").save(tmp_path / "library")
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]
