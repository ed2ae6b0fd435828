"""Commands on small synthetic recordings: what people and programs get to see."""

import csv
import json
import re
import shutil

import numpy as np
import pytest

from cli_cases import (
    CLASSES,
    EXAMPLES,
    RATE_HZ,
    documented_keys,
    write_bvh,
    write_examples,
    write_stream,
)
from motionary.cli.app import COMMANDS
from motionary.features import compute_features
from motionary.io import read, read_labels, write
from motionary.samples import synthetic_motion

LABEL_KEYS = {
    "label", "start_s", "end_s", "start_frame", "end_frame", "cost", "known", "score",
    "probability", "false_per_min", "side",
}  # fmt: skip
HIT_KEYS = {"recording", "start_s", "end_s", "start_frame", "end_frame", "cost", "known"}


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    """Examples of three classes, and one recording with several motions."""
    folder = tmp_path_factory.mktemp("world")
    write_examples(folder / "examples")
    segments = write_stream(folder / "takes" / "take one.bvh")
    (folder / "stretches.json").write_text(json.dumps(segments))
    return folder


@pytest.fixture(scope="module")
def library(world):
    """The classes, learned."""
    from motionary.models.library import learn

    learn(world / "examples").save(world / "library")
    return world / "library"


def stretch_of(world, name):
    segments = json.loads((world / "stretches.json").read_text())
    return next((start, end) for label, start, end in segments if label == name)


def json_lines(text):
    return [json.loads(line) for line in text.splitlines()]


def overlaps(found, wanted):
    return min(found[1], wanted[1]) - max(found[0], wanted[0]) > 0.5 * (wanted[1] - wanted[0])


# -- help -------------------------------------------------------------------------------


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help_with_an_example(motionary, command):
    ran = motionary(command, "--help")
    assert ran.code == 0
    assert f"motionary {command} " in ran.out.split("Options:")[0].split("\n\n", 1)[1]


def test_the_help_names_every_command(motionary):
    ran = motionary("--help")
    assert ran.code == 0
    listed = ran.out.split("Commands:")[1].splitlines()
    # Summaries go on in lines that begin further to the right.
    assert [line.split()[0] for line in listed if line[:3].strip()] == list(COMMANDS)


def test_the_help_shows_the_defaults_of_the_library(motionary):
    from motionary.models.library import TrainingOptions
    from motionary.retrieval.search import QueryExpansion

    assert f"[default: {QueryExpansion().hits}" in motionary("search", "--help").out
    assert f"{TrainingOptions().tolerance};" in re.sub(
        r"\s+", " ", motionary("learn", "--help").out
    )


def test_the_version_is_told(motionary):
    import motionary as package

    assert motionary("--version").out == f"motionary {package.__version__}\n"


# -- search -----------------------------------------------------------------------------


def test_an_example_finds_its_kind(motionary, world):
    like = world / "examples" / "squat" / "squat 0.bvh"
    ran = motionary("search", world / "examples", "--like", like, "--limit", 3, "--json")
    assert ran.code == 0, ran.err
    hits = json_lines(ran.out)
    assert [set(hit) for hit in hits] == [HIT_KEYS] * 3
    assert [hit["recording"].split("/")[0] for hit in hits] == ["squat"] * 3
    assert [hit["cost"] for hit in hits] == sorted(hit["cost"] for hit in hits)


def test_seconds_cut_the_example_out_of_a_recording(motionary, world):
    start, end = stretch_of(world, "kick_left")
    take = world / "takes" / "take one.bvh"
    ran = motionary(
        "search", world / "examples", "--like", take, "--from", start, "--to", end,
        "--limit", 3, "--json",
    )  # fmt: skip
    assert {hit["recording"].split("/")[0] for hit in json_lines(ran.out)} == {"kick_left"}


