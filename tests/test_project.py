"""Does the project keep its own rules of shape?"""

import ast
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "src" / "motionary"
MODULES = sorted(PACKAGE.rglob("*.py"))
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
CONTRACTS = PROJECT["tool"]["importlinter"]["contracts"]

MOST_LINES = 400
MOST_BODY_LINES = 50

# Tables inside the package are not files of the person's; they are read as resources.
READS_ITS_OWN_TABLES = {"features", "skeletons"}
TOUCHES_FILES = re.compile(
    r"open|fdopen|read_(text|bytes)|write_(text|bytes)|mkdir|unlink|load|loadtxt|genfromtxt"
    r"|fromfile|tofile|memmap|save|savez|savez_compressed|savetxt"
)
FILE_MODULES = {"numpy", "np", "scipy", "Path", "os", "json", "tomllib", "pickle", "shutil"}
METHODS_OF_ANY_OBJECT = re.compile(r"open|read_(text|bytes)|write_(text|bytes)|mkdir|unlink|tofile")


def name_of(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


@cache
def parse(path: Path) -> ast.Module:
    return ast.parse(path.read_text("utf-8"), filename=str(path))


def rooms() -> set[str]:
    """Modules and packages directly in motionary."""
    files = {path.stem for path in PACKAGE.glob("*.py")} - {"__init__"}
    return files | {path.parent.name for path in PACKAGE.glob("*/__init__.py")}


def rooms_of_contract() -> dict[str, bool]:
    """Rooms of the layers contract, and whether each must exist."""
    (layers,) = (c["layers"] for c in CONTRACTS if c.get("containers") == ["motionary"])
    names = [name.strip() for layer in layers for name in layer.split("|")]
    return {name.strip("()"): not name.startswith("(") for name in names}


def computing_modules() -> list[Path]:
    """Modules that compute: those that the contract keeps from files and pictures."""
    (names,) = (c["source_modules"] for c in CONTRACTS if c["name"].startswith("computing"))
    roots = [PACKAGE / name.removeprefix("motionary.") for name in names]
    return [m for r in roots for m in MODULES if m == r.with_suffix(".py") or r in m.parents]


def functions(tree: ast.Module) -> Iterator[ast.FunctionDef | ast.AsyncFunctionDef]:
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield node


def body_lines(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Lines of a body, its docstring not counted."""
    documented = ast.get_docstring(function, clean=False) is not None
    body = function.body[1:] if documented else function.body
    if not body:
        return 0
    return (body[-1].end_lineno or 0) - body[0].lineno + 1


def imports(tree: ast.Module) -> Iterator[str]:
    """Top-level names of imported packages, late imports included."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name.split(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            yield (node.module or "").split(".")[0]


def touches_a_file(call: ast.Call) -> bool:
    """Whether a call opens, reads, writes or makes a file, by its name."""
    if isinstance(call.func, ast.Name):
        return call.func.id == "open"
    if not isinstance(call.func, ast.Attribute):
        return False
    owner = call.func.value
    if isinstance(owner, ast.Name) and owner.id in FILE_MODULES:
        return TOUCHES_FILES.fullmatch(call.func.attr) is not None
    return METHODS_OF_ANY_OBJECT.fullmatch(call.func.attr) is not None


def git_files(*options: str) -> list[Path]:
    command = ["git", "-C", str(ROOT), "ls-files", "-z", *options]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("not a git checkout")
    return [path for name in done.stdout.split("\0") if name and (path := ROOT / name).is_file()]


def test_modules_are_short():
    lines = {name_of(path): len(path.read_text("utf-8").splitlines()) for path in MODULES}
    assert {name: n for name, n in lines.items() if n > MOST_LINES} == {}


def test_function_bodies_are_short():
    lines = {(name_of(p), f.name): body_lines(f) for p in MODULES for f in functions(parse(p))}
    assert {place: n for place, n in lines.items() if n > MOST_BODY_LINES} == {}


def test_modules_say_which_question_they_answer():
    assert [name_of(path) for path in MODULES if not ast.get_docstring(parse(path))] == []


# Errors take the file and the place in it apart, so that nothing need cut them off a text.
FILE = r"(path|Path\(path\)|source|self\.source|folder|target)(\.name)?"
NAMES_ITS_FILE = re.compile(rf"raise \w+\(\s*f[\"']\{{{FILE}\}}(: |, line )")


def test_no_text_of_an_error_begins_with_its_file():
    assert NAMES_ITS_FILE.search('raise UnreadableFile(\n    f"{path.name}, line {n}: bad")')
    found = {name_of(p): NAMES_ITS_FILE.findall(p.read_text("utf-8")) for p in MODULES}
    assert {name: texts for name, texts in found.items() if texts} == {}


def test_every_room_stands_in_the_layers_contract():
    assert rooms() - set(rooms_of_contract()) == set()


def test_rooms_that_must_exist_exist():
    needed = {name for name, must_exist in rooms_of_contract().items() if must_exist}
    assert needed - rooms() == set()


def test_computing_modules_import_numpy_and_scipy_only():
    allowed = set(sys.stdlib_module_names) | {"numpy", "scipy", "motionary"}
    compiled = allowed | {"numba"}
    foreign = {
        name_of(path): set(imports(parse(path)))
        - (compiled if path.stem.endswith("compiled") else allowed)
        for path in computing_modules()
    }
    assert {name: packages for name, packages in foreign.items() if packages} == {}


def test_computing_modules_open_no_files():
    found = [
        f"{name_of(path)}:{node.lineno}"
        for path in computing_modules()
        if path.relative_to(PACKAGE).parts[0].removesuffix(".py") not in READS_ITS_OWN_TABLES
        for node in ast.walk(parse(path))
        if isinstance(node, ast.Call) and touches_a_file(node)
    ]
    assert found == []


def test_the_files_that_contributors_are_sent_to_exist():
    table = [line for line in (ROOT / "CONTRIBUTING.md").read_text("utf-8").splitlines()
             if line.startswith("| ") and "I want to" not in line]  # fmt: skip
    places = [(re.findall(r"`([\w/]+(?:/|\.py))`", line.split("|")[2]), line) for line in table]
    assert len(places) > 20
    missing = [
        name
        for names, _ in places
        for name in names
        if not any((root / name).exists() for root in (PACKAGE, ROOT)) and "/" in name
    ]
    assert missing == []


@pytest.mark.parametrize("command", ["make demo", "make test"])
def test_the_readme_names_the_commands_of_a_clone(command):
    assert command in (ROOT / "README.md").read_text("utf-8")


def test_every_dependency_has_its_reason():
    reasons = (ROOT / "docs" / "decisions.md").read_text("utf-8")
    project = PROJECT["project"]
    groups = [project["dependencies"], *project["optional-dependencies"].values()]
    names = {re.split(r"[<>=\[ ]", line)[0] for group in groups for line in group}
    assert [name for name in sorted(names) if f"`{name}`" not in reasons] == []


def test_files_beside_the_code_go_into_the_package():
    wheel = PROJECT["tool"]["hatch"]["build"]["targets"]["wheel"]
    assert wheel == {"packages": ["src/motionary"]}
    ignored = set(git_files("--others", "--ignored", "--exclude-standard"))
    files = [p for p in PACKAGE.rglob("*") if p.is_file() and "__pycache__" not in p.parts]
    beside = [path for path in files if path.suffix != ".py"]
    # What git ignores, the build leaves out.
    assert [name_of(path) for path in beside if path in ignored] == []
    assert PACKAGE / "py.typed" in beside


def test_no_tracked_file_names_a_place_on_somebodys_machine():
    place = re.compile(r"(?<![\w.~-])(/(home|Users|root|work|tmp|mnt)/\w|[A-Z]:\\Users\\)")
    found = []
    for path in git_files():
        for number, line in enumerate(path.read_bytes().decode("latin-1").splitlines(), start=1):
            if path.suffix not in {".png", ".npz"} and place.search(line):
                found.append(f"{name_of(path)}:{number}: {line.strip()[:80]}")
    assert found == []


def test_no_recordings_are_tracked():
    formats = {".amc", ".asf", ".bvh", ".c3d", ".fbx", ".trc"}
    assert [name_of(p) for p in git_files() if p.suffix.lower() in formats] == []
