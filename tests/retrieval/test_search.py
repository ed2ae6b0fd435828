"""Are the motions found that are there: by example, by template, by class?"""

import numpy as np
import pytest

from cli_cases import write_bvh
from motionary.errors import InvalidInput, UnreadableFile
from motionary.features import FULL_BODY, FULL_BODY_2006, compute_features, load_everyday_set
from motionary.io import read
from motionary.models.library import MotionClass, Prototype, TrainingOptions, learn, learn_classes
from motionary.models.templates import MotionTemplate
from motionary.retrieval.explanation import explain
from motionary.retrieval.index import Collection, collect
from motionary.retrieval.search import QueryExpansion, RelevanceFeedback, search
from motionary.samples import synthetic_motion, synthetic_stream
from packing_cases import N, random_rows, seconds, sequence, stream

LENGTH = 30
STEP, TURN = random_rows(1, LENGTH), random_rows(2, LENGTH)
AS_IT_IS = QueryExpansion(hits=0, by_self_information=False)


def flip(rows, n_features, *, seed=0):
    """Rows in which some relations are the opposite: each costs 1 in N."""
    changed = rows.copy()
    chosen = np.random.default_rng(seed).permutation(rows.shape[1])[:n_features]
    changed[:, chosen] ^= True
    return changed


def teach(training=None, **classes):
    examples = {name: [sequence(rows)] for name, rows in classes.items()}
    return learn(examples, training=training or TrainingOptions(by_self_information=False))


def spans(result):
    return [(h.recording.name, round(30 * h.start_s), round(30 * h.end_s)) for h in result]


@pytest.fixture(scope="module")
def takes():
    """Two takes: steps that fit ever worse, and where they start."""
    one, (a, b) = stream(flip(STEP, 4), STEP, seed=1)
    two, (c, d) = stream(TURN, flip(STEP, 2), seed=2)
    found = Collection((sequence(one, name="one"), sequence(two, name="two")))
    return found, {"worst": ("one", a), "best": ("one", b), "turn": ("two", c), "good": ("two", d)}


def span(place):
    name, start = place
    return (name, start, start + LENGTH)


# -- hits --------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["example", "template", "class"])
def test_hits_are_ranked_by_cost_over_all_recordings(takes, kind):
    collection, where = takes
    motion_class = teach(step=STEP)["step"]
    query = {
        "example": sequence(STEP),
        "template": motion_class.prototypes[0].template,
        "class": motion_class,
    }[kind]
    result = search(query, collection, limit=3, threshold=0.2, expansion=AS_IT_IS)
    assert spans(result) == [span(where[key]) for key in ("best", "good", "worst")]
    assert [hit.cost for hit in result] == pytest.approx([0, 2 / N, 4 / N])
    assert all(hit.known == 1 for hit in result)
    assert result.nearest == ""
    assert result.failures == ()
    assert len(result.templates) == 1


def test_the_classes_own_threshold_counts_unless_one_is_given(takes):
    collection, where = takes
    motion_class = teach(TrainingOptions(by_self_information=False, threshold=0.06), step=STEP)[
        "step"
    ]
    assert spans(search(motion_class, collection)) == [span(where["best"]), span(where["good"])]
    assert spans(search(motion_class, collection, threshold=0.0)) == [span(where["best"])]
    assert len(search(motion_class, collection, threshold=0.12)) == 3


def test_hits_name_the_files_own_frames():
    rows, (a,) = stream(STEP)
    about = {"rate_hz": 120.0, "n_frames": 4 * len(rows), "first_frame": 1}
    (hit,) = search(sequence(STEP), [sequence(rows, **about)], limit=1)
    assert (hit.start_s, hit.end_s) == (seconds(a), seconds(a + LENGTH))
    assert (hit.start_frame, hit.end_frame) == (4 * a + 1, 4 * (a + LENGTH))


