"""Queries chosen from examples and counter-examples: what they keep and what they leave."""

from dataclasses import replace

import numpy as np
import pytest

from keyframe_cases import learned_template, sequence_of
from motionary.errors import InvalidInput
from motionary.features import FULL_BODY, FULL_BODY_2006
from motionary.matching import distance_function
from motionary.models.keyframes import (
    ChoiceSettings,
    choose_query,
    index_packed,
    search_packed,
    select_in_index,
)
from motionary.models.keyframes.choosing import align_columns
from motionary.models.templates import learn_template, pattern_of, quantise
from motionary.packing import pack, unpack

N = len(FULL_BODY)


# -- planted motions -------------------------------------------------------------------

#: Features that make the motion: 3 comes on, then 7 does while 3 goes off.
FIRST, SECOND = 3, 7
#: Changes at random, in examples and elsewhere.
NOISE = 20


def planted(rng, order=(FIRST, SECOND), n_frames=30):
    """A motion in which two features hold one after the other, in between nothing."""
    features = np.zeros((n_frames, N), dtype=bool)
    for feature, middle in zip(order, (n_frames // 4, 3 * n_frames // 4), strict=True):
        early, late = rng.integers(0, 2, size=2)
        features[middle - 5 + early : middle + 5 + late, feature] = True
    features[:, NOISE] = np.cumsum(rng.random(n_frames) < 0.3) % 2
    return sequence_of(features)


def problem(seed, n=6):
    rng = np.random.default_rng(seed)
    examples = [planted(rng, n_frames=int(rng.integers(26, 36))) for _ in range(n)]
    others = [planted(rng, order=(SECOND, FIRST)) for _ in range(n)]
    others += [sequence_of(np.zeros((30, N))) for _ in range(n)]
    return examples, others


def entries(query):
    """Features of each keyframe: index -> value."""
    values, fixed = unpack(query.values, N), unpack(query.fixed, N)
    return [
        {int(f): bool(values[k, f]) for f in np.flatnonzero(fixed[k])} for k in range(len(query))
    ]


@pytest.mark.parametrize("seed", range(5))
def test_the_order_of_two_features_is_found(seed):
    examples, others = problem(seed)
    chosen = choose_query(learned_template(examples), examples, others)
    assert chosen.missed == ()
    assert chosen.left <= ChoiceSettings().frames_left
    asked = {feature for keyframe in entries(chosen.query) for feature in keyframe}
    # What is the same everywhere, or at random, is not asked for.
    assert asked <= {FIRST, SECOND}
    unseen, _ = problem(seed + 100)
    assert all(len(search_packed(chosen.query, e.packed, e.known)) for e in unseen)


def test_the_same_input_gives_the_same_query():
    examples, others = problem(1)
    template = learned_template(examples)
    assert choose_query(template, examples, others) == choose_query(template, examples, others)


def test_more_may_be_left_so_less_is_asked():
    examples, others = problem(2)
    template = learned_template(examples)
    counts = [
        sum(map(len, entries(choose_query(template, examples, others, settings=c).query)))
        for c in (
            ChoiceSettings(frames_left=0.0),
            ChoiceSettings(frames_left=0.5),
            ChoiceSettings(frames_left=0.99),
        )
    ]
    assert counts == sorted(counts, reverse=True)
    assert counts[-1] == 2


def test_keyframes_keep_their_number_and_distance():
    examples, others = problem(3)
    settings = ChoiceSettings(least=3, most=3, min_distance=7, edge=4, step=1)
    query = choose_query(learned_template(examples), examples, others, settings=settings).query
    assert len(query) == 3
    assert min(np.diff(query.positions)) >= 7
    assert query.positions[0] >= 4


def test_gaps_admit_all_examples_and_more():
    examples, others = problem(4)
    template = learned_template(examples)
    query = choose_query(template, examples, others, settings=ChoiceSettings(stiffness=0.5)).query
    aligned = align_columns(template, examples, tolerance=2)
    for (a, b), gap in zip(
        zip(query.positions, query.positions[1:], strict=False), query.gaps, strict=True
    ):
        distances = aligned.frames[:, b] - aligned.frames[:, a]
        assert gap.least == np.floor(0.5 * distances.min())
        assert gap.most == np.ceil(distances.max() / 0.5)


def test_one_example_that_differs_is_missed_rather_than_the_query_spoilt():
    rng = np.random.default_rng(5)
    examples, others = problem(5, n=11)
    odd = sequence_of(np.zeros((30, N)))
    template = learned_template(examples)
    chosen = choose_query(template, [*examples, odd], others, settings=ChoiceSettings(step=1))
    assert chosen.missed == (11,)
    assert chosen.left <= ChoiceSettings().frames_left
    assert len(search_packed(chosen.query, planted(rng).packed))


def test_what_is_unknown_in_an_example_is_not_asked_for():
    examples, others = problem(6)
    blind = np.ones((len(examples[0]), N), dtype=bool)
    blind[:, FIRST] = False
    examples[0] = replace(examples[0], packed=examples[0].packed & pack(blind), known=pack(blind))
    query = choose_query(
        learned_template(examples[1:]), examples, others, settings=ChoiceSettings(exceptions=0.0)
    ).query
    assert all(FIRST not in keyframe for keyframe in entries(query))


@pytest.mark.parametrize(
    ("change", "packed"),
    [
        (dict(examples=[]), "at least one example, got none"),
        (dict(others=[]), "at least one counter-example, got none"),
        (dict(template=FULL_BODY_2006), "template is over"),
    ],
)
def test_bad_examples(change, packed):
    examples, others = problem(0)
    template = learned_template(examples)
    if "template" in change:
        template = learn_template(
            [examples[0].features[:, :39]],
            feature_names=FULL_BODY_2006.ids, feature_set=FULL_BODY_2006.name,
        )  # fmt: skip
    with pytest.raises(InvalidInput, match=packed):
        choose_query(template, change.get("examples", examples), change.get("others", others))


def test_examples_without_a_steady_feature_in_common():
    rng = np.random.default_rng(1)
    examples = [sequence_of(rng.random((30, N)) < 0.5) for _ in range(6)]
    with pytest.raises(InvalidInput, match="no feature that is steady"):
        choose_query(learned_template(examples[:1]), examples, examples)


def test_examples_that_are_too_short_for_two_keyframes():
    examples, others = problem(0)
    short = [example.part(0, 5) for example in examples]
    with pytest.raises(InvalidInput, match="1 of 2 keyframes that are 6 columns apart in"):
        choose_query(learned_template(short), short, others)


@pytest.mark.parametrize(
    "settings",
    [
        dict(frames_left=1.0), dict(frames_left=-0.1), dict(least=0), dict(least=3, most=2),
        dict(stiffness=0.0), dict(stiffness=1.1), dict(exceptions=0.5), dict(tolerance=-1),
        dict(step=0), dict(min_distance=0), dict(edge=-1), dict(gain=1.5),
        dict(disagreement_weight=-1.0),
    ],
)  # fmt: skip
def test_bad_settings(settings):
    with pytest.raises(InvalidInput, match=r"must|need"):
        ChoiceSettings(**settings)


# -- real recordings -------------------------------------------------------------------

CLASSES = ("depositFloorR", "hopBothLegs1hops", "kickLFront1Reps", "sneak2StepsLStart")
UNSEEN = ("mm", "tr")


def test_recall_is_kept_for_actors_never_seen(data, hdm05):
    paths = [p for name in CLASSES for p in sorted((data / "hdm05" / name).glob("*.[aA][mM][cC]"))]
    clips = {path: hdm05[path.stem] for path in paths}
    unseen = [path for path in paths if path.name.split("_")[1] in UNSEEN]
    index = index_packed(
        [clips[path].packed for path in unseen],
        feature_set=FULL_BODY.name, feature_ids=FULL_BODY.ids,
    )  # fmt: skip
    plain, kept, left = [], [], []
    for name in CLASSES:
        mine = [clips[p] for p in paths if p.parent.name == name and p not in unseen]
        others = [clips[p] for p in paths if p.parent.name != name and p not in unseen]
        template = learned_template(mine)
        chosen = choose_query(template, mine, others)
        windows = select_in_index([chosen.query], template.n_columns, index)
        left.append(windows.n_frames / index.n_frames - _fraction(clips, unseen, name))
        pattern = pattern_of(quantise(template, tolerance=0.1))
        wanted = [i for i, path in enumerate(unseen) if path.parent.name == name]
        packed = [clips[path].packed for path in unseen]
        plain.append(np.mean([_found(pattern, packed[i]) for i in wanted]))
        kept.append(
            np.mean(
                [any(_found(pattern, packed[i][a:b]) for a, b in windows.of(i)) for i in wanted]
            )
        )
    assert np.mean(kept) >= 0.9 * np.mean(plain)
    # Of the frames of other classes.
    assert np.mean(left) <= 0.06


def _fraction(clips, paths, name):
    mine = sum(len(clips[path]) for path in paths if path.parent.name == name)
    return mine / sum(len(clips[path]) for path in paths)


def _found(pattern, packed):
    return distance_function(pattern, packed).min(initial=np.inf) <= 0.1
