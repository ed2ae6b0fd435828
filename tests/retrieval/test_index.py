"""What is searched: the words of recordings, and what could not be read."""

import numpy as np
import pytest

from cli_cases import write_bvh
from motionary.errors import InvalidInput, UnreadableFile
from motionary.features import FULL_BODY, FULL_BODY_2006, compute_features
from motionary.io import read
from motionary.matching import feature_prior
from motionary.packing import unpack
from motionary.retrieval.index import Collection, collect
from motionary.samples import synthetic_motion
from packing_cases import N, random_rows, sequence


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Recordings in folders, one of them broken."""
    folder = tmp_path_factory.mktemp("recordings")
    for i, name in enumerate(["b.bvh", "a.bvh", "deep/er/a.bvh"]):
        write_bvh(synthetic_motion("squat", seed=i, rate_hz=30), folder / name)
    (folder / "broken.bvh").write_text("HIERARCHY")
    (folder / "notes.txt").write_text("")
    return folder


def names(collection):
    return [s.source for s in collection.sequences]


def test_a_folder_is_read_in_the_order_of_names(folder):
    found = collect(folder)
    assert names(found) == ["a.bvh", "b.bvh", "deep/er/a.bvh"]
    assert len(found) == 3
    assert found.n_frames == sum(len(s) for s in found.sequences)
    for packed in found.sequences:
        expected = compute_features(read(folder / packed.source))
        assert np.array_equal(packed.packed, expected.packed)
        assert np.array_equal(packed.known, expected.known)


def test_a_file_that_cannot_be_read_is_told(folder):
    (failure,) = collect(folder).failures
    assert failure.item == ("broken.bvh", folder / "broken.bvh")
    assert isinstance(failure.error, UnreadableFile)


def test_files_patterns_motions_and_words_may_be_mixed(folder):
    motion = synthetic_motion("kick_left", seed=0, rate_hz=30)
    packed = sequence(random_rows(0, 20), name="words")
    found = collect([folder / "b.bvh", motion, packed, str(folder / "a*.bvh")])
    assert sorted(names(found)) == sorted([motion.source, "words", "a.bvh", "b.bvh"])
    assert collect([packed]).sequences[0] is packed
    assert names(collect(str(folder / "b.bvh"))) == ["b.bvh"]


def test_every_file_is_reported_as_it_is_done(folder):
    done = []
    collect(folder, on_done=done.append)
    assert [name for name, _ in done] == ["a.bvh", "b.bvh", "broken.bvh", "deep/er/a.bvh"]


@pytest.mark.usefixtures("two_processes")
def test_two_processes_read_the_same(folder):
    one, two = collect(folder), collect(folder, jobs=2)
    assert names(one) == names(two)
    for a, b in zip(one.sequences, two.sequences, strict=True):
        assert a.packed.tobytes() == b.packed.tobytes()
    assert str(one.failures[0].error) == str(two.failures[0].error)


def test_another_feature_set(folder):
    found = collect(folder / "b.bvh", feature_set=FULL_BODY_2006)
    whole = collect(folder / "b.bvh").sequences[0].features
    assert np.array_equal(found.sequences[0].features, whole[:, :39])


def test_words_of_several_sets_do_not_mix():
    old = sequence(random_rows(0, 9)[:, :39], feature_set=FULL_BODY_2006, name="old")
    for given in ([old], [sequence(random_rows(1, 9)), old]):
        with pytest.raises(InvalidInput, match=r"old: features of 'full-body-39'.*'full-body-40'"):
            collect(given)


def test_what_is_not_there(folder, tmp_path):
    with pytest.raises(UnreadableFile, match="no such file or folder"):
        collect(folder / "nowhere")
    with pytest.raises(UnreadableFile, match="no recordings in this folder"):
        collect(tmp_path)
    with pytest.raises(UnreadableFile):
        collect([folder, folder / "nowhere"])


def test_nothing_cannot_be_searched(folder):
    for empty in (Collection(()), collect([])):
        assert len(empty) == empty.n_frames == 0
        with pytest.raises(InvalidInput, match="no readable recording"):
            _ = empty.parts
    with pytest.raises(InvalidInput, match=r"no readable recording.*broken\.bvh"):
        _ = collect(folder / "broken.bvh").parts


@pytest.mark.parametrize("seed", range(4))
def test_what_is_rare_is_counted_over_known_frames_of_all_recordings(seed):
    rng = np.random.default_rng(seed)
    takes = []
    for length in rng.integers(1, 40, 3):
        rows = rng.random((length, N)) < rng.random(N)
        takes.append(sequence(rows, rng.random((length, N)) < 0.7))
    found = Collection(tuple(takes)).feature_prior
    holds = sum(t.features.sum(axis=0, dtype=int) for t in takes)
    seen = sum(t.known_features.sum(axis=0, dtype=int) for t in takes)
    np.testing.assert_allclose(found, (holds + 1) / (seen + 2))


def test_parts_hold_every_recording_once():
    takes = [sequence(random_rows(i, 5 + i), name=str(i)) for i in range(4)]
    collection = Collection(tuple(takes))
    seen = []
    for number, take in enumerate(takes):
        part, document = collection.locate(number)
        shard = collection.parts[part].shard
        packed, known = shard.features_of(document)
        assert np.array_equal(packed, take.packed)
        assert np.array_equal(known, take.known)
        assert collection.parts[part].numbers[document] == number
        seen.append((part, document))
    assert len(set(seen)) == 4
    corpora = [part.shard.corpus for part in collection.parts]
    assert np.allclose(feature_prior(corpora[0], N), collection.feature_prior)
    assert unpack(corpora[0].packed, N).sum() == sum(t.features.sum() for t in takes)


def test_feature_sets_are_those_that_were_asked_for():
    assert Collection((sequence(random_rows(0, 3)),)).feature_set is FULL_BODY