@pytest.mark.parametrize("expansion", [AS_IT_IS, None], ids=["as it is", "grown"])
@pytest.mark.parametrize("seed", range(2))
def test_a_limit_keeps_the_first_hits(expansion, seed):
    takes = []
    for i in range(3):
        rng = np.random.default_rng([seed, i])
        parts = [flip(STEP, int(n), seed=i) for n in rng.integers(0, 12, 3)]
        takes.append(sequence(stream(*parts, seed=i)[0], name=f"take {i}"))
    every = search(sequence(STEP), Collection(tuple(takes)), limit=None, expansion=expansion)
    assert len(every) > 8
    costs = [hit.cost for hit in every]
    assert costs == sorted(costs)
    for limit in (1, 2, 5, len(every) + 1):
        some = search(sequence(STEP), Collection(tuple(takes)), limit=limit, expansion=expansion)
        assert list(some) == list(every)[:limit]


@pytest.mark.parametrize("limit", [0, -1])
def test_a_limit_below_1_is_refused(takes, limit):
    with pytest.raises(InvalidInput, match=rf"limit must be at least 1.*got {limit}"):
        search(sequence(STEP), takes[0], limit=limit)


def test_a_threshold_that_is_no_number_is_refused(takes):
    with pytest.raises(InvalidInput, match="threshold"):
        search(sequence(STEP), takes[0], threshold=float("nan"))


def test_hits_of_one_recording_do_not_repeat_each_other():
    rows, (a, b) = stream(STEP, STEP)
    hits = search(sequence(STEP), [sequence(rows)], threshold=0.3, expansion=AS_IT_IS)
    assert spans(hits) == [("", a, a + LENGTH), ("", b, b + LENGTH)]


def test_several_templates_of_a_class_do_not_double_hits():
    rows, (a, b) = stream(STEP, flip(STEP, 3), seed=5)
    examples = {"step": {"short": [sequence(STEP[4:])], "long": [sequence(STEP)]}}
    motion_class = learn_classes(examples, training=TrainingOptions(by_self_information=False))[
        "step"
    ]
    hits = search(motion_class, [sequence(rows)], threshold=0.2)
    # Both fit the first to the end; of two that cost the same the one that starts first stays.
    assert spans(hits)[0] == ("", a, a + LENGTH)
    assert [stop for _, _, stop in spans(hits)] == [a + LENGTH, b + LENGTH]


@pytest.mark.parametrize(("second_from", "stays"), [(12, True), (8, False)])
def test_matches_of_one_class_that_share_less_than_half_both_stay(second_from, stays):
    rows, (a,) = stream(STEP, seed=6)
    # Of the second way 8 of 18 frames lie in the first, or 12 of 22.
    examples = {"step": {"begin": [sequence(STEP[:20])], "end": [sequence(STEP[second_from:])]}}
    motion_class = learn_classes(examples, training=TrainingOptions(by_self_information=False))[
        "step"
    ]
    expected = [("", a, a + 20), ("", a + second_from, a + LENGTH)]
    assert spans(search(motion_class, [sequence(rows)])) == expected[: 1 + stays]


def test_the_same_input_gives_the_same_hits(takes):
    first, second = (search(sequence(STEP), takes[0], limit=None) for _ in range(2))
    assert list(first) == list(second)
    assert first.templates[0].values.tobytes() == second.templates[0].values.tobytes()


def test_recordings_of_equal_cost_come_in_their_order():
    rows, _ = stream(STEP)
    takes = [sequence(rows, name=name) for name in ("b", "a", "c")]
    assert [hit.recording.name for hit in search(sequence(STEP), takes, limit=3)] == ["b", "a", "c"]


# -- growing -----------------------------------------------------------------------------


def varied(n, *, seed=3, free=8):
    """Examples of a class: some relations are never twice the same, the rest always."""
    rows = []
    for i in range(n):
        example = STEP.copy()
        example[:, :free] = random_rows([seed, i], LENGTH, n_features=free)
        rows.append(example)
    return rows


