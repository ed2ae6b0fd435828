"""Keyframes first: windows around their hits, and the same answers within them."""

import itertools
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from keyframe_cases import cases
from motionary.errors import InvalidInput
from motionary.features import FULL_BODY, FULL_BODY_2006
from motionary.matching import align, concatenate, distance_function, find_hits
from motionary.models.keyframes import (
    Gap,
    HitRanges,
    KeyframeQuery,
    agree,
    choose_keyframes,
    columns_of_query,
    extend,
    fit_hits,
    from_features,
    from_template,
    margins,
    parse_queries,
    parse_query,
    search_query,
    select_in_index,
    select_in_sequence,
    single_hits,
)
from motionary.models.library import ClassLibrary, MotionClass, Prototype, learn
from motionary.packing import full_mask
from motionary.retrieval.annotation import annotate
from motionary.retrieval.explanation import explain
from motionary.retrieval.index import Collection
from motionary.retrieval.labelling import class_distance
from motionary.retrieval.search import Deriving, QueryExpansion, derive_queries, search
from packing_cases import N, random_rows, sequence, stream

# Keyframes belong to the assignment by costs.
annotate_by_costs = partial(annotate, assignment="published")

LENGTH = 40
STEP = random_rows(1, LENGTH)
PLAIN = {"by_self_information": False}


def trained(*, queries=(), votes=1, threshold=0.06):
    """A class of one template, with keyframes or without."""
    from motionary.models.library import TrainingOptions

    library = learn(
        {"step": [sequence(STEP)]}, training=TrainingOptions(**PLAIN, threshold=threshold)
    )
    (prototype,) = library["step"].prototypes
    prototype = Prototype("step", prototype.template, tuple(queries), votes)
    return MotionClass("step", (prototype,), threshold)


def query_of(columns, *, stiffness=0.7):
    """Keyframes of whole columns of the step."""
    template = trained().quantised[0]
    return from_template(template, list(columns), stiffness=stiffness)


QUERY = query_of((10, 20, 33))


@pytest.fixture(scope="module")
def takes():
    """Steps that fit ever worse, one of them without the middle keyframe."""
    rng = np.random.default_rng(5)
    worse = STEP.copy()
    worse[:8] ^= rng.random((8, N)) < 0.1
    blind = STEP.copy()
    blind[20] = ~blind[20]
    rows = [stream(worse, STEP, seed=1)[0], stream(blind, STEP, seed=2)[0], random_rows(9, 200)]
    return Collection(tuple(sequence(r, name=f"take {i}") for i, r in enumerate(rows)))


# -- queries agree ------------------------------------------------------------------------


SPANS = st.lists(
    st.lists(st.tuples(st.integers(0, 2), st.integers(0, 20), st.integers(1, 8)), max_size=5),
    min_size=1,
    max_size=4,
)


def ranges_of(frames):
    """Hit ranges of sets of (document, frame)."""
    rows = []
    for document in sorted({d for d, _ in frames}):
        inside = sorted(n for d, n in frames if d == document)
        for _, run in itertools.groupby(enumerate(inside), lambda x: x[1] - x[0]):
            run = [n for _, n in run]
            rows.append((document, run[0], run[-1] + 1))
    return HitRanges(*np.array(rows, dtype=np.int64).reshape(-1, 3).T)


@given(SPANS, st.data())
def test_frames_count_where_enough_queries_agree(spans, data):
    votes = data.draw(st.integers(1, len(spans)))
    sets = [{(d, n) for d, start, n_ in one for n in range(start, start + n_)} for one in spans]
    counts = {frame: sum(frame in s for s in sets) for s in sets for frame in s}
    expected = ranges_of({frame for frame, n in counts.items() if n >= votes})
    assert list(agree([ranges_of(s) for s in sets], votes=votes)) == list(expected)


@pytest.mark.parametrize("votes", [0, 3])
def test_impossible_votes_are_refused(votes):
    with pytest.raises(InvalidInput, match="2 queries have 1 to 2 votes"):
        agree([HitRanges.none(), HitRanges.none()], votes=votes)


