"""Where commands write: never over recordings, over results on request, to stdout on "-"."""

import os
import subprocess
import sys
import time

import pytest

from cli_cases import RATE_HZ, write_bvh, write_examples, write_stream
from motionary.cli import screen
from motionary.cli.query import Moment, parse_moment
from motionary.errors import InvalidInput
from motionary.io import read_labels, write_table
from motionary.recording import Recording
from motionary.samples import synthetic_motion


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    """Examples, a library learned from them, and a recording with several motions."""
    from motionary.models.library import learn

    folder = tmp_path_factory.mktemp("world")
    write_examples(folder / "examples")
    learn(folder / "examples").save(folder / "library")
    write_stream(folder / "take.bvh")
    return folder


@pytest.fixture
def take(tmp_path):
    path = tmp_path / "takes" / "one.bvh"
    path.parent.mkdir()
    write_bvh(synthetic_motion("squat", seed=0, rate_hz=RATE_HZ), path)
    return path


@pytest.mark.parametrize(
    ("name", "make", "arguments"),
    [
        ("labels.csv", "file", ("annotate", "{take}", "--library", "{library}", "-o")),
        ("hits.csv", "file", ("search", "{take}", "--like", "{take}", "--to", "2", "-o")),
        ("info.csv", "file", ("info", "{take}", "-o")),
        ("rig.toml", "file", ("info", "{take}", "--save-mapping")),
        ("take.npz", "file", ("convert", "{take}", "-o")),
        ("features.csv", "file", ("features", "{take}", "-o")),
        ("library", "library", ("learn", "{examples}", "-o")),
        ("merged", "library", ("library", "merge", "{library}", "-o")),
        (
            "query.txt",
            "file",
            ("search", "{take}", "--like", "{take}", "--to", "2", "--save-query"),
        ),
        ("page.html", "file", ("report", "{take}", "-o")),
        ("counts.csv", "file", ("count", "{take}", "--library", "{library}", "-o")),
    ],
)
def test_results_that_are_there_are_replaced_on_request_only(
    motionary, world, tmp_path, name, make, arguments
):
    paths = {key: world / file for key, file in (("take", "take.bvh"), ("library", "library"))}
    paths["examples"] = world / "examples"
    target = tmp_path / name
    kept = target / "library.toml" if make == "library" else target
    kept.parent.mkdir(exist_ok=True)
    kept.write_text("old")
    command = [part.format(**paths) for part in arguments]
    refused = motionary(*command, target)
    assert refused.code == 1
    assert "exists; say --force to replace it" in refused.err
    assert kept.read_text() == "old"
    done = motionary(*command, target, "--force")
    assert done.code == 0, done.err
    assert kept.read_bytes() != b"old"


def test_clips_are_replaced_on_request_only(motionary, world, tmp_path):
    table = tmp_path / "labels.csv"
    table.write_text("recording,label,start_s,end_s\ntake.bvh,a,0,1\ntake.bvh,b,1,2\n")
    command = ("cut", table, world / "take.bvh", "-o", tmp_path / "clips")
    assert motionary(*command).code == 0
    second = tmp_path / "clips" / "take_b_1.00-2.00s.bvh"
    second.write_text("edited by hand")
    (tmp_path / "clips" / "take_a_0.00-1.00s.bvh").unlink()
    refused = motionary(*command)
    assert refused.code == 1
    assert "take_b_1.00-2.00s.bvh: exists; say --force" in refused.err
    assert [path.name for path in (tmp_path / "clips").iterdir()] == [second.name]
    assert motionary(*command, "--force").code == 0
    assert second.read_text() != "edited by hand"


@pytest.mark.parametrize(
    "arguments",
    [
        ("one.bvh", "-o", "one.bvh"),
        (".", "-o", ".", "--to", ".bvh"),
        ("one.bvh", "-o", "hard.bvh"),
        ("one.bvh", "-o", "link.bvh"),
        ("one.bvh", "-o", "../takes/one.bvh"),
    ],
)
def test_a_conversion_never_replaces_its_source(motionary, take, monkeypatch, arguments):
    monkeypatch.chdir(take.parent)
    if "hard.bvh" in arguments:
        (take.parent / "hard.bvh").hardlink_to(take)
    if "link.bvh" in arguments:
        (take.parent / "link.bvh").symlink_to(take.name)
    before = take.read_bytes()
    ran = motionary("convert", *arguments, "--force")
    assert ran.code == 1
    assert "would replace a recording" in ran.err
    assert take.read_bytes() == before


def test_a_conversion_writes_below_its_folder_only(motionary, take, monkeypatch):
    inner = take.parent / "inner"
    inner.mkdir()
    (inner / "one.bvh").write_bytes(take.read_bytes())
    monkeypatch.chdir(inner)
    ran = motionary("convert", "one.bvh", "../one.bvh", "-o", "out", "--to", ".npz")
    assert ran.code == 0, ran.err
    written = sorted(path for path in take.parent.rglob("*.npz"))
    assert len(written) == 2
    assert all(path.is_relative_to(inner / "out") for path in written)