def test_growing_frees_what_differs_between_the_example_and_its_hits():
    examples = varied(6)
    takes = [sequence(stream(e, seed=i)[0], name=f"take {i}") for i, e in enumerate(examples[1:])]
    example = sequence(examples[0], name="mine")
    plain = search(example, takes, expansion=AS_IT_IS, limit=5)
    expanded = search(
        example,
        takes,
        expansion=QueryExpansion(hits=3, reach=1.0, by_self_information=False),
        limit=5,
    )
    assert max(hit.cost for hit in expanded) < min(hit.cost for hit in plain)
    (template,) = expanded.templates
    assert template.n_examples == 4
    assert template.provenance == "expanded from mine and 3 hits"
    fixed = (template.values <= 0.1) | (template.values >= 0.9)
    assert fixed[:, 8:].all()
    assert fixed[:, :8].mean() < 0.5


@pytest.mark.parametrize("still", [0, 6])
@pytest.mark.parametrize("by_self_information", [False, True])
def test_an_example_teaches_itself_nothing(still, by_self_information):
    """Found in the collection, even where standing still makes its ends unsure."""
    examples = varied(4)
    pose = examples[0][:1]
    own = np.concatenate([np.repeat(pose, still, axis=0), examples[0]])
    if still:
        own = np.concatenate([own, np.repeat(own[-1:], still, axis=0)])
    rows = np.concatenate([random_rows(7, 40), np.repeat(pose, 9, axis=0), own, own[-1:], own[-1:]])
    rows = np.concatenate([rows, random_rows(8, 40)])
    start = 49
    takes = [sequence(rows, name="own take")]
    takes += [sequence(stream(e, seed=i)[0]) for i, e in enumerate(examples[1:], start=1)]
    example = takes[0].part(start, start + len(own))
    settings = QueryExpansion(hits=3, reach=1.0, by_self_information=by_self_information)
    result = search(example, takes, expansion=settings, limit=4)
    alone = search(example, takes[1:], expansion=settings, limit=3)
    assert result.templates[0].n_examples == alone.templates[0].n_examples == 4
    if not by_self_information:
        # What is rare depends on all recordings, the own take among them.
        assert np.array_equal(result.templates[0].values, alone.templates[0].values)


def test_a_hit_that_is_too_far_teaches_nothing(takes):
    collection, _ = takes
    result = search(
        sequence(STEP),
        collection,
        expansion=QueryExpansion(most_cost=0.07, by_self_information=False),
    )
    # The example itself and one take with two relations in 40 that differ.
    assert result.templates[0].n_examples == 2
    far = search(
        sequence(random_rows(9, LENGTH)), collection, expansion=QueryExpansion(most_cost=0.07)
    )
    assert far.templates[0].n_examples == 1


def test_what_is_rare_tells_more():
    # Relation 0 never holds elsewhere; two takes miss it, or a common one.
    quiet = np.zeros((LENGTH, N), dtype=np.bool_)
    quiet[:, 20:] = random_rows(1, LENGTH)[:, 20:]
    wanted = quiet.copy()
    wanted[10:20, 0] = True
    without_rare, without_common = quiet.copy(), wanted.copy()
    without_common[10:20, 30] ^= True
    calm = np.zeros((200, N), dtype=np.bool_)
    calm[:, 20:] = random_rows(5, 200)[:, 20:]
    takes = [
        sequence(np.concatenate([calm[:50], rows, calm[50:]]), name=name)
        for name, rows in (("no rare", without_rare), ("no common", without_common))
    ]
    plain = search(sequence(wanted), takes, limit=2, expansion=AS_IT_IS)
    weighed = search(sequence(wanted), takes, limit=2, expansion=QueryExpansion(hits=0))
    assert [hit.cost for hit in plain] == pytest.approx([0.25 / 30] * 2, rel=0.01)
    assert [hit.recording.name for hit in weighed] == ["no common", "no rare"]
    assert weighed[1].cost > 2 * weighed[0].cost