def test_windows_reach_twice_as_far_as_the_template(takes):
    shard = takes.parts[0].shard
    found = select_in_index([QUERY], LENGTH, shard.posting_index)
    hits = search_query(QUERY, shard.posting_index)
    before, after = margins(QUERY, LENGTH)
    assert (before, after) == (20, 12)
    assert list(found) == list(extend(hits, before, after, shard.lengths))
    for i, document in enumerate(takes.sequences):
        alone = select_in_sequence([QUERY], LENGTH, document.packed, document.known)
        assert alone.of(0) == found.of(i)


def test_windows_of_keyframes_without_a_place_hold_the_whole_template(takes):
    written = KeyframeQuery(
        QUERY.values, QUERY.fixed, QUERY.gaps, QUERY.feature_set, QUERY.feature_ids
    )
    shard = takes.parts[0].shard
    found = select_in_index([written], LENGTH, shard.posting_index)
    hits = search_query(written, shard.posting_index)
    assert list(found) == list(extend(hits, LENGTH, LENGTH, shard.lengths))


# -- searching ----------------------------------------------------------------------------


def hits_of(result):
    return [(h.recording.name, h.start_s, h.end_s, h.cost) for h in result]


def plain_hits(motion_class, collection, query):
    """Hits of every window as a document of its own: slow, and obviously right."""
    ((template, pattern),) = motion_class.patterns
    found = []
    for document in collection.sequences:
        ranges = select_in_sequence([query], template.n_columns, document.packed, document.known)
        for start, stop in ranges.of(0):
            packed, known = document.packed[start:stop], document.known[start:stop]
            distance = distance_function(pattern, packed, known)
            for hit in find_hits(distance, pattern, packed, known, threshold=np.inf):
                (path,) = align(pattern, packed, known, [hit.stop - 1])
                begin, end = (start + path.start) / 30, (start + path.end + 1) / 30
                found.append((path.cost, document.source, begin, end))
    kept = []
    for cost, name, begin, end in sorted(found):
        others = [(b, e) for n, b, e, _ in kept if n == name]
        # What lies for more than half within a better hit is that hit.
        if all(min(end, e) - max(begin, b) <= (end - begin) / 2 + 1e-9 for b, e in others):
            kept.append((name, begin, end, cost))
    return kept


@pytest.mark.parametrize("limit", [1, 2, 5, None])
def test_hits_around_keyframes_are_those_of_the_windows(takes, limit):
    motion_class = trained(queries=[QUERY], threshold=1.0)
    result = search(motion_class, takes, limit=limit)
    assert hits_of(result) == plain_hits(motion_class, takes, QUERY)[:limit]
    assert result.queries == (QUERY,)
    assert 0 < result.fraction_matched < 0.6


def test_what_lacks_a_keyframe_is_found_only_without_them(takes):
    motion_class = trained(queries=[QUERY])
    assert {h.recording.name for h in search(motion_class, takes)} == {"take 0", "take 1"}
    everywhere = search(motion_class, takes, preselect=False)
    assert len(everywhere) == len(search(motion_class, takes)) + 1
    assert everywhere.queries == ()
    assert everywhere.fraction_matched == 1
    assert hits_of(everywhere) == hits_of(search(trained(), takes))


def test_hits_carry_paths_through_the_whole_recording(takes):
    inside = search(trained(queries=[QUERY]), takes)[0]
    whole = search(trained(), takes)[0]
    assert inside == whole
    assert np.array_equal(inside.evidence.alignment.path, whole.evidence.alignment.path)
    assert str(explain(inside)) == str(explain(whole))


def test_several_queries_and_votes(takes):
    other = query_of((5, 12))
    both = trained(queries=[QUERY, other], votes=2)
    any_of = trained(queries=[QUERY, other])
    assert set(hits_of(search(both, takes))) < set(hits_of(search(any_of, takes)))
    assert search(any_of, takes).fraction_matched > search(both, takes).fraction_matched


