"""The same motion in different files is found, a motion done twice is not."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from motionary.errors import InvalidInput, UnreadableFile
from motionary.features import FULL_BODY, FULL_BODY_2006, compute_features
from motionary.motion import GENERIC_JOINTS
from motionary.packing import pack
from motionary.recording import Recording
from motionary.retrieval.duplicate_evidence import (
    MIRROR_ORDER,
    agreement,
    changes_of,
    curves_of,
    find_candidates,
    mirrored,
    rates_of,
    weigh,
)
from motionary.retrieval.duplicates import Comparing, find_duplicates
from motionary.retrieval.index import Collection
from motionary.samples import synthetic_stream
from packing_cases import N, random_rows, sequence

PHRASES = ("squat", "kick_left", "wave_right")
OTHER_SIDE = {"l": "r", "r": "l"}
MIRROR = [
    GENERIC_JOINTS.index(
        OTHER_SIDE[name[0]] + name[1:] if name[0] in "lr" and name != "root" else name
    )
    for name in GENERIC_JOINTS
]


def take(seed, *, rate_hz=60.0):
    return synthetic_stream(PHRASES, seed=seed, rate_hz=rate_hz)[0]


def moved(motion, **changes):
    return replace(motion, rotations=None, skeleton=None, **changes)


def mirror(motion):
    """Left and right exchanged."""
    order = [motion.names.index(GENERIC_JOINTS[i]) for i in MIRROR]
    mirrored_positions = motion.positions[:, order] * [-1.0, 1.0, 1.0]
    placed = np.empty_like(mirrored_positions)
    for i, name in enumerate(GENERIC_JOINTS):
        placed[:, motion.names.index(name)] = mirrored_positions[:, i]
    return moved(motion, positions=placed)


def bulkier(motion):
    """The same motion on a body of other proportions, half as large again."""
    return moved(motion, positions=motion.positions * [1.5, 1.45, 1.5])


def compare(motions, others=None, **settings):
    collections = [
        Collection(tuple(compute_features(m.renamed(n)) for n, m in sorted(some.items())))
        for some in (motions, others)
        if some is not None
    ]
    return find_duplicates(
        *collections,
        read=motions.__getitem__,
        read_right=others.__getitem__ if others else None,
        comparing=Comparing(**settings) if settings else None,
    )


@pytest.fixture(scope="module")
def first():
    return take(1)


def span(segment):
    return (segment.recording, pytest.approx(segment.start_s), pytest.approx(segment.end_s))


@pytest.fixture(scope="module")
def found(first):
    """A take; part of it at half the rate; its mirror image; others of the same motions."""
    motions = {
        "a take": first,
        "b part": moved(
            first, positions=first.positions[90:330:2], recording=Recording(rate_hz=30.0)
        ),
        "c mirrored": mirror(first),
        "d bulky": bulkier(first),
    }
    motions |= {f"other {i}": take(i) for i in range(2, 6)}
    return compare(motions)


def pairs(result):
    return {(d.left.recording.name, d.right.recording.name): d for d in result.duplicates}


def test_copies_are_found(found):
    wanted = {
        pair for pair in itertools.combinations(("a take", "b part", "c mirrored", "d bulky"), 2)
    }
    assert wanted <= set(pairs(found))
    # Synthetic performances lack what tells those of people apart; takes of copies do not.
    assert not {pair for pair in pairs(found) if len({name[:5] == "other" for name in pair}) == 2}
    assert found.still == ()
    assert found.failures == ()


def test_most_informative_first(found):
    bits = [d.bits for d in found.duplicates]
    assert bits == sorted(bits, reverse=True)
    assert all(d.bits >= Comparing().least_bits for d in found.duplicates)
    assert all(Comparing().least_agreement <= d.agreement <= 1 for d in found.duplicates)
    assert all(0.4 < d.shared <= 1 for d in found.duplicates)


def test_parts_and_rates_are_placed(found):
    part = pairs(found)["a take", "b part"]
    shift = part.left.segment.start_s - part.right.segment.start_s
    assert shift == pytest.approx(90 / 60, abs=0.02)
    assert part.left.segment.end_s - part.left.segment.start_s > 2
    assert not part.is_mirrored
    assert part.agreement > 0.9


def test_mirror_images_are_said_to_be(found):
    assert pairs(found)["a take", "c mirrored"].is_mirrored
    assert pairs(found)["b part", "c mirrored"].is_mirrored
    assert not pairs(found)["a take", "d bulky"].is_mirrored
    assert pairs(found)["a take", "c mirrored"].agreement > 0.99


def test_two_collections_are_compared_with_each_other_only(first):
    mine = {"take": first, "copy": bulkier(first)}
    theirs = {"take": take(9), "their copy": bulkier(first), "again": bulkier(first)}
    result = compare(mine, theirs)
    assert set(pairs(result)) == {(a, b) for a in ("take", "copy") for b in ("their copy", "again")}


def test_what_stands_still_is_no_duplicate(first):
    still = moved(first, positions=np.repeat(first.positions[:1], 200, axis=0))
    result = compare({"still": still, "as still": still, "take": first})
    assert result.duplicates == ()
    assert result.still == ("as still", "still")


def test_settings_decide(first):
    motions = {"a": first, "b": bulkier(first)}
    assert len(compare(motions).duplicates) == 1
    assert compare(motions, least_bits=1e4).duplicates == ()
    assert compare(motions, least_s=60.0).duplicates == ()
    strict = compare(motions, least_agreement=1.01)
    assert (strict.duplicates, strict.n_alike) == ((), 1)


def test_a_recording_that_is_gone_is_a_failure(first):
    def read(name):
        raise UnreadableFile(f"{name}: cannot be read: No such file or directory")

    packed = [compute_features(first.renamed(name)) for name in ("a", "b")]
    result = find_duplicates(Collection(tuple(packed)), read=read)
    assert result.duplicates == ()
    assert [str(f.item) for f in result.failures] == ["a and b"]


def test_what_cannot_be_compared_is_refused(first):
    packed = Collection((compute_features(first),))
    other = Collection((compute_features(first, feature_set=FULL_BODY_2006),), FULL_BODY_2006)
    with pytest.raises(InvalidInput, match="features of one feature set"):
        find_duplicates(packed, other, read=lambda name: first)
    with pytest.raises(InvalidInput, match="no readable recording"):
        find_duplicates(Collection(()), read=lambda name: first)


# -- landmarks ----------------------------------------------------------------------------


def test_changes_are_those_of_known_relations():
    rows, known = random_rows(1, 30), np.random.default_rng(2).random((30, N)) < 0.8
    packed = sequence(rows, known)
    changes = changes_of([packed.packed], [packed.known], N)
    expected = [
        (0, t, 2 * i + int(rows[t + 1, i]))
        for t in range(29)
        for i in range(N)
        if known[t, i] and known[t + 1, i] and rows[t, i] != rows[t + 1, i]
    ]
    assert list(zip(*(column.tolist() for column in changes), strict=True)) == expected


def test_changes_of_a_mirrored_document():
    rows = random_rows(3, 30)
    packed, image = sequence(rows), sequence(rows[:, FULL_BODY.mirror_order])
    got = mirrored(changes_of([packed.packed], [packed.known], N), FULL_BODY.mirror_order)
    expected = changes_of([image.packed], [image.known], N)
    assert all(np.array_equal(a, b) for a, b in zip(got, expected, strict=True))


def sparse_rows(seed, n):
    """Relations that change now and then."""
    rng = np.random.default_rng(seed)
    return np.cumsum(rng.random((n, N)) < 0.02, axis=0) % 2 == 1


def test_a_shared_stretch_gets_the_most_votes_at_its_offset():
    shared = sparse_rows(0, 80)
    left = [sparse_rows(1, 100), np.concatenate([sparse_rows(2, 37), shared])]
    right = [np.concatenate([sparse_rows(3, 12), shared, sparse_rows(4, 9)])]
    sides = [
        changes_of([pack(r) for r in some], [pack(r | True) for r in some], N)
        for some in (left, right)
    ]
    found = find_candidates(*sides, n_features=N, n_right=1, least_votes=5)
    best = int(np.argmax(found.votes))
    assert (found.left[best], found.right[best], found.offsets[best]) == (1, 0, 25)
    assert found.votes[best] > 30
    others = np.delete(found.votes, best)
    assert len(others) == 0 or others.max() < 10


def test_nothing_shared_gives_no_candidates():
    none = changes_of([pack(np.zeros((50, N), bool))] * 2, [pack(np.ones((50, N), bool))] * 2, N)
    found = find_candidates(none, none, n_features=N, n_right=2, least_votes=1)
    assert len(found.left) == 0


# -- evidence -----------------------------------------------------------------------------


def signs(*events, n=100):
    found = np.zeros((n, N), dtype=np.int8)
    for frame, feature, sign in events:
        found[frame, feature] = sign
    return found


RATES = rates_of(np.full(2 * N, 10), 1000)


def test_changes_that_meet_within_a_frame_count():
    a = signs((10, 0, 1), (20, 1, -1), (30, 2, 1))
    together = weigh(a, a, 0, RATES)
    assert together.shared == 1
    assert together.bits == pytest.approx(3 * np.log2(0.65 / (3 * 11 / 1002)))
    assert (together.start, together.stop) == (10, 31)
    beside = weigh(a, signs((11, 0, 1), (19, 1, -1), (30, 2, 1)), 0, RATES)
    assert beside.bits == pytest.approx(together.bits)
    later = weigh(a, signs((15, 0, 1), (25, 1, -1), (35, 2, 1)), -5, RATES)
    assert later.bits == pytest.approx(together.bits)


def test_changes_that_do_not_meet_count_against():
    a, b = signs((10, 0, 1), (20, 1, -1)), signs((10, 0, 1), (20, 1, 1))
    assert weigh(a, b, 0, RATES).bits == pytest.approx(np.log2(0.65 / (3 * 11 / 1002)))
    assert weigh(a, signs(), 0, RATES).bits == 0
    assert weigh(signs(), signs(), 0, RATES).shared == 0


def test_rare_changes_tell_more():
    counts = np.full(2 * N, 10)
    counts[1] = 1
    rates = rates_of(counts, 1000)
    rare, common = signs((10, 0, 1)), signs((10, 1, 1))
    assert weigh(rare, rare, 0, rates).bits > weigh(common, common, 0, rates).bits + 2


# -- curves -------------------------------------------------------------------------------


def test_curves_are_those_of_the_body_not_of_its_place(first):
    turned = first.positions @ np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]]) * 1.7 + [3, 0, 1]
    a, b = curves_of(first), curves_of(moved(first, positions=turned))
    assert a.shape[1] == 11
    assert np.allclose(a, b, atol=1e-6, equal_nan=True)
    image = curves_of(mirror(first))
    assert np.allclose(a[:, MIRROR_ORDER], image, atol=1e-6, equal_nan=True)


def test_agreement_finds_the_offset(first):
    curves = curves_of(first)
    value, at = agreement(curves[100:], curves, -97, within=8)
    assert (value, at) == (pytest.approx(1), -100)
    assert agreement(curves[:20], curves, 0, within=8) == (0.0, 0)
    unseen = curves.copy()
    unseen[:, :6] = np.nan
    assert agreement(unseen, curves, 0, within=8)[0] == 0
    half = curves.copy()
    half[:, :3] = np.nan
    assert agreement(half, curves, 0, within=0)[0] == pytest.approx(1)


# -- recordings ---------------------------------------------------------------------------


def test_a_motion_done_again_is_no_copy(data):
    from motionary.io import read
    from motionary.retrieval.index import collect

    files = {path.name: path for path in (data / "hdm05" / "squat1Reps").glob("HDM_[dt][gr]_*")}
    files |= {path.name: path for path in (data / "hdm05").glob("jog*/HDM_dg_*")}
    result = find_duplicates(collect(list(files.values())), read=lambda name: read(files[name]))
    assert result.duplicates == ()
    assert result.n_alike > 50


def test_trials_of_cmu_are_found_in_their_two_files(data):
    from motionary.io import read
    from motionary.retrieval.index import collect

    folder = data / "cmu"
    collection = collect(folder)
    result = find_duplicates(collection, read=lambda name: read(folder / name))
    assert {(d.left.recording.name, d.right.recording.name) for d in result.duplicates} == {
        ("01_01.amc", "01_01.bvh"), ("07_01.amc", "iclone_07_01.bvh"),
    }  # fmt: skip
    for found in result.duplicates:
        assert found.bits > 150
        assert found.agreement > 0.9
        assert found.left.segment.start_s == pytest.approx(found.right.segment.start_s, abs=0.05)
