"""Which relations hold when?

The feature matrix of a recording, after Müller and Röder (2006), figure 2.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.features import FeatureSequence
from motionary.plots.grid import (
    MOST_COLUMNS,
    ROW_HEIGHT,
    Flags,
    Floats,
    blocks,
    draw_grid,
    feature_rows,
    group_room,
    hatch_cells,
    name_group,
    name_room,
    name_rows,
    pool_starts,
)
from motionary.plots.page import (
    Layout,
    add_legend,
    in_seconds,
    mark_seconds,
    new_page,
    swatch,
    unknown_swatch,
)
from motionary.plots.style import BLACK, FREE, UNKNOWN, WHITE, house_style

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.figure import Figure

_INCHES_PER_S = 0.35
_WIDTHS = (3.5, 7.5)


@house_style()
def plot_features(sequence: FeatureSequence, *, ids: Sequence[str] | None = None) -> "Figure":
    """Picture of a recording's relations over time.

    White where a relation holds, black where it does not, hatched where it is unknown. Of
    recordings longer than a page shows, neighbouring frames are drawn as one; grey then
    means that the relation changes among them.

    Parameters
    ----------
    sequence : FeatureSequence
    ids : relations to draw, in this order; all of them if left out

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
    layout = Layout(
        left=name_room(rows),
        width=float(np.clip(stop_s * _INCHES_PER_S, *_WIDTHS)),
        right=group_room(rows),
        heights=tuple((part.stop - part.start) * ROW_HEIGHT for part in parts),
    )
    title = f"{sequence.source or 'features'}, {in_seconds(stop_s)}"
    figure, (axes,) = new_page(layout, title=title)
    for ax, part in zip(axes, parts, strict=True):
        draw_grid(ax, _colours(fraction[:, part], unknown[:, part]), stop_s=stop_s)
        hatch_cells(ax, unknown[:, part], stop_s=stop_s)
        name_rows(ax, rows[part])
        name_group(ax, rows[part][0].group)
    mark_seconds(axes, stop_s)
    add_legend(
        figure, _legend(pooled=len(sequence) > MOST_COLUMNS, any_unknown=bool(unknown.any()))
    )
    return figure


def _choose(sequence: FeatureSequence, ids: Sequence[str] | None) -> list[int]:
    known = sequence.feature_set.ids
    chosen = known if ids is None else ids
    strangers = [i for i in chosen if i not in known]
    if strangers:
        raise InvalidInput(
            f"no relation {strangers[0]!r} in {sequence.feature_set.name!r}; "
            f"it has {', '.join(known)}"
        )
    if not chosen or len(sequence) == 0:
        raise InvalidInput(
            f"a picture needs relations and frames, got {len(chosen)} relations "
            f"and {len(sequence)} frames"
        )
    return [known.index(i) for i in chosen]


def _pool(features: NDArray[np.uint8], known: NDArray[np.uint8]) -> tuple[Floats, Flags]:
    """Share of the known frames in which a relation holds, and where most are unknown."""
    starts = pool_starts(len(features))
    sizes = np.diff(np.append(starts, len(features)))[:, np.newaxis]
    n_known = np.add.reduceat(known.astype(np.float64), starts, axis=0)
    n_true = np.add.reduceat(features.astype(np.float64), starts, axis=0)
    return n_true / np.maximum(n_known, 1.0), 2 * n_known < sizes


def _colours(fraction: Floats, unknown: Flags) -> Floats:
    from matplotlib.colors import to_rgb

    colours = np.repeat(fraction[:, :, np.newaxis], 3, axis=2)
    colours[unknown] = to_rgb(UNKNOWN)
    return colours


def _legend(*, pooled: bool, any_unknown: bool) -> "list[Artist]":
    handles = [swatch("holds", WHITE), swatch("does not hold", BLACK)]
    if pooled:
        handles.append(swatch("changes in between", FREE))
    if any_unknown:
        handles.append(unknown_swatch("unknown"))
    return handles