def test_without_a_place_to_match_the_rarest_keyframe_is_told(takes):
    nowhere = from_features([dict.fromkeys(FULL_BODY.ids, True)], [])
    result = search(trained(queries=[nowhere]), takes)
    assert len(result) == 0
    assert result.fraction_matched == 0
    assert "no frame shows keyframe 1 of 1" in result.nearest


def test_given_keyframes_go_before_those_of_the_class(takes):
    nowhere = from_features([dict.fromkeys(FULL_BODY.ids, True)], [])
    assert len(search(trained(queries=[nowhere]), takes, preselect=QUERY)) == 3
    assert len(search(trained(), takes, preselect=[QUERY])) == 3
    template = trained().prototypes[0].template
    assert len(search(template, takes, preselect=QUERY, threshold=0.06)) == 3
    expansion = QueryExpansion(hits=0, by_self_information=False)
    example = search(sequence(STEP), takes, preselect=QUERY, threshold=0.06, expansion=expansion)
    assert len(example) == 3


def test_keyframes_of_other_features_are_refused(takes):
    query = from_features([{"F1": True}], [], vocabulary=FULL_BODY_2006)
    with pytest.raises(InvalidInput, match="both must be of one set"):
        search(trained(), takes, preselect=query)
    with pytest.raises(InvalidInput, match="both must be of one set"):
        Prototype("step", trained().prototypes[0].template, (query,))


# -- keyframes alone ----------------------------------------------------------------------


@given(cases())
def test_the_best_hit_of_every_end_is_found(case):
    full = full_mask(1, len(case.query.feature_ids))[0]
    documents = concatenate(case.packed, case.masks, full=full)
    fitted = fit_hits(case.query, documents)
    columns = np.diff(columns_of_query(case.query))
    expected = {}
    for begin, packed, known in zip(documents.starts, case.packed, case.masks, strict=True):
        for hit in single_hits(case.query, packed, known, limit=100_000):
            gaps = np.diff(hit)
            gap_cost = sum(
                0 if max(g, c) <= 1 and min(g, c) == max(g, c) else 1 - min(g, c) / max(g, c, 1)
                for g, c in zip(gaps, columns, strict=True)
                if max(g, c) > 1
            ) / max(len(gaps), 1)
            end = int(hit[-1] + begin)
            expected[end] = min(expected.get(end, 9), gap_cost)
    assert sorted(expected) == fitted.frames[:, -1].tolist()
    bounded = all(gap.most is not None for gap in case.query.gaps)
    for end, gap_cost in zip(fitted.frames[:, -1].tolist(), fitted.gap_costs, strict=True):
        if bounded:
            assert gap_cost == pytest.approx(expected[end])
        else:
            assert gap_cost >= expected[end] - 1e-9


def test_keyframes_are_sought_alone():
    rows = np.zeros((100, N), dtype=bool)
    rows[[10, 40, 60], 0] = True
    rows[[16, 43, 90], 2] = True
    collection = Collection((sequence(rows, name="take"),))
    query = parse_query("F1, then within 0.1 to 0.4 s F3")
    result = search(query, collection)
    assert [(h.start_s, h.end_s) for h in result] == [
        (pytest.approx(a / 30), pytest.approx(b / 30)) for a, b in ((10, 17), (40, 44))
    ]
    # The gap is made for 6 frames.
    assert [h.cost for h in result] == [0, pytest.approx(0.5)]
    assert "right hand moves forward (0.3–0.4 s)" in str(explain(result[0]))
    assert len(search(query, collection, threshold=0.4)) == 1
    assert len(search(query, collection, limit=1)) == 1
    assert result.queries == (query,)
    mirrored = search(parse_queries("F2\nor\nF1"), collection)
    assert [round(30 * h.start_s) for h in mirrored] == [10, 40, 60]


