"""Shards: what goes in comes out, however it is cut, joined or written."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from motionary.errors import InvalidInput, UnreadableFile
from motionary.features import FULL_BODY, FULL_BODY_2006, FeatureSequence
from motionary.matching import concatenate, feature_prior
from motionary.models.keyframes import HitRanges, index_packed
from motionary.packing import full_mask
from motionary.retrieval.index.collection import Collection, join_collections
from motionary.retrieval.index.shard import join_shards, make_shard, select
from motionary.retrieval.index.shard_files import read_shard, write_shard
from packing_cases import N, random_rows, sequence


def documents(seed, lengths, *, gaps=True):
    """Words with stretches in which some relations are unknown."""
    rng = np.random.default_rng(seed)
    found = []
    for i, length in enumerate(lengths):
        known = np.ones((length, N), dtype=bool)
        if gaps and rng.random() < 0.7:
            start = rng.integers(0, length + 1)
            known[start : start + rng.integers(0, length + 1), rng.random(N) < 0.3] = False
        rows = random_rows([seed, i], length)
        about = {"name": f"take {i}", "rate_hz": 25.0 * (i + 1), "first_frame": 7 * i}
        found.append(sequence(rows, known, n_frames=3 * length, **about))
    return found


def same(a: FeatureSequence, b: FeatureSequence) -> bool:
    about = [(x.recording, x.feature_set.name) for x in (a, b)]
    packed = np.array_equal(a.packed, b.packed) and np.array_equal(a.known, b.known)
    return bool(about[0] == about[1] and packed)


SIZES = st.lists(st.integers(1, 40), min_size=1, max_size=8)


@given(st.integers(0, 99), SIZES)
def test_documents_come_out_as_they_went_in(seed, lengths):
    given_documents = documents(seed, lengths)
    shard = make_shard(given_documents, FULL_BODY)
    assert len(shard) == len(lengths)
    assert shard.n_frames == sum(lengths)
    for i, document in enumerate(given_documents):
        assert same(shard.sequence(i), document)


@given(st.integers(0, 99), SIZES)
def test_the_corpus_is_that_of_the_documents(seed, lengths):
    given_documents = documents(seed, lengths)
    shard = make_shard(given_documents, FULL_BODY)
    expected = concatenate(
        [d.packed for d in given_documents],
        [d.known for d in given_documents],
        full=full_mask(1, N)[0],
    )
    corpus = shard.corpus
    assert np.array_equal(corpus.packed, expected.packed)
    assert np.array_equal(corpus.blocked, expected.blocked)
    assert np.array_equal(corpus.starts, expected.starts)
    inside = np.setdiff1d(np.arange(len(corpus.packed)), corpus.blocked)
    assert np.array_equal(corpus.known[inside], expected.known[inside])


@given(st.integers(0, 99), SIZES, st.data())
def test_stretches_are_those_of_the_documents(seed, lengths, data):
    given_documents = documents(seed, lengths)
    spans = []
    for number, length in enumerate(lengths):
        if data.draw(st.booleans()):
            start = data.draw(st.integers(0, length - 1))
            spans.append((number, start, data.draw(st.integers(start + 1, length))))
    if not spans:
        spans = [(0, 0, 1)]
    ranges = HitRanges(*(np.array(column, dtype=np.int64) for column in zip(*spans, strict=True)))
    corpus = make_shard(given_documents, FULL_BODY).cut(ranges)
    for i, (number, start, stop) in enumerate(spans):
        packed, known = corpus.sequence(i)
        assert np.array_equal(packed, given_documents[number].packed[start:stop])
        assert np.array_equal(known, given_documents[number].known[start:stop])
    assert len(corpus.blocked) == 2 * (len(spans) - 1)


def test_joined_and_chosen_documents_keep_everything():
    a, b = documents(1, [5, 9, 30]), documents(2, [12, 3])
    shards = [make_shard(a, FULL_BODY), make_shard(b, FULL_BODY)]
    joined = join_shards(shards)
    assert all(same(joined.sequence(i), d) for i, d in enumerate([*a, *b]))
    chosen = select(shards, [np.array([2]), np.array([1, 0])])
    assert all(same(chosen.sequence(i), d) for i, d in enumerate([a[2], b[1], b[0]]))


def test_a_shard_that_is_written_twice_is_there_once(tmp_path):
    shard = make_shard(documents(4, [50, 33]), FULL_BODY)
    name = write_shard(shard, tmp_path)
    assert write_shard(shard, tmp_path) == name
    assert [path.name for path in tmp_path.iterdir()] == [name]
    # One of this name that is damaged does not count.
    (tmp_path / name / "words.array").write_bytes(b"")
    again = write_shard(shard, tmp_path)
    assert again != name
    assert same(read_shard(tmp_path, again, FULL_BODY).sequence(0), shard.sequence(0))


def test_states_of_files_are_carried_along():
    shard = make_shard(documents(3, [5, 6]), FULL_BODY)
    table = shard.table.copy()
    table["mtime_ns"], table["size"], table["companion"] = [1, 2], [3, 4], [2**64 - 1, 6]
    shard = make_shard(documents(3, [5, 6]), FULL_BODY, states=table)
    chosen = select([shard], [np.array([1])])
    assert chosen.table[["mtime_ns", "size", "companion"]].tolist() == [(2, 4, 6)]


def test_a_written_shard_reads_back(tmp_path):
    given_documents = documents(4, [50, 1, 33])
    shard = make_shard(given_documents, FULL_BODY)
    back = read_shard(tmp_path, write_shard(shard, tmp_path), FULL_BODY)
    assert all(same(back.sequence(i), d) for i, d in enumerate(given_documents))
    assert np.array_equal(back.table, shard.table)
    expected = index_packed(
        [d.packed for d in given_documents],
        [d.known for d in given_documents],
        feature_set=FULL_BODY.name,
        feature_ids=FULL_BODY.ids,
    )
    assert np.array_equal(back.posting_index.planes, expected.planes)
    assert [path.suffix for path in sorted((tmp_path).glob("*/*"))].count(".npy") == 0


@pytest.mark.parametrize("file", ["words", "table", "planes", "masks", "names"])
@pytest.mark.parametrize("harm", ["cut", "emptied", "gone"])
def test_a_damaged_shard_is_refused(tmp_path, file, harm):
    folder = tmp_path / write_shard(make_shard(documents(4, [50, 33]), FULL_BODY), tmp_path)
    (path,) = folder.glob(f"{file}.*")
    content = path.read_bytes()
    path.unlink()
    if harm != "gone":
        path.write_bytes(content[: len(content) // 2 if harm == "cut" else 0])
    with pytest.raises(UnreadableFile, match="incomplete or damaged"):
        read_shard(folder.parent, folder.name, FULL_BODY)


def test_a_shard_of_other_features_is_refused(tmp_path):
    folder = tmp_path / write_shard(make_shard(documents(4, [50]), FULL_BODY), tmp_path)
    with pytest.raises(UnreadableFile, match="another feature set"):
        read_shard(folder.parent, folder.name, FULL_BODY_2006)


def test_a_shard_must_fit_together():
    shard = make_shard(documents(4, [5, 6]), FULL_BODY)
    with pytest.raises(InvalidInput, match="needs features of shape"):
        type(shard)(shard.names[:1], shard.table, shard.packed, shard.masks, FULL_BODY)


# -- collections of shards ----------------------------------------------------------------


def test_documents_of_shards_stand_in_the_order_of_their_names():
    a, b = documents(1, [5, 9, 30]), documents(2, [12, 3])
    renamed = [FeatureSequence(d.packed, d.known, FULL_BODY, d.recording.renamed(n))
               for d, n in zip([*a, *b], "dbaec", strict=True)]  # fmt: skip
    shards = [make_shard(renamed[:3], FULL_BODY), make_shard(renamed[3:], FULL_BODY)]
    collection = Collection.of_shards(shards, FULL_BODY)
    assert [s.source for s in collection.sequences] == list("abcde")
    assert [s.source for s in collection.sequences[1:3]] == ["b", "c"]
    assert collection.sequences[-1].source == "e"
    assert sorted(len(s) for s in collection.sequences) == [3, 5, 9, 12, 30]
    for part in collection.parts:
        for document, number in enumerate(part.numbers):
            assert part.shard.names[document] == collection.sequences[number].source
    plain = Collection(tuple(sorted(renamed, key=lambda s: s.source)))
    assert np.array_equal(collection.feature_prior, plain.feature_prior)
    assert np.array_equal(plain.feature_prior, feature_prior(plain.parts[0].shard.corpus, N))
    with pytest.raises(IndexError):
        collection.sequences[5]


def test_a_large_collection_is_sampled_from_all_its_shards(monkeypatch):
    shards = [make_shard(documents(i, [20, 5, 30]), FULL_BODY) for i in range(3)]
    collection = Collection.of_shards(shards, FULL_BODY)
    assert collection.sample is collection
    monkeypatch.setattr("motionary.retrieval.index.collection.LARGE_COLLECTION", 100)
    monkeypatch.setattr("motionary.retrieval.index.collection._SAMPLED_FRAMES", 80)
    sample = Collection.of_shards(shards, FULL_BODY).sample
    assert sorted(len(s) for s in sample.sequences) == [5, 5, 5, 20, 20, 20]
    assert len(sample.parts) == 1


def test_an_empty_collection_says_so():
    collection = Collection.of_shards([], FULL_BODY)
    assert len(collection) == 0
    assert collection.n_frames == 0
    with pytest.raises(InvalidInput, match="no readable recording"):
        _ = collection.parts


def test_collections_join_under_new_names():
    a = Collection(tuple(documents(1, [5, 9])))
    b = Collection(tuple(documents(2, [12, 3])))
    names = [{"take 0": "a/take 0", "take 1": "take 1"}, {"take 0": "b/take 0"}]
    joined = join_collections([a, b], names)
    assert [s.source for s in joined.sequences] == ["a/take 0", "b/take 0", "take 1"]
    assert [len(s) for s in joined.sequences] == [5, 12, 9]