@pytest.mark.parametrize("command", ["annotate", "search", "info"])
@pytest.mark.parametrize("name", ["labels.docx", "labels.json"])
def test_tables_under_the_name_of_another_format_are_refused(
    motionary, world, tmp_path, command, name
):
    options = {
        "annotate": ("--library", world / "library"),
        "search": ("--like", world / "take.bvh", "--to", "2"),
        "info": (),
    }
    ran = motionary(command, world / "take.bvh", *options[command], "-o", tmp_path / name)
    assert ran.code == 2
    words = " ".join(ran.err.split())
    assert (".csv, .tsv, .txt" if command == "info" else "labels.") in words
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["hits.eaf", "hits.TextGrid", "hits.jsonl"])
def test_labels_are_written_for_other_programs(motionary, world, tmp_path, name):
    out = tmp_path / name
    ran = motionary("annotate", world / "take.bvh", "--library", world / "library", "-o", out)
    assert ran.code == 0, ran.err
    ((_, track),) = read_labels(out).items()
    assert len(track) > 0
    several = (world / "examples" / "squat", world / "take.bvh")
    ran = motionary(
        "annotate", *several, "--library", world / "library", "-o", out, "--force"
    )  # fmt: skip
    assert (ran.code == 0) == name.endswith("jsonl")
    assert ("hold one recording" in " ".join(ran.err.split())) != name.endswith("jsonl")


def test_the_library_refuses_such_names_too(tmp_path):
    with pytest.raises(InvalidInput, match=r"\.csv"):
        write_table([["a"]], tmp_path / "a.xlsx")


@pytest.mark.parametrize("command", ["annotate", "search", "info", "count"])
def test_a_dash_sends_the_table_and_nothing_else_to_stdout(
    motionary, world, tmp_path, monkeypatch, command
):
    options = {
        "annotate": ("--library", world / "library"),
        "count": ("--library", world / "library"),
        "search": ("--like", world / "take.bvh", "--to", "2"),
        "info": (),
    }
    given = (command, world / "take.bvh", *options[command], "-o", "-")
    monkeypatch.chdir(tmp_path)
    if command == "info":
        # To a pipe, as the others may be.
        started = [sys.executable, "-m", "motionary", *given]
        out = subprocess.run(started, capture_output=True, text=True, check=True).stdout
    else:
        ran = motionary(*given)
        assert ran.code == 0, ran.err
        out = ran.out
    lines = out.splitlines()
    assert lines[0].startswith("recording,")
    assert {line.count(",") for line in lines} >= {lines[0].count(",")}
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("command", ["annotate", "search", "info", "count"])
def test_json_and_a_table_do_not_share_stdout(motionary, world, command):
    options = {
        "annotate": ("--library", world / "library"),
        "count": ("--library", world / "library"),
        "search": ("--like", world / "take.bvh"),
        "info": (),
    }
    ran = motionary(command, world / "take.bvh", *options[command], "--json", "-o", "-")
    assert (ran.code, ran.out) == (2, "")
    assert "both go to stdout; name a file for one of them" in " ".join(ran.err.split())


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("learn", "{none}", "-o", "{full}"), "holds files but no library"),
        (("library", "merge", "{none}", "-o", "{full}"), "holds files but no library"),
        (
            ("search", "{none}", "--like", "{none}", "--save-class", "{full}"),
            "holds files but no library",
        ),
        (("annotate", "{none}", "-o", "{full}/thesis.csv", "--force"), "it is write-protected"),
        (("report", "{none}", "-o", "{full}/thesis.html", "--force"), "it is write-protected"),
    ],
)
def test_places_that_cannot_be_written_are_told_before_the_work(
    motionary, tmp_path, arguments, words
):
    full = tmp_path / "full"
    full.mkdir()
    for name in ("thesis.csv", "thesis.html"):
        (full / name).write_text("mine")
        (full / name).chmod(0o444)
    ran = motionary(*(part.format(full=full, none=tmp_path / "none.bvh") for part in arguments))
    # The example, the recording or the library that is not there is never looked for.
    assert (ran.code, ran.err.count("\n")) == (1, 1)
    assert words in ran.err
    assert {path.read_text() for path in full.iterdir()} == {"mine"}


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="names of POSIX")
@pytest.mark.parametrize(
    ("name", "kind"),
    [("-", "pipe"), ("-", "terminal"), ("/dev/stdout", "pipe"), ("/dev/stdout", "file")],
)
def test_stdout_under_its_names(tmp_path, name, kind):
    labels = "recording,label,start_s,end_s\nÜbung 1.bvh,a\x1b[2Jb,0.0,0.5\n"
    (tmp_path / "lab els.csv").write_text(labels, "utf-8")
    main_end, terminal = os.openpty() if kind == "terminal" else os.pipe()
    with open(terminal, "wb") if kind != "file" else (tmp_path / "out").open("wb") as target:
        done = subprocess.run(
            [sys.executable, "-m", "motionary", "labels", "convert", "lab els.csv", "-o", name],
            stdout=target, stderr=subprocess.PIPE, check=False, cwd=tmp_path,
            env={**os.environ, "PYTHONIOENCODING": "utf-8"},
        )  # fmt: skip
        assert (done.returncode, done.stderr) == (0, b"")
        if kind == "terminal":
            written = os.read(main_end, 4096).replace(b"\r\n", b"\n")
            # No name of a file's moves the cursor.
            labels = labels.replace("\x1b", "\N{REPLACEMENT CHARACTER}")
    if kind != "terminal":
        written = (tmp_path / "out").read_bytes() if kind == "file" else os.read(main_end, 4096)
    os.close(main_end)
    if kind == "file":
        os.close(terminal)
    assert written.decode("utf-8") == labels


