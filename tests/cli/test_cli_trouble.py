"""Commands when something is wrong: what is said, where, and how they end."""

import contextlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

from cli_cases import CLASSES, write_examples, write_stream

COMMAND = [sys.executable, "-m", "motionary"]


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    """Examples, a library learned from them, and a recording with several motions."""
    from motionary.models.library import learn

    folder = tmp_path_factory.mktemp("world")
    write_examples(folder / "examples")
    learn(folder / "examples").save(folder / "library")
    write_stream(folder / "take.bvh")
    return folder


def in_process(*arguments, **options):
    """The command in a process of its own."""
    return subprocess.run(
        [*COMMAND, *map(str, arguments)], capture_output=True, text=True, check=False, **options
    )


def one_line(text):
    """A message is one line, named after the program."""
    return text.startswith("motionary: ") and text.count("\n") == 1


# -- wrong use: 2, and nothing is done ----------------------------------------------------

LIKE = ("search", "{world}/examples", "--like", "{world}/take.bvh")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("annotate",), "Missing argument 'FILE'"),
        (("depth", "track"), "Missing argument 'IMAGES'"),
        (("search", "{world}/examples"), "--like"),
        ((*LIKE, "--class", "squat"), "--like, --class"),
        (("search", "{world}", "--class", "squat", "--library", "none"), "--library LIB"),
        (
            ("search", "{world}", "--class", "sqat", "--library", "{world}/library"),
            "did you mean 'squat'?",
        ),
        (("search", "{world}", "--class", "squat", "--library", "l", "--from", "1"), "--from"),
        ((*LIKE, "--library", "{world}/library"), "--library"),
        ((*LIKE, "--from", "99"), "take.bvh lasts from 0 to "),
        ((*LIKE, "--from", "-1"), "take.bvh lasts from 0 to "),
        ((*LIKE, "--to", "99"), "take.bvh lasts from 0 to "),
        ((*LIKE, "--from", "nan"), "take.bvh lasts from 0 to "),
        ((*LIKE, "--from", "2", "--to", "1"), "must come after --from, got 2 to 1"),
        ((*LIKE, "--from", "2", "--to", "2.2"), "at least 0.3 s"),
        ((*LIKE, "--sheet", "hits.bmp"), ".png, .svg, .pdf"),
        ((*LIKE, "--jobs", "0"), "--jobs"),
        ((*LIKE, "--expand", "-1"), "--expand"),
        ((*LIKE, "--skeleton", "nobody"), "cmu_bvh"),
        ((*LIKE, "--unit", "furlong"), "inch"),
        ((*LIKE, "--rate", "0"), "--rate: rate_hz must be a positive number"),
        ((*LIKE, "--asf", "none.asf"), "none.asf: no such file"),
        ((*LIKE, "--fill-by", "linear"), "--fill-by: goes with --fill-gaps SECONDS"),
        ((*LIKE, "--excel"), "--excel: goes with --output CSV"),
        (("info", "{world}/take.bvh", "--excel"), "--excel: goes with --output CSV"),
        (("annotate", "{world}/take.bvh", "--library", "l", "--excel"), "goes with --output CSV"),
        (("annotate", "{world}/take.bvh", "--plot", "a.png"), "needs a folder, for a picture"),
        (("search", "{world}", "--query", "none.json"), "none.json: no such file"),
        (
            ("search", "{world}", "--query", "none.json", "--query-name", "a"),
            "none.json: no such file",
        ),
        (("annotate", "{world}/take.bvh", "--library", "none"), "motionary learn EXAMPLES -o LIB"),
        (("annotate", "{world}/take.bvh", "--library", "l", "--threshold", "-1"), "--threshold"),
        (("learn", "{world}/examples"), "--output"),
        (("count", "{world}/take.bvh", "-o", "x.eaf"), "written as .csv, .tsv, .txt"),
        (("features", "{world}/take.bvh", "-o", "x.xls"), ".npz, .parquet or .csv"),
        (("features", "{world}/take.bvh", "-o", "-"), "a file, not stdout"),
        (("evaluate", "x.csv", "--truth", "y.csv", "--rename", "=b"), "NAME=NEW"),
        (("serch", "{world}"), "serch"),
    ],
)
def test_wrong_use(motionary, world, arguments, words):
    ran = motionary(*(argument.format(world=world) for argument in arguments))
    assert (ran.code, ran.out) == (2, "")
    assert words in " ".join(ran.err.split())
    assert "Traceback" not in ran.err