def test_the_example_is_found_in_its_own_recording(motionary, world):
    start, end = stretch_of(world, "squat")
    take = world / "takes" / "take one.bvh"
    ran = motionary(
        "search", take, "--like", take, "--from", start, "--to", end, "--expand", 0,
        "--limit", 1, "--json",
    )  # fmt: skip
    (hit,) = json_lines(ran.out)
    assert hit["cost"] == 0
    assert overlaps((hit["start_s"], hit["end_s"]), (start, end))


def test_the_template_is_told_in_words_above_the_hits(motionary, world):
    like = world / "examples" / "squat" / "squat 0.bvh"
    ran = motionary("search", world / "examples", "--like", like)
    words, table, comparison = ran.out.split("\n\n")
    assert words.startswith("template: ")
    assert re.match(r"   2  alike: \w.*\n      differs: \w", comparison)
    assert re.search(r"holds +\d", words)
    assert "right and left knee bent" in words
    assert "varies" in words
    header, *rows = table.splitlines()
    assert header.split() == ["rank", "recording", "start_s", "end_s", "frames", "cost", "known"]
    assert rows[0].split()[0] == "1"


def test_a_lone_example_says_that_nothing_taught_it(motionary, world):
    start, end = stretch_of(world, "kick_left")
    take = world / "takes" / "take one.bvh"
    ran = motionary("search", take, "--like", take, "--from", start, "--to", end)
    assert "nothing was near enough to learn from" in ran.out


def test_pictures_of_hits_and_template(motionary, world, tmp_path):
    like = world / "examples" / "squat" / "squat 0.bvh"
    sheet, template = tmp_path / "new" / "hits.png", tmp_path / "template.svg"
    ran = motionary(
        "search", world / "examples", "--like", like, "--limit", 2, "--sheet", sheet,
        "--template", template,
    )  # fmt: skip
    assert ran.code == 0, ran.err
    assert sheet.read_bytes().startswith(b"\x89PNG")
    assert b"<svg" in template.read_bytes()


def test_a_class_finds_its_own(motionary, world, library, tmp_path):
    sheet = tmp_path / "hits.png"
    ran = motionary(
        "search", world / "examples", world / "takes", "--class", "squat", "--library", library,
        "--sheet", sheet, "--json",
    )  # fmt: skip
    recordings = [hit["recording"] for hit in json_lines(ran.out)]
    assert ran.code == 0
    assert {f"squat/squat {seed}.bvh" for seed in range(EXAMPLES)} <= set(recordings)
    assert sheet.exists()


def test_no_hit_names_the_nearest_and_why(motionary, world, library):
    arguments = (
        "search",
        world / "examples" / "kick_left",
        "--class",
        "squat",
        "--library",
        library,
    )
    ran = motionary(*arguments)
    assert ran.code == 1
    assert re.match(
        r"nothing below 0\.\d+; nearest: kick_left \d\.bvh 0\.\d+ at .*failed: ", ran.out
    )
    ran = motionary(*arguments, "--json")
    assert (ran.code, ran.out) == (1, "")
    assert "nearest: kick_left" in ran.err


def test_limit_0_is_all_hits(motionary, world):
    like = world / "examples" / "squat" / "squat 0.bvh"
    few = motionary("search", world / "examples", "--like", like, "--json", "--limit", 2)
    every = motionary("search", world / "examples", "--like", like, "--json", "--limit", 0)
    assert len(json_lines(few.out)) == 2
    assert len(json_lines(every.out)) >= len(CLASSES) * EXAMPLES


# -- annotate ---------------------------------------------------------------------------


def test_labels_of_a_recording(motionary, world, library):
    ran = motionary(
        "annotate", world / "takes", "--library", library, "--threshold", 0.15, "--json"
    )
    assert ran.code == 0, ran.err
    (track,) = json_lines(ran.out)
    assert set(track) == {"recording", "rate_hz", "labels", "unassessed", "nearest"}
    assert track["nearest"] is None
    assert (track["recording"], track["rate_hz"], track["unassessed"]) == (
        "take one.bvh", pytest.approx(RATE_HZ), [],
    )  # fmt: skip
    assert all(set(label) == LABEL_KEYS for label in track["labels"])
    found = [(x["label"], overlaps((x["start_s"], x["end_s"]), stretch_of(world, x["label"])))
             for x in track["labels"] if x["label"] in ("squat", "kick_left")]  # fmt: skip
    assert ("squat", True) in found
    assert ("kick_left", True) in found


