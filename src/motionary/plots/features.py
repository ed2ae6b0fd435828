"""Matrices of features over time: those of a recording, and the grid that others share.

In the manner of the papers (Müller and Röder 2006, figure 2): a feature is a row, time runs
to the right; groups of features stand apart.

Conventions: matrices come time first, (columns, features), as everywhere else; they are
turned only here.
"""

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.features import FeatureSequence, FeatureSet, known_sets
from motionary.plots import style
from motionary.plots.style import Flags, Floats
from motionary.recording import find_runs

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ROW_HEIGHT = 0.165
#: Columns beyond what a page can show are drawn together.
MOST_COLUMNS = 1000

_LONGEST_PHRASE = 2.8
_LONGEST_GROUP = 1.0
_ID_GAP = 0.08
_NARROWEST_HATCH = 0.03
_INCHES_PER_S = 0.35
_WIDTHS = (3.5, 7.5)


@style.house_style()
def plot_features(sequence: FeatureSequence, *, ids: Sequence[str] | None = None) -> "Figure":
    """Picture of a recording's features over time.

    White where a feature holds, black where it does not, hatched where it is unknown. Of
    recordings longer than a page shows, neighbouring frames are drawn as one; grey then
    means that the feature changes among them.

    Parameters
    ----------
    sequence : FeatureSequence
    ids : features to draw, in this order; all of them if left out

    Raises
    ------
    InvalidInput
        If an id is unknown, or nothing is left to draw.
    """
    chosen = _choose(sequence, ids)
    rows = [feature_rows(sequence.feature_set)[i] for i in chosen]
    fraction, unknown = _pool(sequence.features[:, chosen], sequence.known_features[:, chosen])
    stop_s = len(sequence) / sequence.rate_hz
    parts = blocks(rows)
    layout = style.Layout(
        left=name_room(rows),
        width=float(np.clip(stop_s * _INCHES_PER_S, *_WIDTHS)),
        right=group_room(rows),
        heights=tuple((part.stop - part.start) * ROW_HEIGHT for part in parts),
    )
    title = f"{sequence.source or 'features'}, {style.in_seconds(stop_s)}"
    figure, (axes,) = style.new_page(layout, title=title)
    colours = shade(fraction, {style.UNKNOWN: unknown})
    for ax, part in zip(axes, parts, strict=True):
        draw_grid(ax, colours[:, part], unknown[:, part], stop_s=stop_s)
        name_rows(ax, rows[part])
        name_group(ax, rows[part][0].group)
    style.mark_seconds(axes, stop_s)
    handles = [style.swatch("holds", style.WHITE), style.swatch("does not hold", style.BLACK)]
    if len(sequence) > MOST_COLUMNS:
        handles.append(style.swatch("changes in between", style.FREE))
    if unknown.any():
        handles.append(style.swatch("unknown"))
    style.add_legend(figure, handles)
    return figure


def _choose(sequence: FeatureSequence, ids: Sequence[str] | None) -> list[int]:
    known = sequence.feature_set.ids
    chosen = known if ids is None else ids
    strangers = [i for i in chosen if i not in known]
    if strangers:
        raise InvalidInput(
            f"no feature {strangers[0]!r} in {sequence.feature_set.name!r}; "
            f"it has {', '.join(known)}"
        )
    if not chosen or len(sequence) == 0:
        raise InvalidInput(
            f"a picture needs features and frames, got {len(chosen)} features "
            f"and {len(sequence)} frames"
        )
    return [known.index(i) for i in chosen]


def _pool(features: NDArray[np.uint8], known: NDArray[np.uint8]) -> tuple[Floats, Flags]:
    """Fraction of the known frames in which a feature holds, and where most are unknown."""
    starts = pool_starts(len(features))
    sizes = np.diff(np.append(starts, len(features)))[:, np.newaxis]
    n_known = np.add.reduceat(known.astype(np.float64), starts, axis=0)
    n_true = np.add.reduceat(features.astype(np.float64), starts, axis=0)
    return n_true / np.maximum(n_known, 1.0), 2 * n_known < sizes


# -- the grid --------------------------------------------------------------------------------


class Row(NamedTuple):
    """What is written beside a row: short name, phrase and group; any may be empty."""

    id: str
    phrase: str
    group: str


