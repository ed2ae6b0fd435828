"""How is a matrix of relations over time drawn?

In the manner of the papers: a relation is a row, time runs to the right; groups of
relations stand apart.

Conventions: matrices come time first, (columns, relations), as everywhere else; they are
turned only here.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from motionary.features import FeatureSet, known_sets
from motionary.plots.lettering import fit, text_width
from motionary.plots.style import HATCH, RULE, UNKNOWN, UNKNOWN_HATCH

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

ROW_HEIGHT = 0.165
#: Columns beyond what a page can show are drawn together.
MOST_COLUMNS = 1000

_LONGEST_PHRASE = 2.8
_LONGEST_GROUP = 1.0
_ID_GAP = 0.08
_NARROWEST_HATCH = 0.03


@dataclass(frozen=True, slots=True)
class Row:
    """What is written beside a row: short name, phrase and group; any may be empty."""

    id: str
    phrase: str
    group: str


def feature_rows(feature_set: FeatureSet) -> list[Row]:
    """Rows of a feature set, in the order of the bits."""
    return [Row(r.id, r.name, r.group) for r in feature_set.features]


def named_rows(names: Sequence[str], *, feature_set: FeatureSet | None, of: str) -> list[Row]:
    """Rows of named features, with phrases and groups where the set is known.

    Parameters
    ----------
    names : ids or phrases of the relations
    feature_set : where to look them up; None: among the sets that are known by name
    of : name of the feature set that the names belong to
    """
    chosen = feature_set or known_sets().get(of)
    if chosen is None:
        return [Row("", name, "") for name in names]
    rows = feature_rows(chosen)
    index = {row.phrase: row for row in rows} | {row.id: row for row in rows}
    return [index.get(name, Row("", name, "")) for name in names]


def blocks(rows: Sequence[Row]) -> list[slice]:
    """Runs of rows of one group."""
    runs = [len(list(run)) for _, run in groupby(rows, key=lambda row: row.group)]
    ends = np.cumsum(runs).tolist()
    return [slice(end - n, end) for n, end in zip(runs, ends, strict=True)]


def name_room(rows: Sequence[Row]) -> float:
    """Room for names on the left of a grid, inches."""
    phrases = max(text_width(fit(row.phrase, _LONGEST_PHRASE)) for row in rows)
    return phrases + _id_room(rows) + _ID_GAP


def group_room(rows: Sequence[Row]) -> float:
    """Room for the names of groups on the right of a grid, inches."""
    return max(text_width(fit(row.group, _LONGEST_GROUP)) for row in rows) + 0.1


def _id_room(rows: Sequence[Row]) -> float:
    widest = max(text_width(row.id) for row in rows)
    return widest + _ID_GAP if widest else 0.0


def draw_grid(axes: "Axes", colours: Floats, *, stop_s: float) -> None:
    """Cells of a grid.

    Parameters
    ----------
    colours : array, shape (columns, rows, 3), in [0, 1]
    stop_s : time at the right edge, seconds
    """
    n_rows = colours.shape[1]
    axes.imshow(
        colours.swapaxes(0, 1), aspect="auto", interpolation="nearest",
        extent=(0.0, stop_s, n_rows - 0.5, -0.5),
    )  # fmt: skip
    axes.hlines(np.arange(1, n_rows) - 0.5, 0.0, stop_s, color=RULE, linewidth=0.4)
    axes.set_ylim(n_rows - 0.5, -0.5)
    axes.set_yticks([])


def name_rows(axes: "Axes", rows: Sequence[Row]) -> None:
    """Names on the left of a grid: phrase, then the short name next to the cells."""
    for i, row in enumerate(rows):
        _beside(axes, row.id, i, -_ID_GAP / 2)
        _beside(axes, fit(row.phrase, _LONGEST_PHRASE), i, -_ID_GAP / 2 - _id_room(rows))


def _beside(axes: "Axes", text: str, row: int, inches: float) -> None:
    if text:
        axes.annotate(
            text, (0.0, row), xycoords=("axes fraction", "data"), xytext=(72 * inches, -0.5),
            textcoords="offset points", ha="right", va="center", annotation_clip=False,
        )  # fmt: skip


def name_group(axes: "Axes", group: str) -> None:
    """Name of a group on the right of its grid."""
    axes.annotate(
        fit(group, _LONGEST_GROUP), (1.0, 0.5), xycoords="axes fraction", xytext=(5, 0),
        textcoords="offset points", va="center", annotation_clip=False,
    )  # fmt: skip


def hatch_cells(axes: "Axes", cells: Flags, *, stop_s: float) -> None:
    """Hatching over the marked cells (columns, rows) of a grid."""
    from matplotlib.collections import PolyCollection

    width = axes.get_position().width * axes.get_figure(root=True).get_figwidth()  # type: ignore[union-attr]
    column_s = stop_s / len(cells)
    least = _NARROWEST_HATCH / width * len(cells)
    corners = []
    for row, marked in enumerate(cells.T):
        for first, stop in runs(marked):
            if stop - first >= least:
                left, right = first * column_s, stop * column_s
                top, low = row - 0.5, row + 0.5
                corners.append([(left, top), (right, top), (right, low), (left, low)])
    axes.add_collection(
        PolyCollection(
            corners, facecolor=UNKNOWN, edgecolor=UNKNOWN_HATCH, hatch=HATCH, linewidth=0
        ),
        autolim=False,
    )


def runs(marked: Flags) -> list[tuple[int, int]]:
    """Runs of True, half-open."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], marked, [False]]).astype(np.int8)))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def pool_starts(n_columns: int) -> NDArray[np.intp]:
    """First columns of the groups that are drawn as one; all where a page shows all."""
    n_groups = min(n_columns, MOST_COLUMNS)
    return np.asarray(np.arange(n_groups) * n_columns // n_groups, dtype=np.intp)