def test_the_table_of_labels_is_what_json_says(motionary, world, library, tmp_path):
    arguments = ("annotate", world / "takes", "--library", library, "--threshold", 0.15)
    track = json_lines(motionary(*arguments, "--json").out)[0]
    ran = motionary(*arguments, "-o", tmp_path / "new" / "labels.csv", "--explain")
    written = read_labels(tmp_path / "new" / "labels.csv")
    assert list(written) == ["take one.bvh"]
    assert [(x.name, x.start_s, x.end_frame) for x in written["take one.bvh"]] == [
        (x["label"], x["start_s"], x["end_frame"]) for x in track["labels"]
    ]
    assert ran.out.count("held: ") == len(track["labels"])


def test_explanations_in_json(motionary, world, library):
    ran = motionary("annotate", world / "takes", "--library", library, "--explain", "--json",
                    "--threshold", 0.15)  # fmt: skip
    assert all("held: " in x["explanation"] for x in json_lines(ran.out)[0]["labels"])


def test_a_recording_without_labels_says_what_was_nearest(motionary, world, tmp_path, library):
    write_bvh(synthetic_motion("bow", seed=4, rate_hz=RATE_HZ), tmp_path / "bow.bvh")
    ran = motionary("annotate", tmp_path, "--library", library, "--assignment", "published")
    assert ran.code == 0
    assert re.search(r"bow\.bvh +\(none\)\n  nothing below 0\.\d+; nearest: ", ran.out)
    scored = motionary("annotate", tmp_path, "--library", library)
    assert re.search(r"bow\.bvh +\(none\)\n  nothing that scores; nearest: ", scored.out)


def test_labels_by_scores_are_counted(motionary, world, library, tmp_path):
    arguments = ("--library", library, "--assignment", "scores")
    (track,) = json_lines(motionary("annotate", world / "takes", *arguments, "--json").out)
    assert track["labels"]
    assert all(x["score"] >= 6 and x["false_per_min"] is None for x in track["labels"])
    names = [x["label"] for x in track["labels"]]
    ran = motionary("count", world / "takes", *arguments, "--json", "-o", tmp_path / "counts.csv")
    assert ran.code == 0, ran.err
    rows = json_lines(ran.out)
    assert {row["label"]: row["number"] for row in rows} == {n: names.count(n) for n in names}
    assert [len(row["starts_s"]) for row in rows] == [row["number"] for row in rows]
    keys = documented_keys("`motionary count --json` gives")
    assert all(list(row) == keys for row in rows)
    lines = (tmp_path / "counts.csv").read_text("utf-8").splitlines()
    assert lines[0] == "recording,label,side,number,mean_s,total_s,per_min,unassessed_s"
    assert len(lines) == len(rows) + 1
    table = motionary("annotate", world / "takes", *arguments, "--count").out
    assert table.splitlines()[0].split() == lines[0].split(",")


def test_expected_false_labels_need_a_library_that_knows_them(motionary, world, library):
    arguments = ("annotate", world / "takes", "--library", library, "--at-most-false", 1)
    ran = motionary(*arguments)
    assert ran.code == 1
    assert "how many false labels to expect" in ran.err
    for wrong in (("--threshold", 7), ("--assignment", "published")):
        assert motionary(*arguments, *wrong).code == 2


def test_pictures_of_labels(motionary, world, library, tmp_path):
    ran = motionary("annotate", world / "takes", "--library", library, "--plot", tmp_path / "p")
    assert ran.code == 0, ran.err
    assert [path.name for path in (tmp_path / "p").iterdir()] == ["take_one.bvh.png"]


