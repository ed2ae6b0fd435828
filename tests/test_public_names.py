"""Does the table of contents say the truth, and is it quick to open?"""

import ast
import importlib
import subprocess
import sys
import tomllib
from pathlib import Path
from types import ModuleType

import pytest

import motionary

ROOT = Path(__file__).resolve().parent.parent

# fmt: off
PUBLIC_NAMES = {
    "read", "write", "read_labels", "write_labels", "Motion", "Skeleton", "FeatureSet",
    "FeatureSequence", "compute_features", "MotionTemplate", "MotionClass", "ClassLibrary",
    "learn", "annotate", "search", "Index", "KeyframeQuery", "Hit", "explain", "Label",
    "LabelTrack", "Recording", "count", "evaluate", "MotionaryError", "report",
    "report_comparison", "report_hits", "report_library",
    "check_tracking", "track", "untangle", "LiveAnnotator",
}
# fmt: on


def run_fresh(code: str) -> str:
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_the_public_names_are_the_documented_ones():
    assert set(motionary.__all__) == PUBLIC_NAMES
    assert len(motionary.__all__) == len(PUBLIC_NAMES)
    assert set(dir(motionary)) >= PUBLIC_NAMES


@pytest.mark.parametrize("name", sorted(PUBLIC_NAMES))
def test_a_public_name_resolves_and_is_documented(name):
    value = getattr(motionary, name)
    assert callable(value)
    assert value.__doc__, f"{name} has no docstring"
    assert value.__module__.startswith("motionary.")


def test_the_names_for_type_checkers_are_those_at_run_time():
    tree = ast.parse((ROOT / "src/motionary/__init__.py").read_text("utf-8"))
    (block,) = (node for node in tree.body if isinstance(node, ast.If))
    imported = {
        (line.module, alias.name)
        for line in block.body
        if isinstance(line, ast.ImportFrom)
        for alias in line.names
    }
    assert {name for _, name in imported} == PUBLIC_NAMES
    for module, name in imported:
        assert getattr(motionary, name) is getattr(importlib.import_module(module), name)


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'serach'"):
        motionary.serach  # noqa: B018


def test_importing_a_module_does_not_hide_the_function_of_its_name():
    importlib.import_module("motionary.retrieval.search")
    assert not isinstance(motionary.search, ModuleType)
    assert isinstance(motionary.retrieval.search, ModuleType)
    code = "import motionary.retrieval.search, motionary as mo; print(type(mo.search).__name__)"
    assert run_fresh(code) == "function"


def test_import_motionary_imports_nothing_heavy():
    code = "import sys, motionary; print(*sorted({m.split('.')[0] for m in sys.modules}))"
    heavy = {"numpy", "scipy", "matplotlib", "typer", "rich", "ezc3d", "numba", "platformdirs"}
    assert heavy.isdisjoint(run_fresh(code).split())


def test_the_core_computes_without_pictures_compiler_or_command_line():
    code = "import sys, motionary as mo; mo.compute_features, mo.MotionTemplate, mo.evaluate"
    heavy = {"matplotlib", "typer", "rich", "ezc3d", "numba"}
    seen = run_fresh(f"{code}; print(*sorted({{m.split('.')[0] for m in sys.modules}}))")
    assert heavy.isdisjoint(seen.split())


def test_live_labels_load_no_pages_until_one_is_served():
    code = "import sys, motionary.live; print(*(m for m in sys.modules if 'reporting' in m))"
    assert run_fresh(code) == ""


def test_the_version_is_written_once_and_copied_right():
    pyproject = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    assert pyproject["project"]["dynamic"] == ["version"]
    assert pyproject["tool"]["hatch"]["version"] == {"path": "src/motionary/__init__.py"}
    # A citation file can derive nothing.
    assert f"\nversion: {motionary.__version__}\n" in (ROOT / "CITATION.cff").read_text("utf-8")
