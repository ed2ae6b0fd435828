"""Keyframe queries as a person writes them."""

from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from keyframe_cases import SET, ids_of
from motionary.errors import InvalidInput
from motionary.features import FULL_BODY, FULL_BODY_2006
from motionary.models.keyframes import (
    Gap,
    KeyframeQuery,
    format_query,
    from_features,
    from_patterns,
    parse_query,
)
from motionary.packing import pack, unpack


class Stream(NamedTuple):
    """Features that are not of a body."""

    name: str
    ids: tuple[str, ...]
    names: tuple[str, ...]


def test_a_query_is_read():
    query = parse_query(
        """
        right hand above neck, not left knee bent
        then within 0.1 to 0.5 s
        right hand fast
        """
    )
    expected = [{"F3": True, "F21": False}, {"F13": True}]
    assert query == from_features(expected, [Gap(3, 15)])


def test_ids_case_comments_and_header():
    query = parse_query(
        """# my first query
        features: full-body-40
        f3,  NOT Left   Knee Bent   # the pose
        THEN WITHIN .1 to 0.5 seconds
        F13
        """
    )
    expected = [{"F3": True, "F21": False}, {"F13": True}]
    assert query == from_features(expected, [Gap(3, 15)])


@pytest.mark.parametrize(
    ("line", "gap"),
    [
        ("then within 0.1 to 0.5 s", (3, 15)),
        ("then within 0.1 s to 0.5 s", (3, 15)),
        ("then within 0.1 and 0.5 sec", (3, 15)),
        ("then within 2 s", (0, 60)),
        ("then after 0.2 s", (6, 6)),
        ("then after at least 0.2s", (6, None)),
        ("then", (0, None)),
        ("at the same time", (0, 0)),
    ],
)
def test_gaps_are_read(line, gap):
    assert parse_query(f"F1\n{line}\nF2").gaps == (gap,)


def test_a_keyframe_may_be_anything_and_tell_its_position():
    query = parse_query("at 0.1 s: F1\nthen\nat 0.5 s: anything")
    assert query.positions == (3, 15)
    assert query == from_features([{"F1": True}, {}], [Gap(0, None)], positions=[3, 15])


def test_a_query_is_written():
    features = [{"F3": True, "F21": False}, {}, {"F13": True}]
    query = from_features(features, [Gap(3, 15), Gap(7, None)], positions=[2, 9, 40])
    assert format_query(query) == (
        "features: full-body-40\n"
        "at 0.067 s: right hand above neck, not left knee bent\n"
        "then within 0.1 to 0.5 s\n"
        "at 0.3 s: anything\n"
        "then after at least 0.233 s\n"
        "at 1.333 s: right hand fast\n"
    )


@st.composite
def queries(draw, vocabulary=FULL_BODY):
    n_keyframes = draw(st.integers(1, 4))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    shape = (n_keyframes, len(vocabulary.ids))
    gaps = []
    for _ in range(n_keyframes - 1):
        least = draw(st.integers(0, 2000))
        most = draw(st.none() | st.integers(0, 2000))
        gaps.append(Gap(least, None if most is None else least + most))
    positions = sorted(rng.integers(0, 5000, n_keyframes).tolist())
    return KeyframeQuery(
        pack(rng.random(shape) < 0.5), pack(rng.random(shape) < 0.1), tuple(gaps),
        vocabulary.name, vocabulary.ids, tuple(positions) if draw(st.booleans()) else None,
    )  # fmt: skip


@given(query=queries(), rate_hz=st.sampled_from([24.0, 29.97, 30.0, 120.0, 1000.0]))
def test_what_is_written_reads_back(query, rate_hz):
    assert parse_query(format_query(query, rate_hz=rate_hz), rate_hz=rate_hz) == query


def test_other_streams_have_their_own_words():
    stream = Stream(SET, ids_of(3), ("door open", "light on", "someone in"))
    text = "door open, not light on\nthen within 1 s\nsomeone in"
    query = parse_query(text, vocabulary=stream, rate_hz=10)
    assert query.gaps == (Gap(0, 10),)
    assert parse_query(format_query(query, vocabulary=stream), vocabulary=stream).gaps == ((0, 10),)
    with pytest.raises(InvalidInput, match="both must be of one set"):
        format_query(query)