# -- wrong input: 1, one line ---------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("search", "{world}/examples", "--like", "{world}/none.bvh"), "none.bvh"),
        (("annotate", "{world}/none.bvh", "--library", "{world}/library"), "no such file"),
        (("annotate", "{tmp}", "--library", "{world}/library"), "no recordings in this folder"),
        (("features", "{tmp}/none", "-o", "x.npz"), "none: no such file or folder"),
        (("features", "{tmp}", "-o", "x.npz"), "no recordings in this folder"),
        (("search", "{world}/examples", "--like", "{tmp}"), "but a folder; name a file in it"),
        (("labels", "stats", "{tmp}"), "but a folder; name a file in it"),
        (("learn", "{world}/take.bvh", "-o", "{tmp}/x"), "take.bvh: is no folder"),
        (("annotate", "{world}/take.bvh", "--library", "{tmp}"), "no library there"),
        (("annotate", "{world}/*.amc", "--library", "{world}/library"), "a name like this"),
        (("learn", "{tmp}", "-o", "{tmp}/lib"), "no examples found"),
        (("learn", "{tmp}/none", "-o", "{tmp}/lib"), "no such folder"),
        (("features", "{world}/none.bvh", "-o", "{tmp}/x.npz"), "none.bvh"),
        (("evaluate", "{tmp}/x.csv", "--truth", "{tmp}/y.csv"), "x.csv"),
    ],
)
def test_wrong_paths(motionary, world, tmp_path, arguments, words):
    ran = motionary(*(argument.format(world=world, tmp=tmp_path) for argument in arguments))
    assert (ran.code, ran.out) == (1, "")
    assert one_line(ran.err)
    assert words in ran.err


@pytest.mark.parametrize(
    "arguments",
    [
        (*LIKE, "--sheet", "{tmp}/file/hits.png"),
        (*LIKE, "--template", "{tmp}/file/deep/template.png"),
        ("annotate", "{world}/take.bvh", "--library", "{world}/library", "-o", "{tmp}/file/x.csv"),
        ("annotate", "{world}/take.bvh", "--library", "{world}/library", "--plot", "{tmp}/file/p"),
        ("annotate", "{world}/take.bvh", "--library", "{world}/library", "-o", "{tmp}/folder.csv"),
        ("annotate", "{world}/take.bvh", "--library", "{world}/library", "--plot", "{tmp}/file"),
        ("learn", "{world}/examples", "-o", "{tmp}/file/lib"),
        ("learn", "{world}/examples", "-o", "{tmp}/file"),
        ("features", "{world}/take.bvh", "-o", "{tmp}/file/x.npz"),
        ("features", "{world}/take.bvh", "-o", "{tmp}/folder.npz"),
    ],
)
def test_results_that_cannot_be_written(motionary, world, tmp_path, arguments):
    (tmp_path / "file").write_text("mine")
    for name in ("folder.csv", "folder.npz"):
        (tmp_path / name).mkdir()
    ran = motionary(*(argument.format(world=world, tmp=tmp_path) for argument in arguments))
    assert ran.code == 1
    assert one_line(ran.err)
    assert (tmp_path / "file").read_text() == "mine"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "folder.csv", "folder.npz"]


@pytest.fixture
def batch(world, tmp_path):
    """A good recording, a broken one, one of an unknown kind, and one that is not there."""
    shutil.copy(world / "take.bvh", tmp_path / "good.bvh")
    (tmp_path / "broken.bvh").write_bytes((world / "take.bvh").read_bytes()[:5000])
    (tmp_path / "notes.txt").write_text("not a motion")
    return [tmp_path / name for name in ("broken.bvh", "good.bvh", "notes.txt", "gone.bvh")]


