"""Do the README and the documentation tell the truth?

Blocks of a page run one after the other in a folder of its own: `python` shares one
namespace, `sh` holds lines of `motionary`. A `text` block right below one of them is its
output, in which `...` stands for anything. `toml` and `json` have to parse. A block
that cannot run here says why in a comment above it: `<!-- not run: why -->`.
"""

import contextlib
import doctest
import importlib
import io
import json
import re
import shlex
import tomllib
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

import motionary
from cli_cases import run
from motionary.retrieval import index
from motionary.retrieval.index import CACHE_VARIABLE, Collection
from motionary.samples import synthetic_motion, synthetic_stream

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
IMAGES = DOCS / "images"
OWN_RECORDS = {DOCS / "evidence", DOCS / "_build"}
PAGES = [ROOT / "README.md", *sorted(DOCS.rglob("*.md"))]
PAGES = [page for page in PAGES if not OWN_RECORDS & set(page.parents)]
#: Pages that speak of a reader's own files; the others write theirs.
WITH_FILES = {"README.md", "docs/index.md"}

RUN = {"python", "sh"}
DATA = {"toml": tomllib.loads, "json": json.loads}
FENCE = re.compile(r"(?P<indent> *)(?P<ticks>`{3,})(?P<language>\S*)(?P<more>.*)")
REASON = re.compile(r"<!-- not run: (?P<why>\S.+) -->")
LINK = re.compile(r"\]\((?!\w+:|#)(?P<target>[^)#\s]+)(#[^)\s]*)?\)")

LARGEST_PICTURE = 200_000


class Block(NamedTuple):
    """A fenced block: where it starts, what it is, why it is not run, what it puts out."""

    line: int
    language: str
    text: str
    why_not: str = ""
    output: str | None = None


def name_of(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


def blocks_of(text: str) -> list[Block]:
    """Blocks of a page; directives such as `{toctree}` are Sphinx's and left out."""
    lines = text.split("\n")
    blocks: list[Block] = []
    above, between = "", ""
    number = 0
    while number < len(lines):
        opening = FENCE.fullmatch(lines[number])
        if opening is None:
            if lines[number].strip():
                above = between = lines[number]
            number += 1
            continue
        start = number + 1
        number = lines.index(opening["indent"] + opening["ticks"], start)
        body = "\n".join(line.removeprefix(opening["indent"]) for line in lines[start:number])
        number += 1
        reason = REASON.fullmatch(above.strip())
        above = ""
        if opening["language"].startswith("{"):
            between = "a directive"
        elif opening["language"] == "text" and not between and blocks and not reason:
            blocks[-1] = blocks[-1]._replace(output=body)
        else:
            why = reason["why"] if reason else ""
            blocks.append(Block(start + 1, opening["language"], body, why))
            between = ""
    return blocks


def lay_out_files(folder: Path) -> None:
    """What a reader is said to have: recordings, a take, examples, a long one, an array."""
    for name in ("squat", "kick_left", "walk", "wave_right"):
        for seed in range(3):
            motion = synthetic_motion(name, seed=seed, rate_hz=30)
            motionary.write(motion, folder / "recordings" / f"{name}-{seed}.bvh")
            if name in ("squat", "kick_left"):
                motionary.write(motion, folder / "examples" / name / f"{seed}.bvh")
    take, _ = synthetic_stream(["squat", "bow"], seed=7, rate_hz=30)
    motionary.write(take, folder / "take.bvh")
    long, _ = synthetic_stream(["kick_left", "squat", "walk"], seed=5, rate_hz=30)
    motionary.write(long, folder / "long.bvh")
    np.save(folder / "positions.npy", long.generic_positions())


@pytest.fixture
def place(tmp_path, monkeypatch):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "cache"))
    return tmp_path / "here"


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_the_blocks_of_a_page_run(page, place, capsys, monkeypatch):
    if name_of(page) in WITH_FILES:
        lay_out_files(place)
    names: dict[str, object] = {"__name__": "__main__"}
    for block in blocks_of(page.read_text("utf-8")):
        where = f"{name_of(page)}, line {block.line}"
        if block.why_not:
            continue
        if block.language == "python":
            put_out = run_python(block, where, names)
        elif block.language == "sh":
            put_out = run_shell(block, where, lambda *a: run(capsys, monkeypatch, *a))
        else:
            check_data(block, where)
            continue
        if block.output is not None:
            check_output(block.output, put_out, where)


def run_python(block: Block, where: str, names: dict[str, object]) -> str:
    # Empty lines in front: a traceback then has the page's own line numbers.
    code = compile("\n" * (block.line - 1) + block.text, where, "exec")
    with contextlib.redirect_stdout(io.StringIO()) as put_out:
        exec(code, names)
    return put_out.getvalue()


def run_shell(block: Block, where: str, motionary) -> str:
    put_out = ""
    for line in block.text.replace("\\\n", " ").split("\n"):
        packed = shlex.split(line, comments=True)
        if not packed:
            continue
        assert packed[0] == "motionary", f"{where}: only lines of motionary are run, got {line}"
        ran = motionary(*packed[1:])
        assert ran.code == 0, f"{where}: {line}\nends with {ran.code}: {ran.err}"
        put_out += ran.out
    return put_out


