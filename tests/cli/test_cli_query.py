"""Searching by keyframes, by example with what it has grown, and from what is kept."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cli_cases import EXAMPLES, run, write_bvh, write_examples, write_stream
from motionary.features import FULL_BODY, compute_features
from motionary.io import read, read_labels
from motionary.models.keyframes import parse_queries
from motionary.models.library import load_library
from motionary.retrieval.index import CACHE_VARIABLE, Index
from motionary.samples import synthetic_motion

LOW = "body low, then within 1.5 s not body low"


@pytest.fixture
def motionary(capsys, monkeypatch, tmp_path):
    """Runs a command in this process, with a cache of its own."""
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "cache"))
    return lambda *arguments: run(capsys, monkeypatch, *arguments)


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    """Examples of three classes, one recording of several motions, and a library."""
    from motionary.models.library import learn

    folder = tmp_path_factory.mktemp("world")
    write_examples(folder / "examples")
    write_stream(folder / "takes" / "take one.bvh")
    learn(folder / "examples").save(folder / "library")
    return folder


@pytest.fixture
def squat(world):
    return world / "examples" / "squat" / "squat 0.bvh"


def json_lines(text):
    return [json.loads(line) for line in text.splitlines()]


def recordings(ran):
    return [hit["recording"] for hit in json_lines(ran.out)]


# -- keyframes ----------------------------------------------------------------------------


def test_keyframes_are_sought_as_text_or_from_a_file(motionary, world, tmp_path):
    (tmp_path / "low.txt").write_text(LOW.replace(", then", "\nthen").replace(" s ", " s\n"))
    ran = motionary("search", world / "examples", "--query", LOW, "--json")
    assert ran.code == 0, ran.err
    assert {name.split("/")[0] for name in recordings(ran)} == {"squat"}
    again = motionary("search", world / "examples", "--query", tmp_path / "low.txt", "--json")
    assert again.out == ran.out


def test_keyframes_that_are_nowhere_say_why(motionary, world):
    ran = motionary("search", world / "examples", "--query", "body spread out on the floor")
    assert ran.code == 1
    assert ran.out == ("no frame shows keyframe 1 of 1 (body spread out on the floor)\n")


@pytest.mark.parametrize(
    ("query", "words"),
    [
        ("body lwo", "line 1: no feature 'body lwo' in 'full-body-40'; did you mean 'body low'?"),
        ("body low\nthen soon\nbody low", "line 2: no gap of the form 'then soon'"),
        ("then body low", "--query"),
        ("features: other\nbody low", "the query is over 'other'"),
    ],
)
def test_keyframes_that_are_not_understood(motionary, world, query, words):
    ran = motionary("search", world / "examples", "--query", query)
    assert ran.code == 2
    assert words in " ".join(ran.err.split())


def test_a_file_of_keyframes_is_named_when_it_is_not_understood(motionary, world, tmp_path):
    (tmp_path / "low.txt").write_text("body low\n\nbody lwo")
    ran = motionary("search", world / "examples", "--query", tmp_path / "low.txt")
    assert (ran.code, "low.txt, line 3: " in " ".join(ran.err.split())) == (2, True)


def test_keyframes_choose_where_an_example_or_a_class_is_matched(motionary, world, squat):
    everywhere = motionary("search", world / "examples", "--like", squat, "--json")
    around = motionary("search", world / "examples", "--like", squat, "--query", LOW)
    assert len(json_lines(everywhere.out)) > EXAMPLES
    assert around.code == 0
    assert "matched in " in around.out
    assert "    body low\n    then within 0 to 1.5 s\n    not body low\n" in around.out
    ran = motionary("search", world / "examples", "--class", "kick_left", "--query", LOW,
                    "--library", world / "library", "--json")  # fmt: skip
    assert ran.code == 1


def test_labels_lie_around_keyframes_unless_all_is_looked_at(motionary, world, tmp_path):
    library = load_library(world / "library")
    nowhere = parse_queries("body spread out on the floor")
    classes = tuple(
        replace(one, prototypes=tuple(replace(s, queries=nowhere) for s in one.prototypes))
        for one in library
    )
    replace(library, classes=classes).save(tmp_path / "library")
    label = ("annotate", world / "examples", "--threshold", 0.15, "--json", "--library")
    with_keyframes = motionary(*label, tmp_path / "library")
    assert not any(track["labels"] for track in json_lines(with_keyframes.out))
    thorough = motionary(*label, tmp_path / "library", "--thorough")
    assert thorough.out == motionary(*label, world / "library").out
    assert any(track["labels"] for track in json_lines(thorough.out))


# -- collections of queries ---------------------------------------------------------------


def collection(patterns):
    """The form in which the published queries are passed on: body low, and not."""
    (low,) = (r for r in FULL_BODY.features if r.name == "body low")
    group = [r for r in FULL_BODY.features if r.group == low.group]
    n = len(patterns)
    return {
        "keyframes": ["*" * group.index(low) + sign for sign in patterns],
        "groups": [low.group] * n,
        "positions": [1 + 10 * k for k in range(n)],
        "distances": [10] * (n - 1),
        "stiffness": [0.2] * (n - 1),
        "template_length": 40,
    }


@pytest.fixture
def queries(tmp_path):
    """Two collections of queries; one name is in both."""
    path = tmp_path / "queries.json"
    low, up = collection("10"), collection("01")
    path.write_text(json.dumps({"mine": {"rise": low, "down": up}, "theirs": {"rise": low}}))
    return path


def test_a_query_of_a_collection(motionary, world, queries):
    ran = motionary(
        "search", world / "examples", "--query", queries, "--query-name", "down", "--json"
    )
    assert ran.code == 0, ran.err
    assert {name.split("/")[0] for name in recordings(ran)} == {"squat"}
    again = motionary(
        "search", world / "examples", "--query", queries, "--query-name", "mine/down", "--json"
    )
    assert again.out == ran.out


def test_one_keyframe_finds_the_stretches_that_show_it(motionary, world):
    path = next((world / "examples" / "kick_left").iterdir())
    ran = motionary("search", path, "--query", "left foot raised", "--json")
    hits = [json.loads(line) for line in ran.out.splitlines()]
    take = compute_features(read(path))
    shown = take.features[:, FULL_BODY.names.index("left foot raised")]
    edges = np.flatnonzero(np.diff(shown.astype(int), prepend=0, append=0))
    seconds = [(hit["start_s"], hit["end_s"]) for hit in hits]
    np.testing.assert_allclose(sorted(seconds), edges.reshape(-1, 2) / 30)
    assert {hit["cost"] for hit in hits} == {0.0}


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ((), "has 3 queries; choose one by its name"),
        (("--query-name", "rise"), "has 2 queries called 'rise'"),
        (
            ("--query-name", "jump"),
            "has no query 'jump'; choose one by its name: mine/rise, mine/down, theirs/",
        ),
    ],
)
def test_which_query_of_a_collection(motionary, world, queries, options, words):
    ran = motionary("search", world / "examples", "--query", queries, *options)
    assert ran.code == 2
    assert words in ran.err


def test_a_name_needs_a_collection(motionary, world):
    ran = motionary("search", world / "examples", "--query", LOW, "--query-name", "rise")
    assert ran.code == 2
    assert "goes with --query FILE.json" in ran.err


def test_a_collection_that_is_none(motionary, world, tmp_path):
    (tmp_path / "broken.json").write_text("{")
    ran = motionary("search", world / "examples", "--query", tmp_path / "broken.json")
    assert ran.code != 0
    assert "broken.json: is no JSON file" in ran.err


# -- a person's yes and no ---------------------------------------------------------------


def test_hits_said_to_be_right_teach_and_the_others_do_not(motionary, world, squat):
    like = ("search", world / "examples", "--like", squat)
    first = json_lines(motionary(*like, "--json").out)
    good = [rank for rank, hit in enumerate(first, 1) if "squat" in hit["recording"]]
    bad = [rank for rank, hit in enumerate(first, 1) if "squat" not in hit["recording"]]
    told = motionary(*like, "--relevant", ",".join(map(str, good)), "--irrelevant", bad[0])
    assert told.code == 0, told.err
    # One of them is the example itself.
    assert f"expanded from squat 0.bvh and {len(good) - 1} hits" in told.out


def test_what_is_like_a_wrong_hit_costs_more(motionary, world, squat):
    like = ("search", world / "examples", "--like", squat, "--expand", 0, "--limit", 0, "--json")
    first = json_lines(motionary(*like).out)
    rank = next(i for i, hit in enumerate(first, 1) if "squat" not in hit["recording"])
    again = json_lines(motionary(*like, "--irrelevant", rank).out)
    wrong = first[rank - 1]["recording"]
    cost = [next(h["cost"] for h in hits if h["recording"] == wrong) for hits in (first, again)]
    assert cost[1] > cost[0]
    assert "squat" in again[0]["recording"]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--relevant", "1,2", "--irrelevant", "2"), "hit 2 cannot be right and wrong"),
        (("--relevant", "one"), "ranks of hits, such as 1,2,5, got 'one'"),
        (("--relevant", "0"), "ranks of hits"),
        (("--irrelevant", "1,,2"), "ranks of hits"),
        (("--irrelevant", "-1"), "ranks of hits"),
        (("--relevant", "9999999999999999"), "there is no hit 9999999999999999"),
        (("--threshold", "0.0001", "--relevant", "1,7"), "there is no hit 7"),
    ],
)
def test_judgements_that_make_no_sense(motionary, world, squat, options, words):
    ran = motionary("search", world / "examples", "--like", squat, *options)
    assert ran.code == 2
    assert words in ran.err
    assert not ran.out


@pytest.mark.parametrize("option", ["--relevant", "--irrelevant"])
def test_only_hits_of_an_example_are_judged(motionary, world, option):
    ran = motionary("search", world / "examples", "--query", LOW, option, "1")
    assert ran.code == 2
    assert "goes with --like FILE" in ran.err


# -- what has grown -----------------------------------------------------------------------


def test_features_that_no_example_shows_are_unknown_and_do_not_vary(motionary, tmp_path):
    hands = ("lwrist", "rwrist", "lfingers", "rfingers")
    for seed in range(3):
        path = tmp_path / f"{seed}.bvh"
        write_bvh(synthetic_motion("squat", seed=seed, rate_hz=30), path)
        text = path.read_text()
        for name in hands:
            text = text.replace(f"JOINT {name}\n", f"JOINT no_{name}\n")
        path.write_text(text)
    ran = motionary("search", tmp_path, "--like", tmp_path / "0.bvh", "--skeleton", "generic")
    lines = {line.split()[0]: line for line in ran.out.split("\n\n")[0].splitlines()[1:]}
    assert re.match(r"  unknown .*hand.* \(measured in no example\)$", lines["unknown"])
    assert "hand" not in lines["varies"]


def test_a_fast_search_tells_its_keyframes(motionary, world, squat):
    ran = motionary("search", world / "examples", "--like", squat, "--fast", "--limit", EXAMPLES)
    assert ran.code == 0
    head, table = ran.out.split("\n\n")
    assert "  matched in " in head
    assert " % of the frames, around keyframes:\n    at " in head
    assert "squat/squat 0.bvh" in table


def test_what_has_grown_is_saved_and_used_again(motionary, world, squat, tmp_path):
    query, library, hits = tmp_path / "q.txt", tmp_path / "grown", tmp_path / "hits.csv"
    like = ("search", world / "examples", "--like", squat, "--published")
    ran = motionary(*like, "--save-query", query, "--save-class", library, "-o", hits, "--json")
    assert ran.code == 0, ran.err
    assert parse_queries(query.read_text())
    again = motionary("search", world / "examples", "--query", query, "--json")
    assert "squat/squat 0.bvh" in recordings(again)
    (name,) = load_library(library).names
    assert name == "like squat 0"
    # A class that was grown everywhere is sought everywhere, at the same costs.
    by_class = motionary("search", world / "examples", "--class", name, "--library", library,
                         "--threshold", 1, "--json")  # fmt: skip
    assert json_lines(by_class.out) == json_lines(ran.out)
    rows = read_labels(hits)
    assert sum(map(len, rows.values())) == len(json_lines(ran.out))
    first, best = hits.read_text().splitlines()[1].split(","), json_lines(ran.out)[0]
    assert first[:2] == [best["recording"], "like squat 0"]
    assert (int(first[4]), int(first[5])) == (best["start_frame"], best["end_frame"])


def test_a_class_joins_a_library(motionary, world, squat, tmp_path):
    library = tmp_path / "grown"
    like = ("search", world / "examples", "--like", squat)
    for options in ((), ("--fast",)):
        assert motionary(*like, "--save-class", library, *options).code == 0
    kick = world / "examples" / "kick_left" / "kick_left 1.bvh"
    motionary("search", world / "examples", "--like", kick, "--save-class", library)
    saved = load_library(library)
    assert saved.names == ("like squat 0", "like kick_left 1")
    assert saved["like squat 0"].prototypes[0].queries
    ran = motionary("search", world / "examples", "--class", "like squat 0", "--library", library,
                    "--limit", EXAMPLES, "--json")  # fmt: skip
    assert "squat/squat 0.bvh" in recordings(ran)


def test_hits_are_cut(motionary, world, squat, tmp_path):
    ran = motionary("search", world / "examples", "--like", squat, "--limit", 2, "--cut",
                    tmp_path / "clips", "--json")  # fmt: skip
    assert ran.code == 0
    assert ran.err == f"motionary: 2 of 2 clips written to {tmp_path / 'clips'}\n"
    clips = sorted(path.name for path in (tmp_path / "clips").iterdir())
    assert all(name.startswith("squat_") and "_like_squat_0_" in name for name in clips)
    assert len(clips) == 2


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--class", "squat", "--save-class", "x"), "goes with --like FILE"),
        ((), "say what to search for by one of them"),
        (("--query", "body low", "--from", 1), "goes with --like FILE"),
        (("--query", "body low", "--template", "x.png"), "goes with --like FILE"),
        (("--query", "body low", "--library", "x"), "goes with --class NAME"),
    ],
)
def test_wrong_use(motionary, world, options, words):
    if "--class" in options:
        options = (*options, "--library", world / "library")
    ran = motionary("search", world / "examples", *options)
    assert ran.code == 2
    assert words in " ".join(ran.err.split())


# -- what is kept -------------------------------------------------------------------------


def test_what_was_read_is_kept_in_the_cache(motionary, world, squat, tmp_path):
    plain = motionary("search", world / "examples", "--like", squat, "--no-index", "--json")
    assert not (tmp_path / "cache").exists()
    first = motionary("search", world / "examples", "--like", squat, "--json")
    index = Index.open(world / "examples")
    assert index.place.is_relative_to(tmp_path / "cache")
    assert len(index) == 3 * EXAMPLES
    second = motionary("search", world / "examples", "--like", squat, "--json")
    assert plain.out == first.out == second.out
    assert (plain.code, first.code, second.code) == (0, 0, 0)


def test_an_index_may_lie_elsewhere(motionary, world, squat, tmp_path):
    place = tmp_path / "words"
    like = ("search", world / "examples", "--like", squat, "--json")
    kept = motionary(*like, "--index", place)
    assert len(Index.open(world / "examples", at=place)) == 3 * EXAMPLES
    assert not (tmp_path / "cache").exists()
    assert motionary(*like, "--index", place).out == kept.out


def test_several_folders_and_files_have_names_of_their_own(motionary, world, squat, tmp_path):
    given = (world / "examples" / "squat", world / "examples" / "kick_left",
             world / "takes" / "take one.bvh")  # fmt: skip
    ran = motionary("search", *given, "--like", squat, "--limit", 0, "--json")
    plain = motionary("search", *given, "--like", squat, "--limit", 0, "--no-index", "--json")
    assert ran.out == plain.out
    assert {"squat 0.bvh", "kick_left 0.bvh", "take one.bvh"} <= set(recordings(ran))
    both = (world / "examples", world / "examples" / "squat")
    ran = motionary("search", *both, "--like", squat, "--limit", 0, "--json")
    plain = motionary("search", *both, "--like", squat, "--limit", 0, "--no-index", "--json")
    assert ran.out == plain.out


def test_what_could_not_be_read_is_told_every_time(motionary, world, squat, tmp_path):
    folder = tmp_path / "some"
    write_bvh(synthetic_motion("squat", seed=3, rate_hz=30), folder / "good.bvh")
    (folder / "broken.bvh").write_text("HIERARCHY")
    for _ in range(2):
        ran = motionary("search", folder, "--like", squat, "--json")
        assert ran.code == 1
        assert ran.err.startswith("motionary: broken.bvh: no line MOTION found")
        assert recordings(ran)[0] == "good.bvh"


def test_an_index_of_before_answers_as_published_and_says_so(motionary, world, squat, tmp_path):
    place = tmp_path / "kept"
    Index.open(world / "examples", at=place, feature_set=FULL_BODY).update()
    like = ("search", world / "examples", "--like", squat, "--json")
    ran = motionary(*like, "--index", place)
    assert "an index of the 40 published features" in ran.err
    assert ran.out == motionary(*like, "--published").out
    assert "published features" not in motionary(*like, "--published", "--index", place).err


def test_a_whole_recording_as_example_is_hinted_at(motionary, world):
    take = world / "takes" / "take one.bvh"
    ran = motionary("search", world / "takes", "--like", take, "--limit", 1, "--json")
    assert "choose one motion by --from and --to" in ran.err
    (hit,) = json_lines(ran.out)
    assert (hit["recording"], hit["start_s"], hit["cost"]) == ("take one.bvh", 0, 0)
    assert "--from" not in motionary("search", take, "--like", take, "--to", "2").err


def test_a_folder_without_recordings_is_told(motionary, world, squat, tmp_path):
    (tmp_path / "empty").mkdir()
    ran = motionary("search", tmp_path / "empty", "--like", squat)
    assert ran.code == 1
    assert "no recordings in this folder" in ran.err


def test_a_cache_that_cannot_be_written_costs_only_time(
    motionary, world, squat, tmp_path, monkeypatch
):
    (tmp_path / "file").touch()
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "file"))
    ran = motionary("search", world / "examples", "--like", squat, "--json")
    plain = motionary("search", world / "examples", "--like", squat, "--no-index", "--json")
    assert ran.code == 0
    assert ran.out == plain.out
    assert ran.err.startswith("motionary: nothing is kept for the next time: ")


def test_a_named_place_that_cannot_be_written_is_an_error(motionary, world, squat, tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").touch()
    ran = motionary("search", world / "examples", "--like", squat, "--index", tmp_path / "mine")
    assert ran.code == 1
    assert "holds files but no index" in ran.err


def test_keeping_and_not_keeping_exclude_each_other(motionary, world, squat, tmp_path):
    ran = motionary("search", world / "examples", "--like", squat, "--no-index", "--index",
                    tmp_path / "words")  # fmt: skip
    assert ran.code == 2
    assert "goes without --index" in ran.err


def test_indexing_tells_what_it_did(motionary, world, tmp_path):
    folder = tmp_path / "some"
    for i in range(3):
        write_bvh(synthetic_motion("squat", seed=i, rate_hz=30), folder / f"{i}.bvh")
    (folder / "broken.bvh").write_text("HIERARCHY")
    ran = motionary("index", folder, "--json")
    (told,) = json_lines(ran.out)
    place = told.pop("place")
    assert ran.code == 1
    assert told == {
        "recordings": 3, "words": Index.open(folder).n_frames, "read": 4, "gone": 0, "failed": 1,
    }  # fmt: skip
    assert Path(place).is_dir()
    (folder / "broken.bvh").unlink()
    (folder / "0.bvh").unlink()
    ran = motionary("index", folder)
    assert ran.code == 0
    assert ran.out.startswith("2 recordings, 4.03 seconds; read 0, 2 gone, 0 could not be read\n")
    (folder / "1.bvh").unlink()
    ran = motionary("index", folder)
    assert re.match(r"1 recording, [12]\.\d\d seconds; read 0, 1 gone", ran.out)


def test_another_folder_does_not_empty_an_index(motionary, tmp_path):
    one, other, place = tmp_path / "one", tmp_path / "other", tmp_path / "kept"
    write_bvh(synthetic_motion("squat", seed=0, rate_hz=30), one / "a.bvh")
    write_bvh(synthetic_motion("squat", seed=0, rate_hz=30), other / "b.bvh")
    assert motionary("index", one, "--index", place).code == 0
    refused = motionary("index", other, "--index", place)
    assert refused.code == 1
    assert "none of the 1 recordings of the index" in " ".join(refused.err.split())
    assert len(Index.open(one, at=place)) == 1


@pytest.mark.parametrize("named", [True, False])
def test_a_folder_that_is_empty_now_does_not_empty_its_index(motionary, tmp_path, named):
    folder = tmp_path / "disk"
    write_bvh(synthetic_motion("squat", seed=0, rate_hz=30), folder / "a.bvh")
    at = ("--index", tmp_path / "kept") if named else ()
    assert motionary("index", folder, *at).code == 0
    (folder / "a.bvh").unlink()
    ran = motionary("index", folder, *at)
    assert ran.code == 1
    assert "or another place by --index" in " ".join(ran.err.split())
    assert len(Index.open(folder, at=at[1] if named else None)) == 1
