"""How long is a stretch of a template, in columns?

Matching takes from half to double of a stretch (steps (1, 1), (1, 2), (2, 1)), so that a
range of lengths is one length whose half and double cover it.

Conventions: columns at 30 Hz; stretches are half-open.
"""

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.models.templates.template import RATE_HZ

#: Longer templates are slips of the pen: ten minutes.
MOST_S = 600.0


def count_columns(seconds: float, *, least: int = 1) -> int:
    """Columns of a stretch of so many seconds.

    Raises
    ------
    InvalidInput
        If it rounds to fewer than `least` columns, or lasts more than ten minutes.
    """
    if not 0.0 <= seconds <= MOST_S:
        raise InvalidInput(f"a template needs times from 0 to {MOST_S:g} s, got {seconds:g}")
    columns = math.floor(seconds * RATE_HZ + 0.5)
    if columns < least:
        raise InvalidInput(
            f"a stretch needs at least {least / RATE_HZ:.2f} s ({least} column), got {seconds:g}"
        )
    return columns


def fit_columns(least_s: float, most_s: float) -> int:
    """Columns of a stretch that matches any length of a range, and as little more as can be.

    Raises
    ------
    InvalidInput
        If the range is empty, or too wide for one stretch.
    """
    if not 0.0 < least_s <= most_s:
        raise InvalidInput(
            f"a range of lengths needs 0 < least <= most, got {least_s:g} to {most_s:g} s"
        )
    least, most = count_columns(least_s), count_columns(most_s)
    # K columns match 1 + ceil((K - 1) / 2) to 2 K - 1 frames.
    fewest, greatest = math.ceil((most + 1) / 2), 2 * least - 1
    if fewest > greatest:
        raise InvalidInput(
            f"{least_s:g} to {most_s:g} s is too wide: a stretch matches from half to double of "
            "its length, so the longest may be nearly four times the shortest; "
            "for wider gaps make a keyframe query"
        )
    return min(max(math.floor(math.sqrt(least * most) + 0.5), fewest), greatest)


def find_segments(columns: NDArray[np.generic]) -> list[tuple[int, int]]:
    """First and one past the last of each run of equal columns, shape (columns, ...)."""
    rows = columns.reshape(len(columns), -1)
    differ = (rows[1:] != rows[:-1]).any(axis=1)
    edges = [0, *(np.flatnonzero(differ) + 1).tolist(), len(columns)]
    return list(pairwise(edges))


def show_seconds(columns: int) -> str:
    """Seconds of so many columns, as short as finds the columns again."""
    # Two digits do: a column is 0.033 s long.
    text = f"{columns / RATE_HZ:.2f}"
    return text.rstrip("0").rstrip(".")