def test_stretches_that_were_not_seen_are_told(motionary, library, tmp_path):
    blind = synthetic_motion("squat", seed=0, rate_hz=RATE_HZ)
    path = tmp_path / "blind.bvh"
    write_bvh(blind, path)
    # A file that has next to nothing: most relations are unknown throughout.
    text = path.read_text()
    for name in ("belly", "lshoulder", "rshoulder", "neck", "head", "chest", "lknee", "rknee"):
        text = re.sub(rf"\b{name}\b", f"stranger_{name}", text)
    path.write_text(text)
    ran = motionary("annotate", path, "--library", library, "--skeleton", "generic", "--json")
    (track,) = json_lines(ran.out)
    (segment,) = track["unassessed"]
    assert segment == {"start_s": 0.0, "end_s": pytest.approx(blind.duration_s, abs=1e-4)}
    shown = motionary("annotate", path, "--library", library, "--skeleton", "generic").out
    assert "(too little seen)" in shown


# -- learn ------------------------------------------------------------------------------


def test_learning_tells_each_class(motionary, world, tmp_path):
    ran = motionary("learn", world / "examples", "-o", tmp_path / "lib", "--mirror", "--json")
    assert (ran.code, ran.err) == (0, "")
    rows = json_lines(ran.out)
    assert {(row["class"], row["examples"]) for row in rows} == {(n, EXAMPLES) for n in CLASSES}
    assert len(rows) == 2 * len(CLASSES)
    assert all(0 < row["fixed"] <= 1 and row["seconds"] > 0.3 for row in rows)


def test_pictures_of_templates(motionary, world, tmp_path):
    shutil.copytree(world / "examples" / "squat", tmp_path / "examples" / "squat")
    ran = motionary(
        "learn", tmp_path / "examples", "-o", tmp_path / "lib", "--plot", tmp_path / "p"
    )
    assert ran.code == 0, ran.err
    assert [path.name for path in (tmp_path / "p").iterdir()] == ["squat.png"]


def test_a_learned_library_is_the_one_of_the_call(motionary, world, library, tmp_path):
    assert motionary("learn", world / "examples", "-o", tmp_path / "lib").code == 0
    contents = [
        {path.name: path.read_bytes() for path in folder.iterdir()}
        for folder in (library, tmp_path / "lib")
    ]
    assert contents[0] == contents[1]


def test_options_reach_the_classes(motionary, world, tmp_path):
    from motionary.models.library import load_library

    motionary("learn", world / "examples", "-o", tmp_path / "lib", "--threshold", 0.2,
              "--tolerance", 0.1)  # fmt: skip
    squat = load_library(tmp_path / "lib")["squat"]
    assert (squat.threshold, squat.tolerance) == (0.2, 0.1)


# -- info, features ---------------------------------------------------------------------


def test_info_tells_what_a_file_holds(motionary, world):
    take = world / "takes" / "take one.bvh"
    (row,) = json_lines(motionary("info", take, "--json").out)
    motion = read(take)
    assert row["recording"] == "take one.bvh"
    assert (row["format"], row["frames"], row["joints"]) == ("BVH", motion.n_frames, 24)
    assert (row["skeleton"], row["relations_known"], row["known"]) == ("generic", 40, 1.0)
    assert row["missing"] == []
    table = motionary("info", take).out
    assert "40 of 40" in table
    assert "take one.bvh: unit cm" in table


def test_info_lists_the_unreadable_too(motionary, world, tmp_path):
    (tmp_path / "broken.bvh").write_text("HIERARCHY\nnonsense")
    ran = motionary("info", world / "takes", tmp_path, tmp_path / "none.bvh", "--json")
    rows = json_lines(ran.out)
    assert ran.code == 1
    assert [("error" in row, row["recording"]) for row in rows] == [
        (True, "broken.bvh"), (False, "take one.bvh"), (True, str(tmp_path / "none.bvh")),
    ]  # fmt: skip
    assert "\nbroken.bvh: no line MOTION found" in motionary("info", tmp_path).out


