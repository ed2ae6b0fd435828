"""Commands over an index: what it has stored answers, and the recordings stay closed."""

import json
import re

import pytest

from cli_cases import write_bvh
from motionary.errors import InvalidInput
from motionary.features import FULL_BODY, LEGS, compute_features, load_everyday_set
from motionary.io import ReadOptions
from motionary.models.library import ClassLibrary, learn
from motionary.retrieval.annotation import annotate, annotate_collection
from motionary.retrieval.explanation import explain
from motionary.retrieval.index import Collection, Index, collection
from motionary.samples import synthetic_motion

READING = ReadOptions(skeleton="generic")
SEEN_LITTLE = ("belly", "lshoulder", "rshoulder", "neck", "head", "chest", "lknee", "rknee")


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    """Two motions, one of which little is seen, and a file that is broken."""
    folder = tmp_path_factory.mktemp("archive") / "takes"
    for name, seed in (("squat", 9), ("deep/bow", 3), ("blind", 0)):
        write_bvh(synthetic_motion(name.split("/")[-1].replace("blind", "squat"), seed=seed,
                                   rate_hz=30), folder / f"{name}.bvh")  # fmt: skip
    blind = folder / "blind.bvh"
    text = re.sub(rf"\b({'|'.join(SEEN_LITTLE)})\b", r"stranger_\1", blind.read_text())
    blind.write_text(text)
    (folder / "broken.bvh").write_text("HIERARCHY")
    return folder


@pytest.fixture(scope="module")
def libraries(tmp_path_factory):
    """A library over the everyday features, and one over the published ones among them."""
    examples = {
        name: [
            compute_features(
                synthetic_motion(name, seed=seed, rate_hz=30), feature_set=load_everyday_set()
            )
            for seed in range(2)
        ]
        for name in ("squat", "bow")
    }
    leading = {name: [one.leading(FULL_BODY) for one in some] for name, some in examples.items()}
    learned = {"everyday": learn(examples), "published": learn(leading)}
    places = {name: tmp_path_factory.mktemp("library") for name in learned}
    for name, library in learned.items():
        library.save(places[name])
    return places


@pytest.fixture(scope="module")
def index(archive, tmp_path_factory):
    """Where an index of it lies."""
    opened = Index.open(archive, at=tmp_path_factory.mktemp("index"), reading=READING)
    opened.update()
    return opened.place


def test_labels_of_an_index_are_those_of_the_files(
    motionary, archive, libraries, index, monkeypatch
):
    for name, command in (("published", "annotate"), ("everyday", "count")):
        given = (command, archive, "--library", libraries[name], "--skeleton", "generic", "--json")
        files = motionary(*given)
        with monkeypatch.context() as closed:
            closed.setattr("motionary.retrieval.index.building.read_features", None)
            ran = motionary(*given, "--index", index)
        assert (ran.code, ran.out) == (files.code, files.out) == (1, ran.out)
        assert "broken.bvh" in ran.err
        rows = list(map(json.loads, ran.out.splitlines()))
        if command == "annotate":
            names = [row["recording"] for row in rows]
            assert names == ["blind.bvh", "deep/bow.bvh", "squat.bvh"]
            assert rows[0]["unassessed"]
            assert [x["label"] for x in rows[2]["labels"]] == ["squat"]
    assert ("squat.bvh", "squat") in [(row["recording"], row["label"]) for row in rows]


@pytest.mark.usefixtures("two_processes")
def test_whoever_labels_a_collection_labels_it_alike(libraries, index, archive, monkeypatch):
    monkeypatch.setattr(collection, "_PORTION_FRAMES", 100)
    library = ClassLibrary.load(libraries["published"])
    opened = Index.open(archive, at=index, reading=READING)
    sequences = opened.collection().published.sequences
    alone = [annotate(one, library) for one in sequences]
    tracks = list(annotate_collection(opened, library))
    assert tracks == alone
    assert all(label.evidence is None for track in tracks for label in track)
    kept = list(annotate_collection(opened, library, explainable=True, jobs=2))
    assert kept == alone
    assert [[str(explain(x)) for x in y] for y in kept] == [
        [str(explain(x)) for x in y] for y in alone
    ]