def test_what_the_first_hits_free_brings_the_next_ones_nearer():
    """Each example differs from the one before in six relations more."""
    rows = [STEP.copy() for _ in range(5)]
    for i in range(5):
        for feature in range(6 * i):
            rows[i][:, feature] ^= True
    takes = [sequence(stream(r, seed=i)[0], name=f"take {i}") for i, r in enumerate(rows[1:], 1)]
    settings = QueryExpansion(hits=4, reach=2.0, by_self_information=False)
    result = search(sequence(rows[0]), takes, expansion=settings, limit=4)
    assert [hit.recording.name for hit in result] == ["take 1", "take 2", "take 3", "take 4"]
    # Differs in 6, 12, 18, 24 of 40 relations from the example, in 6 from the one before.
    plain = search(sequence(rows[0]), takes, expansion=AS_IT_IS, limit=4)
    assert plain[2].cost > QueryExpansion().most_cost
    # One differs from the example in 18 relations.
    assert result.templates[0].n_examples == 4


def test_hits_that_cost_more_than_the_nearest_did_teach_nothing():
    near, far = flip(STEP, 2), flip(STEP, 8, seed=1)
    takes = [sequence(stream(rows, seed=i)[0]) for i, rows in enumerate((near, far, far))]
    result = search(sequence(STEP), takes, expansion=QueryExpansion(by_self_information=False))
    assert result.templates[0].n_examples == 2
    assert result.templates[0].provenance == "expanded from an example and 1 hit"


# -- a person's yes and no ---------------------------------------------------------------


def test_a_template_is_learned_from_the_hits_said_to_be_good():
    examples = varied(6)
    takes = [sequence(stream(e, seed=i)[0], name=f"take {i}") for i, e in enumerate(examples[1:])]
    example = sequence(examples[0], name="mine")
    first = search(example, takes, expansion=AS_IT_IS, limit=5)
    good = RelevanceFeedback(example, relevant=(first[3], first[1]))
    result = search(good, takes, expansion=QueryExpansion(by_self_information=False), limit=5)
    assert result.templates[0].provenance == "expanded from mine and 2 hits"
    for hit in (first[3], first[1]):
        (again,) = [h for h in result if h.recording.name == hit.recording.name]
        # One of three may not differ.
        assert again.cost < 0.01
    packed = tuple(hit.evidence.sequence.part(*frames(hit)) for hit in (first[3], first[1]))
    same = search(
        RelevanceFeedback(example, relevant=packed),
        takes,
        expansion=QueryExpansion(by_self_information=False),
        limit=5,
    )
    assert [hit.cost for hit in same] == [hit.cost for hit in result]


def frames(hit):
    return hit.evidence.alignment.start, hit.evidence.alignment.end + 1


@pytest.mark.parametrize("by_self_information", [False, True])
def test_what_a_bad_hit_shows_tells_less(by_self_information):
    wrong, right = STEP.copy(), STEP.copy()
    # As near as each other: which relation matters, only a person knows.
    wrong[:, 3] ^= True
    right[:, 5] ^= True
    takes = [sequence(stream(rows, seed=9)[0]) for rows in (wrong, right)]
    takes = [
        sequence(take.features, name=name)
        for take, name in zip(takes, ("wrong", "right"), strict=True)
    ]
    settings = QueryExpansion(hits=0, by_self_information=by_self_information, prior=1.0)
    first = search(sequence(STEP), takes, expansion=settings, limit=2)
    (bad,) = [hit for hit in first if hit.recording.name == "wrong"]
    result = search(
        RelevanceFeedback(sequence(STEP), irrelevant=(bad,)), takes, expansion=settings, limit=2
    )
    assert [hit.recording.name for hit in result] == ["right", "wrong"]
    assert result[1].cost > 1.5 * result[0].cost
    # It shows all that is sought but for one relation: so that one tells most.
    weights = result[0].evidence.pattern.entry_weights
    assert (weights[:, 3].sum() > weights.sum(axis=0)[[i for i in range(N) if i != 3]]).all()


