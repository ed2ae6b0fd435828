"""Do batches keep their order and finish, and are results written whole or not at all?"""

import os
import stat
import subprocess
import sys
import time
from pathlib import Path

import pytest

from motionary.batch import Failure, map_ordered, write_atomically
from motionary.errors import InvalidInput, UnreadableFile, UnwritableFile


def slow_square(n):
    time.sleep(0.02 * (n % 3))
    return n * n


def refuse_three(n):
    if n == 3:
        raise UnreadableFile(f"file {n}: broken")
    return n


def divide_by_zero(n):
    return 1 // (n - 2)


def begin_to_write(path, text, error):
    with write_atomically(path) as beside:
        beside.write_text(text)
        raise error


@pytest.mark.parametrize("jobs", [1, 2])
def test_results_come_in_order_and_failures_among_them(jobs):
    assert list(map_ordered(slow_square, range(9), jobs=jobs)) == [n * n for n in range(9)]
    done = []
    results = list(map_ordered(refuse_three, range(6), jobs=jobs, on_done=done.append))
    failure = results.pop(3)
    assert results == [0, 1, 2, 4, 5]
    assert done == list(range(6))
    assert isinstance(failure, Failure)
    assert failure.item == 3
    assert isinstance(failure.error, UnreadableFile)
    assert str(failure.error) == "file 3: broken"


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_fault_of_the_program_is_raised(jobs):
    results = map_ordered(divide_by_zero, range(9), jobs=jobs)
    with pytest.raises(ZeroDivisionError):
        list(results)


def test_nothing_to_do_is_done():
    assert list(map_ordered(slow_square, [])) == []


def test_items_are_taken_as_they_are_needed():
    taken = []
    items = (taken.append(n) or n for n in range(10))
    results = map_ordered(slow_square, items)
    assert next(results) == 0
    assert taken == [0]


PULSE = """
import sys, time
from pathlib import Path
from motionary.batch import map_ordered

def beat(path):
    while True:
        Path(path).write_text(str(time.time()))
        time.sleep(0.05)

if __name__ == "__main__":
    list(map_ordered(beat, sys.argv[1:], jobs=2))
"""


def test_workers_end_with_a_program_that_is_killed(tmp_path):
    script, pulses = tmp_path / "pulse.py", [tmp_path / "one", tmp_path / "two"]
    script.write_text(PULSE)
    with subprocess.Popen([sys.executable, script, *pulses]) as program:
        until = time.monotonic() + 20
        while not all(pulse.exists() for pulse in pulses) and time.monotonic() < until:
            time.sleep(0.05)
        program.kill()
    time.sleep(1)
    last = [pulse.read_text() for pulse in pulses]
    time.sleep(0.5)
    assert [pulse.read_text() for pulse in pulses] == last


def test_the_number_of_processes_is_checked_at_once():
    with pytest.raises(InvalidInput, match="jobs"):
        map_ordered(slow_square, [1], jobs=0)


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