@pytest.mark.parametrize(
    "arguments",
    [
        ("annotate", "--library", "{world}/library", "--json"),
        ("search", "--like", "{world}/take.bvh", "--to", "1", "--json"),
    ],
)
def test_a_batch_with_broken_files_finishes(motionary, world, batch, arguments):
    command, *options = (argument.format(world=world) for argument in arguments)
    ran = motionary(command, *batch, *options)
    assert ran.code == 1
    assert {json.loads(line)["recording"] for line in ran.out.splitlines()} == {"good.bvh"}
    assert len(ran.err.splitlines()) == 3
    assert all(any(name in line for line in ran.err.splitlines())
               for name in ("broken.bvh", "notes.txt", "gone.bvh"))  # fmt: skip


def test_a_broken_example_leaves_the_others(motionary, world, tmp_path):
    examples = tmp_path / "examples"
    shutil.copytree(world / "examples", examples)
    (examples / "squat" / "squat 1.bvh").write_text("nonsense")
    (examples / "bow").mkdir()
    (examples / "bow" / "one.bvh").write_text("nonsense")
    ran = motionary("learn", examples, "-o", tmp_path / "lib", "--json")
    assert ran.code == 1
    rows = {row["class"]: row["examples"] for row in map(json.loads, ran.out.splitlines())}
    assert rows == {"kick_left": 3, "squat": 2, "wave_right": 3}
    assert "squat 1.bvh: " in ran.err
    assert "class 'bow': none of its examples could be read" in ran.err
    assert (tmp_path / "lib" / "library.toml").exists()


def test_a_class_of_one_example_is_learned_with_a_warning(motionary, world, tmp_path):
    shutil.copytree(world / "examples" / "squat", tmp_path / "examples" / "squat")
    for path in sorted((tmp_path / "examples" / "squat").iterdir())[1:]:
        path.unlink()
    ran = motionary("learn", tmp_path / "examples", "-o", tmp_path / "lib", "--calibrate")
    assert ran.code == 0
    assert "class 'squat': one example: too few" in ran.err
    assert "too little to calibrate its threshold by; it stays 0.06" in ran.err
    assert "100 %" in ran.out


def test_a_class_whose_examples_share_nothing_is_left_out(motionary, world, tmp_path):
    examples = tmp_path / "examples"
    shutil.copytree(world / "examples" / "squat", examples / "squat")
    write_rootlings(examples / "nothing")
    ran = motionary("learn", examples, "-o", tmp_path / "lib", "--skeleton", "generic", "--json")
    assert ran.code == 1
    assert [json.loads(line)["class"] for line in ran.out.splitlines()] == ["squat"]
    assert "class 'nothing' is left out: " in ran.err
    shutil.rmtree(examples / "squat")
    ran = motionary("learn", examples, "-o", tmp_path / "lib2", "--skeleton", "generic")
    assert ran.code == 1
    assert "nothing was written" in ran.err
    assert not (tmp_path / "lib2").exists()


def write_rootlings(folder):
    """Files in which, taken as generic skeletons, only the root is there: a rod has no limbs."""
    folder.mkdir(parents=True)
    for seed in range(2):
        places = np.random.default_rng(seed).normal(scale=10.0, size=(60, 3)).cumsum(axis=0)
        frames = "\n".join(f"{x:.4f} {y:.4f} {z:.4f} 0 0 0" for x, y, z in places)
        (folder / f"{seed}.bvh").write_text(f"""HIERARCHY
ROOT root
{{
 OFFSET 0 0 0
 CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
 JOINT rod
 {{
  OFFSET 0 100 0
  CHANNELS 0
  End Site
  {{
   OFFSET 0 80 0
  }}
 }}
}}
MOTION
Frames: 60
Frame Time: 0.0333333
{frames}
""")


def test_recordings_beside_the_class_folders_are_told(motionary, world, tmp_path):
    shutil.copytree(world / "examples", tmp_path / "examples")
    shutil.copy(world / "take.bvh", tmp_path / "examples" / "stray.bvh")
    ran = motionary("learn", tmp_path / "examples", "-o", tmp_path / "lib")
    assert ran.code == 1
    assert "stray.bvh: in no class" in ran.err