def test_hits_of_keyframes_do_not_overlap():
    rows = np.zeros((60, N), dtype=bool)
    rows[10:20, 0] = True
    rows[20:25, 2] = True
    collection = Collection((sequence(rows, name="take"),))
    result = search(parse_query("F1\nthen within 0 to 0.4 s\nF3"), collection, limit=None)
    spans = sorted((round(30 * h.start_s), round(30 * h.end_s)) for h in result)
    assert spans
    assert all(a[1] <= b[0] for a, b in itertools.pairwise(spans))


def test_keyframes_that_are_nowhere_say_why(takes):
    never = search(parse_query("F1, F2, F3, F4, F5, F6, F7, F8, F9, F10, F11, F12"), takes)
    assert never.nearest.startswith("no frame shows keyframe 1 of 1 (right hand moves forward, ")
    rows = np.zeros((50, N), dtype=bool)
    rows[10, 0] = rows[5, 2] = True
    late = Collection((sequence(rows, name="take"),))
    result = search(parse_query("F1\nthen within 0.5 s\nF3"), late)
    assert result.nearest == (
        "each keyframe is shown (1 in 1 frames, 2 in 1 frames), but never one after the other as "
        "asked for"
    )


def test_keyframes_that_fix_nothing_are_refused(takes):
    with pytest.raises(InvalidInput, match="would find everything"):
        search(parse_query("anything"), takes)


@pytest.mark.parametrize("wrong", ["a text", 3, [], [1]])
def test_what_cannot_be_sought_is_refused(takes, wrong):
    with pytest.raises(InvalidInput, match="query must be an example"):
        search(wrong, takes)


# -- derived keyframes --------------------------------------------------------------------


def gesture(start=0, n=10):
    """Relations that hold one after the other, as in a motion."""
    rows = np.zeros((60, N), dtype=bool)
    for i in range(n):
        rows[5 * i : 5 * i + 9, (start + i) % N] = True
    return rows


@pytest.fixture(scope="module")
def gestures():
    """Many gestures with stretches in common, at rest between."""
    rest = np.zeros((30, N), dtype=bool)
    rows = [np.concatenate([rest, gesture(i), rest, gesture(i + 17), rest]) for i in range(12)]
    return Collection(tuple(sequence(r, name=f"take {i}") for i, r in enumerate(rows)))


def test_derived_keyframes_are_shown_by_what_they_are_derived_from(gestures):
    sought = gesture(3)
    queries = derive_queries(template_of(sought), gestures, Deriving())
    assert len(queries) > 1
    for query in queries:
        assert len(query) <= 2
        assert all(int(n) <= 4 for n in np.bitwise_count(query.fixed).sum(axis=1))
        assert all(b - a >= 6 for a, b in itertools.pairwise(query.positions))
        packed = sequence(sought)
        hits = single_hits(query, packed.packed, packed.known)
        assert list(query.positions) in hits.tolist()
    # None uses what another has used.
    fixed = [np.bitwise_or.reduce(query.fixed, axis=0) for query in queries]
    assert sum(int(np.bitwise_count(f).sum()) for f in fixed) == int(
        np.bitwise_count(np.bitwise_or.reduce(fixed)).sum()
    )


def test_a_fast_search_finds_the_gesture(gestures):
    settings = {"threshold": 0.03, "expansion": QueryExpansion(hits=0)}
    fast = search(sequence(gesture(3)), gestures, preselect=True, **settings)
    slow = search(sequence(gesture(3)), gestures, **settings)
    assert set(hits_of(fast)) <= set(hits_of(slow))
    assert hits_of(fast)[0] == hits_of(slow)[0]
    assert fast[0].recording.name == "take 3"
    assert fast.queries
    assert 0 < fast.fraction_matched < 0.6


def test_nothing_rare_gives_no_keyframes():
    rows = np.zeros((60, N), dtype=bool)
    collection = Collection((sequence(rows, name="still"),))
    assert derive_queries(template_of(rows[:20]), collection, Deriving()) == ()
    result = search(sequence(rows[:20]), collection, preselect=True)
    assert result.fraction_matched == 1


def template_of(rows):
    library = learn({"it": [sequence(rows)]})
    return library["it"].prototypes[0].template


# -- labels -------------------------------------------------------------------------------