def test_info_of_an_unknown_rig(motionary, world, tmp_path):
    text = (world / "takes" / "take one.bvh").read_text()
    text = re.sub(r"(ROOT|JOINT) (\w+)", r"\1 x\2x", text)
    (tmp_path / "rig.bvh").write_text(text)
    (row,) = json_lines(motionary("info", tmp_path, "--json").out)
    # The shape of the tree tells what the names do not.
    assert (row["skeleton"], row["relations_known"], row["relations"]) == ("guessed", 40, 40)
    assert "no known skeleton: joints were mapped" in motionary("info", tmp_path).out


def test_info_of_a_thing(motionary, tmp_path):
    head = "HIERARCHY\nROOT sword\n{\nOFFSET 0 0 0\nCHANNELS 3 Xrotation Yrotation Zrotation\n"
    tail = "End Site\n{\nOFFSET 0 90 0\n}\n}\nMOTION\nFrames: 2\nFrame Time: .1\n0 0 0\n0 9 0\n"
    (tmp_path / "sword.bvh").write_text(head + tail)
    (row,) = json_lines(motionary("info", tmp_path, "--json").out)
    assert (row["skeleton"], row["relations_known"], row["relations"]) == (None, 0, 40)
    assert "a prop, or a rig" in motionary("info", tmp_path).out


def test_features_are_those_of_the_call(motionary, world, tmp_path):
    take = world / "takes" / "take one.bvh"
    ran = motionary("features", take, "-o", tmp_path / "x.npz", "--plot", tmp_path / "x.png")
    assert (ran.code, ran.err) == (0, "")
    words = compute_features(read(take))
    assert f"features of 1 recording, {words.duration_s:.1f} s, written to" in ran.out
    with np.load(tmp_path / "x.npz", allow_pickle=False) as file:
        assert set(file) == {"features", "known", "names", "rate_hz"}
        assert file["features"].dtype == file["known"].dtype == np.uint8
        assert np.array_equal(file["features"], words.features)
        assert np.array_equal(file["known"], words.known_features)
        assert tuple(file["names"]) == words.feature_set.names
        assert file["rate_hz"] == 30
    assert (tmp_path / "x.png").exists()


def test_features_as_a_table(motionary, world, tmp_path):
    take = world / "takes" / "take one.bvh"
    assert motionary("features", take, "-o", tmp_path / "x.csv").code == 0
    words = compute_features(read(take))
    with (tmp_path / "x.csv").open(newline="", encoding="utf-8") as file:
        header, *rows = csv.reader(file)
    assert header == ["time_s", *words.feature_set.names]
    assert np.array_equal(np.array(rows)[:, 1:].astype(np.uint8), words.features)
    assert float(rows[3][0]) == pytest.approx(0.1)


def test_features_of_a_folder_split_by_person(motionary, tmp_path):
    folder = tmp_path / "clips"
    made = [(0, "bow"), (0, "squat"), (1, "bow"), (2, "squat")]
    folder.mkdir()
    for number, kind in made:
        write(synthetic_motion(kind, seed=number), folder / f"s{number}_{kind}.npz")
    (folder / "s9_broken.npz").write_bytes(b"broken")
    people = ("--persons", "^(s.)_", "--split-by", "person")
    ran = motionary("features", folder, "-o", tmp_path / "x.npz", *people)
    assert ran.code == 1
    assert "s, written to" in ran.out
    assert "s9_broken.npz" in ran.err
    with np.load(tmp_path / "x.npz") as file:
        assert file["recordings"].tolist() == [f"s{n}_{k}.npz" for n, k in made]
        assert file["persons"].tolist() == [f"s{n}" for n, _ in made]
        assert sorted(set(file["splits"])) == ["test", "train", "validation"]
        assert len(file["starts"]) == len(file["recordings"])
    for arguments, words in (
        (("--split-by", "person"), "--persons"),
        (("--plot", tmp_path / "x.png"), "draws one recording, got"),
        (("--persons", "x(.)"), "persons 'x(.)' matches nothing in"),
        (("--persons", "^s", "--split-by", "person"), "needs 3 people or more, got s"),
    ):
        ran = motionary("features", folder, "-o", tmp_path / "y.npz", *arguments)
        assert ran.code in (1, 2)
        assert words in ran.err