def test_portions_hold_what_a_collection_holds(index, archive, monkeypatch):
    monkeypatch.setattr(collection, "_PORTION_FRAMES", 100)
    kept = Index.open(archive, at=index, reading=READING).collection().published
    for recordings in (kept, Collection(tuple(kept.sequences))):
        portions = list(recordings.portions())
        assert len(portions) > 1
        opened = [sequence for portion in portions for sequence in portion.open()]
        assert [one.recording for one in opened] == [one.recording for one in kept.sequences]
        for one, other in zip(opened, kept.sequences, strict=True):
            assert one.packed.tobytes() == other.packed.tobytes()
            assert one.known.tobytes() == other.known.tobytes()
    assert not list(Collection(()).portions())


def test_an_index_over_other_features_is_refused(motionary, archive, libraries, tmp_path):
    remedy = "name another place, where an index of these is made"
    for feature_set, library, told in (
        (LEGS, "published", "an index of 'legs-14' (14 features), asked for is 'full-body-40'"),
        (FULL_BODY, "everyday", "is an index of the 40 published features, the library needs"),
    ):
        opened = Index.open(archive, at=tmp_path / library, feature_set=feature_set)
        opened.update()
        ran = motionary(
            "annotate", archive, "--library", libraries[library], "--index", opened.place
        )
        assert (ran.code, ran.out) == (1 if library == "published" else 2, "")
        said = " ".join(ran.err.replace("│", " ").split())
        assert told in said
        assert remedy in said
        with pytest.raises(InvalidInput, match="open an index elsewhere with feature_set="):
            annotate_collection(opened, ClassLibrary.load(libraries[library]))


def test_an_index_may_be_of_chosen_features_and_of_patterns(
    motionary, archive, libraries, tmp_path, monkeypatch
):
    monkeypatch.chdir(archive)
    made = ("index", "squ*.bvh", "deep/*", "--index", tmp_path / "i", "--json")
    ran = motionary(*made, "--features", "full-body-40")
    assert (ran.code, json.loads(ran.out)["recordings"]) == (0, 2)
    kept = Index.open(["squat.bvh", "deep"], at=tmp_path / "i", feature_set=FULL_BODY)
    assert kept.collection().feature_set == FULL_BODY
    assert kept.changes().to_read == []
    given = ("squ*.bvh", "deep/*", "--library", libraries["published"], "--json")
    ran = motionary("annotate", *given, "--index", tmp_path / "i")
    assert [json.loads(line)["recording"] for line in ran.out.splitlines()] == [
        "deep/bow.bvh",
        "takes/squat.bvh",
    ]
    ran = motionary("index", "none*.bvh", "--index", tmp_path / "none")
    assert (ran.code, ran.out) == (1, "")
    assert "none*.bvh: no recording has a name like this" in ran.err
    assert motionary(*made, "--features", "mine").code == 2


def test_a_search_does_not_make_an_index_forget_sources_that_are_not_given(
    motionary, archive, tmp_path
):
    folders = [tmp_path / name for name in ("one", "two", "three")]
    for folder in folders:
        folder.mkdir()
        (folder / "squat.bvh").write_bytes((archive / "squat.bvh").read_bytes())
    at = ("--index", tmp_path / "index", "--skeleton", "generic")
    assert motionary("index", *folders, *at).code == 0
    example = archive / "squat.bvh"
    part = motionary("search", *folders[:2], "--like", example, *at)
    assert part.code == 1
    assert "holds 1 recordings that are not given, such as three/squat.bvh; give all" in part.err
    whole = motionary("search", *folders, "--like", example, *at, "--json")
    assert {json.loads(line)["recording"] for line in whole.out.splitlines()} == {
        "one/squat.bvh", "two/squat.bvh", "three/squat.bvh",
    }  # fmt: skip
    assert motionary("index", *folders[:2], *at).code == 0
    assert motionary("search", *folders[:2], "--like", example, *at).code == 0


def test_nor_files_that_a_pattern_meant(motionary, archive, tmp_path):
    for name in ("a", "b"):
        (tmp_path / f"{name}.bvh").write_bytes((archive / "squat.bvh").read_bytes())
    at = ("--index", tmp_path / "index", "--skeleton", "generic")
    assert motionary("index", tmp_path / "*.bvh", *at).code == 0
    one = motionary("search", tmp_path / "a.bvh", "--like", archive / "squat.bvh", *at)
    assert (one.code, "not given, such as b.bvh" in one.err) == (1, True)
    # What is not there any more is forgotten.
    (tmp_path / "b.bvh").unlink()
    one = motionary("search", tmp_path / "a.bvh", "--like", archive / "squat.bvh", *at)
    assert one.code == 0