def test_a_library_without_classes(motionary, world, tmp_path):
    from motionary.models.library import ClassLibrary

    ClassLibrary(()).save(tmp_path / "empty")
    ran = motionary("annotate", world / "take.bvh", "--library", tmp_path / "empty")
    assert (ran.code, ran.out) == (1, "")
    assert one_line(ran.err)
    assert "no classes" in ran.err


# -- names and screens ----------------------------------------------------------------------


def test_names_with_spaces_and_letters_of_the_world(motionary, world, tmp_path):
    name = 'Übung 1 – 走る, "quer".bvh'
    shutil.copy(world / "take.bvh", tmp_path / name)
    ran = motionary("annotate", tmp_path, "--library", world / "library", "--threshold", 0.15,
                    "-o", tmp_path / "labels.csv")  # fmt: skip
    assert ran.code == 0, ran.err
    assert name in ran.out
    (track,) = map(json.loads, motionary("annotate", tmp_path, "--library", world / "library",
                                         "--json").out.splitlines())  # fmt: skip
    assert track["recording"] == name
    assert '"Übung 1 – 走る, ""quer"".bvh",' in (tmp_path / "labels.csv").read_text("utf-8")


def test_columns_stay_aligned_below_wide_letters(motionary, world, tmp_path):
    for name in ("走る.bvh", "run.bvh"):
        shutil.copy(world / "take.bvh", tmp_path / name)
    header, *rows = motionary("info", tmp_path).out.splitlines()[:3]
    assert [row.replace("走る", "run!").index("generic") for row in rows] == [
        header.index("skeleton")
    ] * 2


def test_names_cannot_move_the_cursor(motionary, world, tmp_path):
    shutil.copy(world / "take.bvh", tmp_path / "a\x1b[2Jb\n.bvh")
    ran = motionary("info", tmp_path)
    assert "\x1b" not in ran.out
    assert "a\N{REPLACEMENT CHARACTER}[2Jb" in ran.out


def test_a_terminal_that_lacks_letters_ends_no_command(world, tmp_path):
    shutil.copy(world / "take.bvh", tmp_path / "走る.bvh")
    ran = in_process("info", tmp_path, env={**os.environ, "PYTHONIOENCODING": "ascii"})
    assert ran.returncode == 0, ran.stderr
    assert "\\u8d70" in ran.stdout


# -- processes ------------------------------------------------------------------------------