def test_cells_that_excel_would_compute_are_text(tmp_path):
    rows = [["=1+1", "+a", "@b", "-c", "\td", "plain", -0.5, -3, None]]
    write_table(rows, tmp_path / "excel.csv", excel=True)
    assert (tmp_path / "excel.csv").read_text("utf-8-sig").rstrip("\n") == (
        "'=1+1;'+a;'@b;'-c;'\td;plain;-0,5;-3;"
    )
    write_table(rows, tmp_path / "plain.csv")
    assert (tmp_path / "plain.csv").read_text().startswith("=1+1,+a,@b,-c,")


@pytest.mark.parametrize(
    "arguments",
    [
        ("info", "{take}", "--skeleton", "A" * 4000),
        ("info", "A" * 4000 + ".bvh"),
        ("info", "{take}", "--rate", "A" * 4000),
        ("A" * 4000,),
        ("info", "--" + "A" * 4000),
        ("search", "{take}", "--like", "{take}", "--from", "\x1b[2J" + "9" * 4000 + ":x"),
        ("info", "{take}", "-o", "A" * 4000 + ".xlsx"),
    ],
)
def test_lines_about_errors_are_short_and_hold_no_control_characters(motionary, take, arguments):
    ran = motionary(*(part.format(take=take) for part in arguments))
    assert ran.code in (1, 2)
    assert ran.err
    for line in ran.err.splitlines():
        assert len(line) < 500
        assert line.isprintable()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1.5", Moment(1.5)),
        ("0:01.5", Moment(1.5)),
        ("2:03", Moment(123.0)),
        ("1:02:03.5", Moment(3723.5)),
        ("45f", Moment(45, is_frame=True)),
    ],
)
def test_times_as_people_write_them(text, expected):
    assert parse_moment(text) == expected


def test_a_frame_is_the_one_that_the_file_gives_that_number():
    recording = Recording("a.amc", rate_hz=120.0, n_frames=240, first_frame=1)
    assert Moment(61, is_frame=True).seconds_in(recording) == 0.5
    assert Moment(120, is_frame=True).seconds_in(recording, is_end=True) == 1.0
    assert Moment(2.0).seconds_in(recording, is_end=True) == 2.0


@pytest.mark.parametrize("text", ["f", "1:2:3:4", "a:1", "1.5f", "-1:2", "1:"])
def test_other_times_are_refused(motionary, take, text):
    ran = motionary("search", take, "--like", take, "--from", text)
    assert ran.code == 2
    assert "minutes and seconds (0:01.5) or a frame (45f)" in " ".join(ran.err.split())


def test_examples_by_frames_and_by_seconds_are_the_same(motionary, world):
    command = ("search", world / "take.bvh", "--like", world / "take.bvh", "--json", "--no-index")
    rate = synthetic_motion("squat", seed=0, rate_hz=RATE_HZ).rate_hz
    by_frames = motionary(*command, "--from", f"{rate:.0f}f", "--to", f"{2 * rate - 1:.0f}f")
    by_seconds = motionary(*command, "--from", "0:01", "--to", "2.0")
    assert by_frames.code == 0, by_frames.err
    assert by_frames.out == by_seconds.out


def test_off_a_terminal_progress_is_a_line_now_and_then(capsys, monkeypatch):
    now = iter(range(0, 10_000, 10))
    monkeypatch.setattr(time, "monotonic", lambda: float(next(now)))
    with screen.progress("reading", 5) as done:
        for _ in range(5):
            done()
    lines = capsys.readouterr().err.splitlines()
    assert lines == ["motionary: reading: 3 of 5"]


@pytest.mark.parametrize("leftover", [".library-abcd_123.toml"])
def test_what_a_killed_first_save_left_is_no_obstacle(motionary, world, tmp_path, leftover):
    target = tmp_path / "lib"
    target.mkdir()
    (target / leftover).write_text("half")
    os.utime(target / leftover, (1, 1))
    ran = motionary("learn", world / "examples", "-o", target)
    assert ran.code == 0, ran.err
    assert not (target / leftover).exists()
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "thesis.tex").touch()
    assert motionary("learn", world / "examples", "-o", tmp_path / "other").code == 1