def check_data(block: Block, where: str) -> None:
    assert block.language in DATA, (
        f"{where}: a block of {block.language or 'no language'!r} is neither run nor checked; "
        "say why in a comment above it: <!-- not run: why -->"
    )
    DATA[block.language](block.text)


def check_output(wanted: str, got: str, where: str) -> None:
    flags = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
    same = doctest.OutputChecker().check_output(wanted, got, flags)
    assert same, f"{where}: the page says\n{wanted}\nbut it puts out\n{got}"


def test_a_page_that_is_wrong_is_found_out():
    page = "\n".join(
        [
            "```python", "print(1 + 1)", "```", "", "```text", "2", "```", "words",
            "```text", "not an output", "```", "<!-- not run: needs a network -->",
            "```sh", "pip install motionary", "```",
        ]
    )  # fmt: skip
    first, second, third = blocks_of(page)
    assert (first.language, first.output, first.line) == ("python", "2", 2)
    assert third.why_not == "needs a network"
    check_output(first.output, run_python(first, "page", {}), "page")
    with pytest.raises(AssertionError, match="the page says"):
        check_output("3", run_python(first, "page", {}), "page")
    with pytest.raises(AssertionError, match="neither run nor checked"):
        check_data(second, "page")


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_links_lead_somewhere(page):
    targets = {match["target"] for match in LINK.finditer(page.read_text("utf-8"))}
    assert [target for target in sorted(targets) if not (page.parent / target).exists()] == []


def test_pictures_are_small_and_shown_with_their_source():
    pictures = sorted(IMAGES.glob("*"))
    too_large = {p.name: p.stat().st_size for p in pictures if p.stat().st_size > LARGEST_PICTURE}
    assert too_large == {}
    texts = [page.read_text("utf-8") for page in PAGES]
    for picture in pictures:
        showing = [text for text in texts if f"images/{picture.name})" in text]
        assert showing, f"no page shows {picture.name}"
        for text in showing:
            assert re.search(r"HDM05|mocap\.cs\.cmu\.edu|synthetic", text), picture.name


def test_the_reference_has_every_public_name():
    text = (DOCS / "reference.md").read_text("utf-8")
    told = set(re.findall(r"auto(?:function|class|exception):: (\w+)$", text, re.MULTILINE))
    assert set(motionary.__all__) - told == set()


def test_modules_of_the_reference_say_what_they_have_for_others():
    text = (DOCS / "reference.md").read_text("utf-8")
    modules = re.findall(r"^```\{contents-of\} (\S+)$", text, re.MULTILINE)
    assert len(modules) > 10
    for module in map(importlib.import_module, modules):
        assert set(module.__all__) <= set(dir(module)), module.__name__


def test_the_files_that_pages_speak_of_are_laid_out(place):
    lay_out_files(place)
    found = motionary.search(motionary.read("take.bvh").cut(36, 102), "recordings", limit=3)
    assert {hit.recording.name.split("-")[0] for hit in found} == {"squat"}


# -- numbers of the README ----------------------------------------------------------------


@pytest.fixture(scope="module")
def demonstration(data, hdm05, tmp_path_factory):
    """What `make demo` prints on real recordings."""
    from motionary.demo import run_on_recordings as demonstrate

    paths = sorted((data / "hdm05").rglob("*.[aA][mM][cC]"))
    clips = [hdm05[path.stem].renamed(f"{path.parent.name}/{path.name}") for path in paths]
    with pytest.MonkeyPatch.context() as patch:
        # Read by an earlier test.
        patch.setattr(index, "collect", lambda folder, jobs: Collection(tuple(clips)))
        return list(demonstrate(data, tmp_path_factory.mktemp("demo"), jobs=1))


def numbers_in(line: str) -> list[float]:
    return [float(number) for number in re.findall(r"(?<![\w.])[01]?\.\d+", line)]


def test_the_scores_of_the_readme_are_those_of_the_demonstration(demonstration):
    rows = re.findall(r"^\| (.+?) \|(.+)\|$", (ROOT / "README.md").read_text("utf-8"), re.MULTILINE)
    told = {name: numbers_in(cells) for name, cells in rows if numbers_in(cells)}
    said = {
        name: numbers_in(line)
        for name in told
        for line in demonstration
        if line.strip().startswith(name)
    }
    assert len(told) == 2
    assert told == said


def test_explanations_in_the_documentation_are_those_of_the_demonstration(demonstration):
    said = " ".join(" ".join(line.split()) for line in demonstration)
    quoted = 0
    for page in PAGES:
        for quote in re.findall(r"(?:^> .+\n)+", page.read_text("utf-8"), re.MULTILINE):
            packed = " ".join(quote.replace("> ", "").split())
            if "of what the class asks for held" in packed:
                assert packed in said, name_of(page)
                quoted += 1
    assert quoted
