"""Marks that select tests: `pytest -m recordings`, and the fast part of `make quick`."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

TESTS = Path(__file__).parent
QUICK = "not slow and not recordings"


@pytest.fixture(scope="module")
def collected():
    """Names of the tests of this file that an expression of marks selects."""

    def select(expression):
        command = [sys.executable, "-m", "pytest", "--collect-only", "-q", "-p", "no:cacheprovider"]
        done = subprocess.run(
            [*command, "-m", expression, __file__],
            capture_output=True,
            encoding="utf-8",
            cwd=TESTS.parent,
        )
        return {line.split("::")[1] for line in done.stdout.splitlines() if "::" in line}

    return select


def test_recordings_and_published_values_are_there(data, golden):
    assert any(data.iterdir())
    assert any(golden.iterdir())


@pytest.mark.slow
def test_the_mark_recordings_selects_tests_on_recordings(collected):
    assert collected("recordings") == {"test_recordings_and_published_values_are_there"}


@pytest.mark.slow
def test_the_fast_part_has_neither_recordings_nor_slow_tests(collected):
    assert collected(QUICK) == {"test_listed_slow_tests_exist"}


def test_listed_slow_tests_exist(request):
    (listed,) = (p.SLOW for p in request.config.pluginmanager.get_plugins() if hasattr(p, "SLOW"))
    names = {
        node.name
        for path in TESTS.rglob("test_*.py")
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(node, ast.FunctionDef)
    }
    assert sorted(listed - names) == [], "renamed or gone: change tests/slow.txt"
