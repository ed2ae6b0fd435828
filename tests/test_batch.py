"""Batches keep their order, and finish whatever goes wrong with one item."""

import os
import subprocess
import sys
import time

import pytest

from batch_cases import (
    divide_by_zero,
    end_process,
    need_too_much,
    raise_what_cannot_be_sent,
    recurse,
    refuse_three,
    return_what_cannot_be_sent,
    slow_square,
    stop,
)
from motionary.batch import Failure, map_ordered
from motionary.errors import InvalidInput, ProgramFault, UnreadableFile


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
@pytest.mark.parametrize(
    ("function", "words"),
    [
        (divide_by_zero, "ZeroDivisionError: integer division or modulo by zero"),
        (recurse, "RecursionError"),
        (need_too_much, "MemoryError"),
        (raise_what_cannot_be_sent, "Unsendable: one line"),
    ],
)
def test_a_fault_of_the_program_is_the_failure_of_one_item(function, words, jobs):
    results = list(map_ordered(function, range(5), jobs=jobs))
    (failure,) = (result for result in results if isinstance(result, Failure))
    assert results[3:] + results[:2] == [function(n) for n in (3, 4, 0, 1)]
    assert failure.item == 2
    assert isinstance(failure.error, ProgramFault)
    assert words in str(failure.error)
    assert "please report" in str(failure.error)
    assert len(str(failure.error).splitlines()) == 1


def test_a_result_that_cannot_be_sent_is_the_failure_of_its_item():
    results = list(map_ordered(return_what_cannot_be_sent, range(4), jobs=2))
    assert [isinstance(result, Failure) for result in results] == [False, False, True, False]


def test_a_process_that_is_ended_costs_its_item_only():
    results = list(map_ordered(end_process, range(12), jobs=2))
    failure = results.pop(2)
    assert results == [n for n in range(12) if n != 2]
    assert isinstance(failure, Failure)
    assert "its process was ended" in str(failure.error)


def test_the_keyboard_still_stops_a_batch():
    with pytest.raises(KeyboardInterrupt):
        list(map_ordered(stop, range(3)))


FOREIGN = """
from pathlib import Path
Path("ran").touch()
raise ImportError("code of a folder of recordings was run")
"""


@pytest.mark.parametrize("name", ["pickle", "numpy", "secrets", "socket"])
def test_processes_run_no_code_of_the_current_folder(tmp_path, name):
    (tmp_path / f"{name}.py").write_text(FOREIGN)
    # The program starts like an installed script, whose own folder is searched first.
    script = tmp_path / "bin" / "program.py"
    script.parent.mkdir()
    script.write_text(PROGRAM)
    done = subprocess.run(
        [sys.executable, script], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert (done.stdout, done.returncode) == ("[3, 3]\n", 0), done.stderr
    assert not (tmp_path / "ran").exists()


PROGRAM = """
from motionary.batch import map_ordered

if __name__ == "__main__":
    print(list(map_ordered(len, ["abc", "def"], jobs=2)))
"""


def test_the_environment_is_left_as_it_was(monkeypatch):
    monkeypatch.delenv("PYTHONSAFEPATH", raising=False)
    assert list(map_ordered(slow_square, [2], jobs=2)) == [4]
    assert "PYTHONSAFEPATH" not in os.environ


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