def feature_rows(feature_set: FeatureSet) -> list[Row]:
    """Rows of a feature set, in the order of the bits."""
    return [Row(r.id, r.name, r.group) for r in feature_set.features]


def named_rows(names: Sequence[str], *, feature_set: FeatureSet | None, of: str) -> list[Row]:
    """Rows of features named by ids or phrases, with phrases and groups where they are known.

    They are looked up in the feature set, else in that which is known by the name `of`.
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
    phrases = max(style.text_width(style.fit(row.phrase, _LONGEST_PHRASE)) for row in rows)
    return phrases + _id_room(rows) + _ID_GAP


def group_room(rows: Sequence[Row]) -> float:
    """Room for the names of groups on the right of a grid, inches."""
    return max(style.text_width(style.fit(row.group, _LONGEST_GROUP)) for row in rows) + 0.1


def _id_room(rows: Sequence[Row]) -> float:
    widest = max(style.text_width(row.id) for row in rows)
    return widest + _ID_GAP if widest else 0.0


def shade(fraction: Floats | Flags, marked: Mapping[str, Flags]) -> Floats:
    """Greys of fractions (columns, rows), shape (columns, rows, 3); marked cells in colours."""
    from matplotlib.colors import to_rgb

    colours = np.repeat(fraction[:, :, np.newaxis].astype(np.float64), 3, axis=2)
    for colour, cells in marked.items():
        colours[cells] = to_rgb(colour)
    return colours


def draw_grid(axes: "Axes", colours: Floats, unknown: Flags, *, stop_s: float) -> None:
    """Cells of a grid in colours (columns, rows, 3), up to a time; unknown ones are hatched."""
    n_rows = colours.shape[1]
    axes.imshow(
        colours.swapaxes(0, 1), aspect="auto", interpolation="nearest",
        extent=(0.0, stop_s, n_rows - 0.5, -0.5),
    )  # fmt: skip
    axes.hlines(np.arange(1, n_rows) - 0.5, 0.0, stop_s, color=style.RULE, linewidth=0.4)
    axes.set_ylim(n_rows - 0.5, -0.5)
    axes.set_yticks([])
    _hatch_cells(axes, unknown, stop_s)


def name_rows(axes: "Axes", rows: Sequence[Row]) -> None:
    """Names on the left of a grid: phrase, then the short name next to the cells."""
    beside_cells = -_ID_GAP / 2
    for i, row in enumerate(rows):
        phrase = style.fit(row.phrase, _LONGEST_PHRASE)
        for text, inches in ((row.id, beside_cells), (phrase, beside_cells - _id_room(rows))):
            if text:
                axes.annotate(
                    text, (0.0, i), xycoords=("axes fraction", "data"), ha="right", va="center",
                    xytext=(72 * inches, -0.5), textcoords="offset points", annotation_clip=False,
                )  # fmt: skip


def name_group(axes: "Axes", group: str) -> None:
    """Name of a group on the right of its grid."""
    axes.annotate(
        style.fit(group, _LONGEST_GROUP), (1.0, 0.5), xycoords="axes fraction", xytext=(5, 0),
        textcoords="offset points", va="center", annotation_clip=False,
    )  # fmt: skip


def _hatch_cells(axes: "Axes", cells: Flags, stop_s: float) -> None:
    from matplotlib.collections import PolyCollection

    width = axes.get_position().width * axes.get_figure(root=True).get_figwidth()  # type: ignore[union-attr]
    column_s = stop_s / len(cells)
    least = _NARROWEST_HATCH / width * len(cells)
    corners = []
    for row, marked in enumerate(cells.T):
        for first, stop in find_runs(marked).tolist():
            if stop - first >= least:
                left, right = first * column_s, stop * column_s
                top, low = row - 0.5, row + 0.5
                corners.append([(left, top), (right, top), (right, low), (left, low)])
    axes.add_collection(PolyCollection(corners, **style.UNKNOWN_PATCH), autolim=False)


def pool_starts(n_columns: int) -> NDArray[np.intp]:
    """First columns of the groups that are drawn as one; all where a page shows all."""
    n_groups = min(n_columns, MOST_COLUMNS)
    return np.asarray(np.arange(n_groups) * n_columns // n_groups, dtype=np.intp)
