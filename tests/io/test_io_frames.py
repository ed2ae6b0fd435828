"""Are numbers read at once the numbers that `float` reads one by one?"""

import math
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motionary.errors import UnreadableFile
from motionary.io.formats import numbers as frames
from motionary.io.formats.numbers import parse_number, read_frames, read_table
from motionary.io.formats.words import find_words, pad, to_floats

PATTERN = r"[+-]?([0-9]{1,12}\.?[0-9]{0,12}|\.[0-9]{1,12})([eE][+-]?[0-9]{1,2})?"
decimals = st.one_of(
    st.floats(-1e9, 1e9).map(repr),
    st.floats(allow_nan=False, allow_infinity=False).map(repr),
    st.decimals(-1000, 1000, places=4).map(str),
    st.from_regex(PATTERN, fullmatch=True),
)
blanks = st.sampled_from([" ", "\t", "  ", " \t "])


@settings(max_examples=25)
@given(st.lists(st.lists(decimals, min_size=3, max_size=3), min_size=1, max_size=12), blanks)
def test_numbers_are_those_of_float(rows, blank):
    text = "\n".join(blank.join(row) for row in rows)
    values = read_frames(text.encode(), [None] * 3)
    np.testing.assert_array_equal(values, [[float(word) for word in row] for row in rows])


def test_decimals_of_every_length_are_those_of_float():
    digits = "98765432109876543210"
    plain = [digits[:a] + dot + digits[:b] for a in range(18) for b in range(18) for dot in ".,"]
    words = [sign + word for word in plain for sign in ("", "-", "+")]
    for word in ("-0.0", "-0", "00000000.5", "1.2.3", "--1", "1-2", "+-1", "12e3", "1_0", "1x"):
        words += [word, word + "0" * 8, "0" * 8 + word]
    for shift in (0, 3):
        found = find_words(b" " * shift + " ".join(words).encode())
        values = to_floats(found)
        for word, value in zip(words, values.tolist(), strict=True):
            plain = re.fullmatch(r"[-+]?(\d+\.?\d*|\.\d+)", word)
            if plain and sum(map(str.isdigit, word)) <= 15:
                assert value.hex() == float(word).hex()
            else:
                assert math.isnan(value), word


@given(st.integers(1, 60), st.integers(1, 400), st.booleans())
def test_pieces_do_not_show(n_frames, piece, newline):
    rng = np.random.default_rng(n_frames)
    rows = [
        [str(i), "left leg"[:4], *map(repr, rng.normal(size=2).tolist()), "e1"]
        for i in range(n_frames)
    ]
    text = "\n".join(" ".join(row) for row in rows) + "\n" * newline
    expected = [[float(row[i]) for i in (0, 2, 3)] for row in rows]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(frames, "PIECE", piece)
        values = read_frames(text.encode(), [None, b"left", None, None, b"e1"])
    np.testing.assert_array_equal(values, expected)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "  \n ",
        "1 2 3",
        "1 2\n3",
        "1 2 3 4",
        "1 2\n3 x",
        "1 2\n3 nan",
        "1 2\n3 inf",
        "1 2\n3 1_0",
        "1 2\n3 1e999",
        "1 2\n3 1.2.3",
        "1 2\n3 --1",
        "1 2\n3 -",
        "1 2\n3 .",
        "1 2\n3 1-2",
        "1 2\n3 é",
        "1\n2 3 4",
    ],
)
def test_anything_else_is_none(text):
    assert read_frames(text.encode(), [None, None]) is None


WRONG_NAMES = ["1 lef 2", "1 leftt 2", "1 2 left", "1 Left 2", "1 left", "left 1 2"]


@pytest.mark.parametrize("text", WRONG_NAMES)
def test_names_must_stand_where_they_stand(text):
    assert read_frames(text.encode(), [None, b"left", None]) is None


def test_a_frame_may_go_on_in_the_next_line():
    values = read_frames(b"1 2\n3\n4 5\n6\n", [None] * 3)
    np.testing.assert_array_equal(values, [[1, 2, 3], [4, 5, 6]])


def test_frames_do_not_share_a_line_where_pieces_meet(monkeypatch):
    monkeypatch.setattr(frames, "PIECE", 4)
    assert read_frames(b"1 2\n3 4 5 6\n", [None] * 2) is None


def test_unknown_numbers_are_gaps_where_they_may_be():
    values = read_frames(b"1 -nan(ind)\n1.#QNAN 4\n", [None] * 2, gaps=frames.UNKNOWN_NUMBERS)
    np.testing.assert_array_equal(values, [[1, np.nan], [np.nan, 4]])


words = st.one_of(decimals, st.text("0123456789.+-eE_xn", min_size=1, max_size=20))


@given(st.lists(words, min_size=1, max_size=30), st.sampled_from(" ,\t"))
def test_compiled_words_are_those_of_numpy(found, separator):
    compiled = pytest.importorskip("motionary.io.formats._compiled_words", exc_type=ImportError)
    text = separator.join(found).encode() + b"\n"
    plain = find_words(text, ord(separator))
    starts, ends = np.empty((2, len(text)), dtype=np.intp)
    values = np.empty(len(text))
    n = compiled.scan(pad(text).buffer, ord(separator), starts, ends, values)
    np.testing.assert_array_equal(starts[:n], plain.starts)
    np.testing.assert_array_equal(ends[:n], plain.ends)
    expected = np.array([parse_number(word) for word in found])
    for got in (values[:n], to_floats(plain)):
        known = ~np.isnan(got)
        np.testing.assert_array_equal(got[known], expected[known])
        np.testing.assert_array_equal(np.signbit(got[known]), np.signbit(expected[known]))


cells = st.one_of(decimals, st.just(""), st.just("NaN"), st.just(" "))


@given(st.lists(st.lists(cells, max_size=4), max_size=12), st.sampled_from(",;\t"))
def test_cells_are_those_of_a_loop_over_lines(rows, separator):
    text = "\n".join(separator.join(row) for row in rows)
    gaps = ("", "nan")
    try:
        expected = frames._read_lines(text, 3, "x", 1, separator, gaps)
    except UnreadableFile as error:
        with pytest.raises(UnreadableFile, match=str(error)[:10]):
            read_table(text, 3, source="x", line=1, separator=separator, gaps=gaps)
        return
    for piece in (7, 1 << 17):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(frames, "PIECE", piece)
            got = read_table(text, 3, source="x", line=1, separator=separator, gaps=gaps)
        np.testing.assert_array_equal(got, expected)