def labels_of(track):
    return [(x.name, x.start_s, x.end_s, x.cost) for x in track]


@pytest.mark.parametrize("number", [0, 1, 2])
def test_labels_without_keyframes_are_what_they_were(takes, number):
    document = takes.sequences[number]
    plain, with_queries = ClassLibrary((trained(),)), ClassLibrary((trained(queries=[QUERY]),))
    assert annotate_by_costs(document, plain, preselect=True) == annotate_by_costs(document, plain)
    expected = annotate_by_costs(document, plain)
    got = annotate_by_costs(document, with_queries, preselect=False)
    assert labels_of(got) == labels_of(expected)
    assert got.nearest == expected.nearest


def test_labels_lie_around_keyframes(takes):
    document = takes.sequences[1]
    library = ClassLibrary((trained(queries=[QUERY]),))
    every, some = (
        annotate_by_costs(document, library, preselect=False),
        annotate_by_costs(document, library),
    )
    assert len(every) == len(some) + 1
    assert set(labels_of(some)) < set(labels_of(every))
    for label in some:
        (same,) = (x for x in every if x == label)
        assert str(explain(label)) == str(explain(same))


def test_the_distance_is_infinite_outside_of_the_windows(takes):
    document = takes.sequences[1]
    found = class_distance(document, trained(queries=[QUERY], threshold=1.0))
    ranges = select_in_sequence([QUERY], LENGTH, document.packed, document.known)
    inside = np.zeros(len(document), dtype=bool)
    for start, stop in ranges.of(0):
        inside[start:stop] = True
    assert inside.any()
    assert not inside.all()
    assert np.isinf(found.modified[~inside]).all()
    assert all(inside[m.alignment.start : m.alignment.end + 1].all() for m in found.matches)


def test_every_window_is_matched_as_if_it_were_alone(takes):
    document = takes.sequences[0]
    motion_class = trained(queries=[QUERY], threshold=1.0)
    found = class_distance(document, motion_class)
    for start, stop in select_in_sequence([QUERY], LENGTH, document.packed).of(0):
        part = document.part(start, stop)
        alone = class_distance(part, motion_class, preselect=False)
        assert np.array_equal(found.modified[start:stop], alone.modified)


def test_without_labels_the_nearest_is_told_with_keyframes_or_without(takes):
    nowhere = from_features([dict.fromkeys(FULL_BODY.ids, True)], [])
    library = ClassLibrary((trained(queries=[nowhere]),))
    track = annotate_by_costs(takes.sequences[0], library)
    assert len(track) == 0
    assert track.nearest.startswith(
        "no class shows the keyframes that it needs; nearest without them: step 0.000 at "
    )
    far = annotate_by_costs(takes.sequences[2], library)
    assert far.nearest == annotate_by_costs(takes.sequences[2], ClassLibrary((trained(),))).nearest


def test_chosen_keyframes_of_a_class_label_it(gestures):
    library = learn({"gesture": [sequence(gesture(3))]})
    template = library["gesture"].quantised[0]
    chosen = choose_keyframes(template, count=2)
    query = from_template(
        template, [c.position for c in chosen], stiffness=0.5, groups=[c.group for c in chosen]
    )
    (prototype,) = library["gesture"].prototypes
    prototype = Prototype("gesture", prototype.template, (query,))
    some = ClassLibrary((MotionClass("gesture", (prototype,), 0.06),))
    (label,), (expected,) = (annotate_by_costs(gestures.sequences[3], x) for x in (some, library))
    assert (label.end_s, label.cost) == (expected.end_s, expected.cost)
    # Where a window begins, more ends are local minima.
    assert label.start_s == pytest.approx(expected.start_s, abs=0.5)


def test_a_gap_of_nothing_fits_itself():
    query = from_features([{"F1": True}, {"F3": True}], [Gap(0, 0)])
    rows = np.zeros((5, N), dtype=bool)
    rows[2, [0, 2]] = True
    (hit,) = search(query, Collection((sequence(rows, name="take"),)))
    assert hit.cost == 0