def test_names_that_would_be_misread_go_by_id():
    names = ("not here", "left, then right", "then", "twice", "Twice", "X1")
    stream = Stream(SET, ids_of(6), names)
    query = from_features([dict.fromkeys(ids_of(6), True)], [], vocabulary=stream)
    text = format_query(query, vocabulary=stream)
    assert text.splitlines()[1] == "X1, X2, X3, twice, X5, X6"
    assert parse_query(text, vocabulary=stream) == query


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("at 99999999999999999999 s: F1", "line 1: no feature"),
        ("F1\nthen within 99999999999999999999 s\nF2", "line 2: no gap of the form"),
        ("", "at least one keyframe"),
        ("# nothing", "at least one keyframe"),
        ("F1\nthen\nright hand abuve neck", "line 3: .*did you mean 'right hand above neck'"),
        ("\n\nF77", "line 3: no feature 'F77'"),
        ("F1,", "line 1: no feature ''"),
        ("F1\nF2", "line 2: between two keyframes there must be a gap"),
        ("then\nF1", "line 1: a gap must stand between"),
        ("F1\nthen\nthen\nF2", "line 3: a gap must stand between"),
        ("F1\nthen", "the last line must be a keyframe"),
        ("F1\nthen within 0.5 to 0.1 s\nF2", "line 2: a gap needs 0 <= least <= most"),
        ("F1\nthen within 0.01 to 0.02 s\nF2", "line 2: no frame of 30 Hz"),
        ("F1\nthen soon\nF2", "line 2: no gap of the form 'then soon'; write"),
        ("F1\nthen within 3 frames\nF2", "line 2: no gap of the form"),
        ("F1, not F1", "line 1: 'not F1' and its opposite"),
        ("F1, not right hand moves forward", "line 1: .* and its opposite"),
        ("at 0.1 s: F1\nthen\nF2", "either all keyframes give their position"),
        ("features: full-body-39\nF1", "line 1: the query is over 'full-body-39'"),
        ("F1\nfeatures: full-body-40", "line 2: the feature set is named in the first line"),
    ],
)
def test_errors_name_the_line(text, complaint):
    with pytest.raises(InvalidInput, match=complaint):
        parse_query(text)


def test_a_query_of_another_set_is_not_written():
    query = from_features([{"F1": True}], [])
    with pytest.raises(InvalidInput, match="both must be of one set"):
        format_query(query, vocabulary=FULL_BODY_2006)


def test_features_by_id_or_name():
    query = from_features([{"F3": True, "Left  Knee bent": False}], [])
    assert query.feature_set == "full-body-40"
    fixed, values = unpack(query.fixed, 40)[0], unpack(query.values, 40)[0]
    assert [FULL_BODY.ids[i] for i in np.flatnonzero(fixed)] == ["F3", "F21"]
    assert [FULL_BODY.ids[i] for i in np.flatnonzero(values)] == ["F3"]


@pytest.mark.parametrize(
    ("keyframes", "complaint"),
    [
        ([], "at least one keyframe"),
        ([{"right hand above the neck": True}], "did you mean 'right hand above neck'"),
        ([{"F99": True}], "no feature 'F99' in 'full-body-40'"),
        ([{"F3": True, "right hand above neck": False}], "to hold and not to hold"),
    ],
)
def test_unknown_features(keyframes, complaint):
    with pytest.raises(InvalidInput, match=complaint):
        from_features(keyframes, [])


def test_patterns_cover_their_group():
    query = from_patterns(
        ["1*0", "*1"], ["lower", "mix"], distances=[10], stiffness=[0.5], positions=[3, 13]
    )
    # lower begins with F15, mix with F27.
    first = from_features(
        [{"F15": True, "F17": False}, {"F28": True}], [Gap(5, 20)], positions=[3, 13]
    )
    assert query == first


@pytest.mark.parametrize(
    ("patterns", "groups", "stiffness", "complaint"),
    [
        (["1"], ["middle"], [], "no group 'middle'.*lower, mix, upper"),
        (["1" * 15], ["upper"], [], "at most 14 signs"),
        (["1?"], ["upper"], [], "got '1\\?'"),
        (["1", "0"], ["upper"], [1.0], "2 keyframes need as many groups"),
        (["1", "0"], ["upper"] * 2, [], "1 gaps need as many stiffness values, got 0"),
        ([], [], [], "at least one keyframe"),
    ],
)
def test_malformed_patterns(patterns, groups, stiffness, complaint):
    distances = [1] * max(len(patterns) - 1, 0)
    with pytest.raises(InvalidInput, match=complaint):
        from_patterns(patterns, groups, distances=distances, stiffness=stiffness)