def test_judgements_over_other_features():
    other = sequence(STEP[:, :39], feature_set=FULL_BODY_2006)
    with pytest.raises(InvalidInput, match="full-body-39"):
        search(RelevanceFeedback(sequence(STEP), relevant=(other,)), [sequence(TURN)])


# -- what was not seen -------------------------------------------------------------------


def blind(rows, *segments, features=slice(None), **about):
    known = np.ones_like(rows)
    for start, stop in segments:
        known[start:stop, features] = False
    return sequence(rows, known, **about)


@pytest.mark.parametrize("expansion", [AS_IT_IS, None], ids=["as it is", "default"])
def test_a_drop_out_is_never_a_hit(expansion):
    rows = np.zeros((200, N), dtype=np.bool_)
    result = search(sequence(STEP), [blind(rows, (0, 200))], limit=None, expansion=expansion)
    assert len(result) == 0
    assert "seen" in result.nearest
    rows, (a, b) = stream(STEP, STEP)
    takes = [blind(rows, (a - 10, a + LENGTH + 10))]
    result = search(sequence(STEP), takes, limit=None, expansion=expansion)
    assert spans(result)[0] == ("", b, b + LENGTH)
    assert all(0.5 <= hit.known <= 1 for hit in result)
    unseen = range(a - 10, a + LENGTH + 10)
    for _, start, stop in spans(result):
        assert len(set(unseen) & set(range(start, stop))) <= (stop - start) / 2


def test_a_partly_seen_hit_says_how_much_was_seen():
    rows, (a,) = stream(STEP)
    take = blind(rows, (0, len(rows)), features=slice(0, 10), name="take")
    (hit,) = search(sequence(STEP), [take], limit=1)
    assert spans([hit]) == [("take", a, a + LENGTH)]
    assert hit.cost == 0
    assert hit.known == (N - 10) / N


def test_what_an_example_does_not_show_is_not_asked_for():
    rows, (a,) = stream(STEP)
    example = blind(STEP, (0, LENGTH), features=slice(0, 15))
    (hit,) = search(example, [sequence(rows, name="take")], limit=1, expansion=AS_IT_IS)
    assert spans([hit]) == [("take", a, a + LENGTH)]
    assert (hit.cost, hit.known) == (0, 1)
    assert not hit.evidence.template.fixed[:, :15].any()


def test_an_example_of_which_nothing_is_known_is_refused(takes):
    example = blind(STEP, (0, LENGTH), name="dark.bvh")
    with pytest.raises(InvalidInput, match=r"dark\.bvh: nothing of the example is known"):
        search(example, takes[0])


# -- no answer ---------------------------------------------------------------------------


def test_without_a_hit_the_nearest_says_why(takes):
    collection, where = takes
    result = search(sequence(flip(TURN, 6)), collection, threshold=0.1, expansion=AS_IT_IS)
    assert len(result) == 0
    start = where["turn"][1] / 30
    assert result.nearest.startswith(
        f"nothing below 0.1; nearest: two 0.150 at {start:.1f} s, failed: "
    )


@pytest.mark.parametrize("expansion", [AS_IT_IS, None], ids=["as it is", "default"])
def test_an_example_longer_than_twice_every_recording(expansion):
    takes = [sequence(random_rows(i, 20)) for i in range(3)]
    example = sequence(random_rows(9, 60))
    result = search(example, takes, expansion=expansion)
    assert len(result) == 0
    assert "long enough" in result.nearest
    assert "1.0 s" in result.nearest


def test_nothing_to_search_is_refused():
    with pytest.raises(InvalidInput, match="no readable recording"):
        search(sequence(STEP), [])


def test_a_folder_without_recordings_or_that_is_not_there(tmp_path):
    with pytest.raises(UnreadableFile, match="no recordings in this folder"):
        search(sequence(STEP), tmp_path)
    with pytest.raises(UnreadableFile, match="no such file or folder"):
        search(sequence(STEP), tmp_path / "nowhere")


# -- what does not go together -----------------------------------------------------------