# -- evaluate ---------------------------------------------------------------------------


@pytest.fixture
def tables(tmp_path):
    """Labels and truth of two recordings in common, and one more on each side."""
    labels, truth = tmp_path / "labels.csv", tmp_path / "truth.csv"
    labels.write_text(
        "recording,label,start_s,end_s,cost\n"
        "a.bvh,squat,0,2,.01\na.bvh,kick,3,4,.02\nsub/b.amc,squat,0,1,.05\nc.bvh,squat,0,1,.1\n"
    )
    truth.write_text(
        "recording,label,start_s,end_s\na,squat,0,2\na,kick,3,4\nb,exercise,0,1\nd,squat,0,4\n"
    )
    return labels, truth


def test_scores_of_labels(motionary, tables):
    labels, truth = tables
    ran = motionary("evaluate", labels, "--truth", truth, "--json")
    (scores,) = json_lines(ran.out)
    assert ran.code == 0
    assert set(scores["recordings"]) == {"a.bvh", "sub/b.amc"}
    assert scores["recordings"]["a.bvh"]["frames"]["f"] == 1
    assert scores["recordings"]["sub/b.amc"]["segments"]["recall"] == 0
    assert "not in the truth, left out: c.bvh" in ran.err
    assert "left out: d; " in ran.err


def test_renaming_makes_one_class_of_several(motionary, tables, tmp_path):
    labels, truth = tables
    names = tmp_path / "names.csv"
    names.write_text("label,new\nsquat,exercise\n")
    for given in ("squat=exercise", names):
        ran = motionary("evaluate", labels, "--truth", truth, "--rename", given, "--json")
        scores = json_lines(ran.out)[0]
        assert scores["concatenated"]["frames"]["f"] == 1
        assert set(scores["classes"]) == {"exercise", "kick"}


def test_only_some_classes(motionary, tables):
    labels, truth = tables
    ran = motionary("evaluate", labels, "--truth", truth, "--only", "kick", "--json")
    assert set(json_lines(ran.out)[0]["classes"]) == {"kick"}
    ran = motionary("evaluate", labels, "--truth", truth, "--only", "kik")
    assert ran.code == 2
    assert "no label is called kik" in ran.err


def test_missed_recordings_count_on_request(motionary, tables):
    labels, truth = tables
    ran = motionary("evaluate", labels, "--truth", truth, "--count-missing", "--json")
    scores = json_lines(ran.out)[0]
    assert scores["recordings"]["d"]["frames"]["recall"] == 0
    assert "d;" not in ran.err


def test_the_table_of_scores(motionary, tables):
    labels, truth = tables
    lines = motionary("evaluate", labels, "--truth", truth).out.splitlines()
    assert lines[0].split() == ["P1", "R1", "F1", "P2", "R2", "F2", "mAP"]
    assert lines[1].startswith("all as one ")
    assert any(re.match(r"recording a\.bvh( +1\.000){7}$", line) for line in lines)
    assert any(line.startswith("class kick ") for line in lines)


def test_labels_of_another_recording(motionary, tables, tmp_path):
    labels, _ = tables
    other = tmp_path / "other.csv"
    other.write_text("recording,label,start_s,end_s\nz,squat,0,2\n")
    ran = motionary("evaluate", labels, "--truth", other)
    assert ran.code == 1
    assert ran.err == (
        "motionary: the labels and the truth have no recording in common; labels: a.bvh, c.bvh, "
        "sub/b.amc; truth: z\n"
    )


def test_the_overview_of_commands_is_that_of_whole_commands(motionary):
    from typer.main import get_command

    from motionary.cli.app import build_app

    shown = [line for line in motionary("--help").out.splitlines() if line.startswith("  ")]
    whole = get_command(build_app())
    for name in whole.list_commands(None):
        summary = whole.commands[name].get_short_help_str(200)
        assert any(line.split()[:2] == [name, summary.split()[0]] for line in shown)