def test_the_help_loads_nothing_heavy():
    code = (
        "import sys; sys.argv = ['motionary', '--help']\n"
        "from motionary.cli import main\n"
        "heavy = {'numpy', 'scipy', 'matplotlib', 'rich', 'numba'}\n"
        "try: main()\n"
        "finally: print(sorted(heavy & set(sys.modules)))"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert ran.stdout.splitlines()[-1] == "[]"


@pytest.mark.usefixtures("two_processes")
def test_two_processes_give_what_one_gives(motionary, world):
    for command in (
        ("annotate", world / "examples" / "squat", "--library", world / "library", "--json"),
        ("search", world / "examples" / "squat", "--like", world / "take.bvh", "--to", "2"),
    ):
        one, two = (motionary(*command, "--jobs", n) for n in (1, 2))
        assert one.code == two.code == 0, two.err
        assert one.out == two.out
        assert one.err == two.err == ""


@pytest.mark.skipif(os.name == "nt", reason="pipes close otherwise there")
def test_a_reader_that_leaves_ends_the_command_quietly(world):
    command = [*COMMAND, "info", str(world / "examples"), "--json"]
    reader, writer = os.pipe()
    process = subprocess.Popen(command, stdout=writer, stderr=subprocess.PIPE, text=True)
    os.close(writer)
    os.close(reader)
    _, errors = process.communicate(timeout=60)
    assert (process.returncode, errors) == (0, "")


@pytest.mark.skipif(os.name == "nt", reason="signals are sent otherwise there")
def test_the_keyboard_stops_a_command_quietly(world, tmp_path):
    n_takes, results = 300, tmp_path / "out"
    (tmp_path / "takes").mkdir()
    for number in range(n_takes):
        (tmp_path / "takes" / f"{number}.bvh").hardlink_to(world / "take.bvh")
    process = subprocess.Popen(
        [*COMMAND, "convert", str(tmp_path / "takes"), "-o", str(results), "--to", ".npz"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    # It is at work once the first result is there.
    while process.poll() is None and not list(results.glob("[!.]*")):
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    out, errors = process.communicate(timeout=60)
    assert (process.returncode, out, errors) == (130, "", "")
    assert len(list(results.iterdir())) < n_takes


def on_terminal(*arguments, stream, columns=80):
    """What a command prints with one of its streams on a terminal, and the other stream."""
    main_end, terminal = os.openpty()
    chunks = []

    def drain():
        # The other end is closed by an error on Linux, by nothing more to read elsewhere.
        with contextlib.suppress(OSError):
            while chunk := os.read(main_end, 4096):
                chunks.append(chunk)

    reader = threading.Thread(target=drain)
    reader.start()
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, stream: terminal}
    env = {**os.environ, "COLUMNS": str(columns), "TERM": "xterm"}
    process = subprocess.Popen([*COMMAND, *map(str, arguments)], **streams, env=env, text=True)
    other = "".join(text or "" for text in process.communicate(timeout=100))
    os.close(terminal)
    reader.join(timeout=20)
    os.close(main_end)
    return b"".join(chunks).decode().replace("\r\n", "\n"), other


needs_terminal = pytest.mark.skipif(not hasattr(os, "openpty"), reason="needs a terminal")


@needs_terminal
def test_bars_are_drawn_on_a_terminal_only(motionary, world):
    drawn, out = on_terminal("info", world / "examples", stream="stderr")
    assert "reading" in drawn
    quiet = motionary("info", world / "examples")
    assert (quiet.out, quiet.err) == (out, "")
    assert quiet.out.count(".bvh") >= 3 * len(CLASSES)


@needs_terminal
def test_a_table_fits_a_narrow_terminal_and_loses_nothing(motionary, world, tmp_path):
    name = "a recording with a rather long name.bvh"
    shutil.copy(world / "take.bvh", tmp_path / name)
    command = ("annotate", tmp_path, "--library", world / "library", "--explain")
    wide = motionary(*command).out.splitlines()
    shown, _ = on_terminal(*command, stream="stdout", columns=64)
    narrow = re.sub(r"\x1b\[[\d;?]*[a-zA-Z]", "", shown).splitlines()
    assert max(map(len, wide)) > 64
    assert max(len(line.rstrip()) for line in narrow) <= 64
    assert "".join(sorted("".join(wide).replace(" ", ""))) == "".join(
        sorted("".join(narrow).replace(" ", ""))
    )
    # Numbers stay whole: each row of the wide table begins a row of the narrow one.
    numbers = [re.findall(r"\d+\.\d+", line) for line in wide if line.startswith(name)]
    assert [re.findall(r"\d+\.\d+", line) for line in narrow if line.startswith("a rec")] == numbers


@needs_terminal
def test_on_a_very_narrow_terminal_rows_become_lines(world):
    shown, _ = on_terminal("info", world / "take.bvh", stream="stdout", columns=40)
    lines = re.sub(r"\x1b\[[\d;?]*[a-zA-Z]", "", shown).splitlines()
    table = [line.rstrip() for line in lines[: lines.index("")]]
    assert table[0] == "recording take.bvh"
    assert max(map(len, table)) <= 40
    assert "skeleton generic" in " ".join(" ".join(table).split())


def test_lists_of_commands_cut_no_sentence(motionary):
    for group in ((), ("labels",), ("library",)):
        listed = motionary(*group, "--help").out.partition("Commands:")[2]
        assert listed
        assert "..." not in listed


# -- manners --------------------------------------------------------------------------------


def test_help_and_version_are_commands_too(motionary):
    assert motionary("help").out == motionary("--help").out
    assert motionary("help", "library", "edit").out == motionary("library", "edit", "-h").out
    assert motionary("version").out == motionary("--version").out
    ran = motionary("help", "serch")
    assert (ran.code, ran.out) == (2, "")
    assert "no command 'serch'" in ran.err


def test_shells_complete_commands_and_options():
    env = {**os.environ, "_MOTIONARY_COMPLETE": "complete_bash", "COMP_CWORD": "1"}
    ran = in_process(env={**env, "COMP_WORDS": "motionary du"})
    assert ran.stdout.split() == ["duplicates"]
    ran = in_process(env={**env, "COMP_WORDS": "motionary search --rel", "COMP_CWORD": "2"})
    assert ran.stdout.split() == ["--relevant"]


def test_former_names_of_options_stay(motionary, world):
    like = ("search", world / "examples", "--like", world / "examples/squat/squat 0.bvh", "--json")
    now = motionary(*like, "--relevant", "1,2", "--irrelevant", 4, "--expand", 2)
    assert now.code == 0
    assert motionary(*like, "--good=1,2", "--bad", 4, "--grow", 2) == now
    assert "--good" not in motionary("search", "--help").out
    ran = motionary("learn", world / "examples", "-o", "x", "--suggest", "--threshold", 1)
    assert "--threshold, --calibrate: thresholds are given or chosen" in ran.err


def test_too_little_memory_is_one_line(capsys):
    from motionary.cli.app import _attempt

    assert _attempt(lambda: np.ones(1 << 60, np.uint8), {}) == 1
    assert capsys.readouterr().err == (
        "motionary: there is not enough memory for this; give fewer or shorter recordings\n"
    )


@pytest.mark.parametrize(
    "arguments",
    [
        ("learn", "{world}/examples", "-o", "everyday"),
        ("library", "edit", "everyday", "squat", "--threshold", "0.1"),
        ("library", "add", "./everyday", "squat", "{world}/examples"),
        ("library", "merge", "{world}/library", "-o", "everyday"),
        ("search", "{world}", "--like", "{world}/take.bvh", "--save-class", "everyday"),
    ],
)
def test_no_command_makes_a_folder_that_hides_the_library_that_ships(
    motionary, world, tmp_path, monkeypatch, arguments
):
    monkeypatch.chdir(tmp_path)
    ran = motionary(*(a.format(world=world) for a in arguments))
    assert (ran.code, ran.out) == (2, "")
    assert "the library that ships stays as it is; name another folder" in ran.err
    assert not (tmp_path / "everyday").exists()


def test_a_folder_that_hides_the_library_that_ships_is_told(motionary, tmp_path, monkeypatch):
    from motionary.features import FULL_BODY
    from motionary.models.library import ClassLibrary

    monkeypatch.chdir(tmp_path)
    ClassLibrary((), FULL_BODY).save("everyday")
    ran = motionary("library", "list", "everyday", "--json")
    assert (ran.code, ran.out) == (0, "")
    assert ran.err.count("the folder ./everyday is used, not the library of that name") == 1
    assert motionary("library", "list", "./everyday", "--json").err == ""


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("annotate", ""), "'FILE'"),
        (("search", "", "--class", "squat"), "'FOLDER'"),
        (("annotate", "x.bvh", "--output="), "'--output'"),
        (("library", "list", ""), "'LIB'"),
    ],
)
def test_an_empty_argument_is_named(motionary, arguments, named):
    ran = motionary(*arguments)
    assert (ran.code, ran.out) == (2, "")
    assert named in ran.err
    assert "must not be empty" in ran.err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("annotate", "hd", "--threshold", "6"), "--assignment scores"),
        (("index", "x", "--features", "published"), "--features: no set 'published'"),
        (("library", "show", "everyday"), "`motionary library list everyday`"),
    ],
)
def test_wrong_use_says_what_to_do(motionary, tmp_path, monkeypatch, arguments, message):
    monkeypatch.chdir(tmp_path)
    ran = motionary(*arguments)
    assert (ran.code, ran.out) == (2, "")
    assert message in ran.err


def test_the_folder_that_was_read_is_no_place_for_what_is_untangled(motionary, tmp_path):
    (tmp_path / "pose").mkdir()
    (tmp_path / "pose" / "x.json").write_text("{}")
    (tmp_path / "c.toml").write_text("")
    ran = motionary("untangle", tmp_path / "pose", "-o", tmp_path / "pose",
                    "--cameras", tmp_path / "c.toml", "--rate", 60)  # fmt: skip
    assert (ran.code, ran.out) == (1, "")
    assert "give another folder" in ran.err
    assert "--force" not in ran.err