def of_2006(rows, **about):
    return sequence(rows[:, :39], feature_set=FULL_BODY_2006, **about)


def test_words_of_another_set_are_refused(takes):
    collection, _ = takes
    old = Collection((of_2006(stream(STEP)[0]),), FULL_BODY_2006)
    with pytest.raises(InvalidInput, match=r"full-body-39.*full-body-40"):
        search(of_2006(STEP), collection)
    for query in (teach(step=STEP)["step"], teach(step=STEP)["step"].prototypes[0].template):
        with pytest.raises(InvalidInput, match=r"full-body-40.*full-body-39"):
            search(query, old)
    with pytest.raises(InvalidInput, match=r"old take.*full-body-39.*full-body-40"):
        search(sequence(STEP), [of_2006(STEP, name="old take")])
    found = search(of_2006(STEP), old, limit=1)
    assert found[0].cost == 0


def test_a_template_that_is_free_everywhere_is_refused(takes):
    free = MotionTemplate(
        np.full((5, N), 0.5), np.ones(5), FULL_BODY.ids, FULL_BODY.name, provenance="a blur"
    )
    with pytest.raises(InvalidInput, match=r"a blur.*everything"):
        search(free, takes[0])
    motion_class = MotionClass("blur", (Prototype("blur", free),))
    with pytest.raises(InvalidInput, match=r"'blur'.*everything"):
        search(motion_class, takes[0])


# -- real motions in files ---------------------------------------------------------------


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Synthetic recordings as files, one of them broken."""
    folder = tmp_path_factory.mktemp("recordings")
    for seed in range(2):
        motion, _ = synthetic_stream(("squat", "kick_left"), seed=seed, rate_hz=30)
        write_bvh(motion, folder / "day one" / f"take {seed}.bvh")
    (folder / "broken.bvh").write_text("HIERARCHY\nROOT")
    (folder / "notes.txt").write_text("no recording")
    return folder


def test_a_broken_file_among_others_is_told_and_the_others_are_searched(folder):
    result = search(synthetic_motion("squat", seed=8), folder, limit=2)
    assert {hit.recording.name for hit in result} == {"day one/take 0.bvh", "day one/take 1.bvh"}
    (failure,) = result.failures
    assert failure.item[0] == "broken.bvh"
    assert isinstance(failure.error, UnreadableFile)


def test_a_folder_of_broken_files_says_why(tmp_path):
    (tmp_path / "broken.bvh").write_text("HIERARCHY\nROOT")
    with pytest.raises(InvalidInput, match=r"no readable recording.*broken\.bvh"):
        search(synthetic_motion("squat", seed=8), tmp_path)


def test_a_motion_finds_motions_of_its_kind_and_the_sentence_says_why(folder):
    query = synthetic_motion("kick_left", seed=8)
    result = search(query, folder, limit=2)
    for hit in result:
        seed = int(hit.recording.name.split()[-1][0])
        _, segments = synthetic_stream(("squat", "kick_left"), seed=seed, rate_hz=30)
        _, start_s, end_s = segments[1]
        assert start_s - 0.5 <= hit.start_s < hit.end_s <= end_s + 0.5
        assert "left" in str(explain(hit))


def test_files_motions_and_words_may_be_mixed(folder):
    path = folder / "day one" / "take 0.bvh"
    motion = read(folder / "day one" / "take 1.bvh")
    query = synthetic_motion("squat", seed=8)
    mixed = search(query, [path, motion, compute_features(motion)], limit=3)
    assert {hit.recording.name for hit in mixed} >= {"take 0.bvh"}
    assert len(mixed) == 3


def test_a_collection_is_searched_as_its_folder_is(folder):
    query = synthetic_motion("squat", seed=8)
    everyday = collect(folder, feature_set=load_everyday_set())
    assert search(query, everyday)[0].comparison is not None
    as_published = QueryExpansion(published=True)
    published = list(search(query, folder, expansion=as_published))
    assert list(search(query, collect(folder))) == published
    assert list(search(query, everyday, expansion=as_published)) == published
