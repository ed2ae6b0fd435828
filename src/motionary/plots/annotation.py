"""Which labels does a recording carry, and which should it?

After the thesis, figure 5.2: a row per class, labels above truth; over it, on request, the
classes' modified distance functions in colours.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motionary.errors import InvalidInput
from motionary.labels import LabelTrack
from motionary.plots.grid import pool_starts
from motionary.plots.lettering import fit, text_width, wrap
from motionary.plots.page import (
    Layout,
    add_legend,
    add_ramp,
    mark_seconds,
    new_page,
    swatch,
    unknown_swatch,
)
from motionary.plots.segments import draw_blocks, hatch
from motionary.plots.style import (
    BLACK,
    FAINT,
    NEAR_TO_FAR,
    VERMILLION,
    WHITE,
    house_style,
)

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]

_WIDTH = 7.5
_LABEL_ROW = 0.26
_DISTANCE_ROW = 0.18
_LONGEST_NAME = 2.5
_BLOCK = 0.4
_NOTE_LINE = 0.17
_DISTANCE_HZ = 30.0


@house_style()
def plot_annotation(
    track: LabelTrack,
    truth: LabelTrack | None = None,
    *,
    distances: Mapping[str, ArrayLike] | None = None,
    classes: Sequence[str] | None = None,
) -> "Figure":
    """Picture of a recording's labels, over those that are true.

    Stretches that could not be assessed are hatched.

    Parameters
    ----------
    track : labels to show
    truth : labels to compare with
    distances : per class its modified distance function, shape (frames,) at 30 Hz;
        infinite where the class is out of the question: white
    classes : rows, in this order; labels of other classes are left out. By default all
        classes that occur, sorted

    Raises
    ------
    InvalidInput
        If a distance function is empty or not one-dimensional.
    """
    curves = _check(distances or {})
    names = _classes(track, truth, curves) if classes is None else list(classes)
    shown = [name for name in names if name in curves]
    stop_s = _stop_s(track, truth, curves)
    note = [] if len(track) else wrap(f"no labels: {track.nearest}".rstrip(": "), _WIDTH)
    heights = [len(shown) * _DISTANCE_ROW] if shown else []
    heights.append(max(len(names), 1) * _LABEL_ROW)
    layout = Layout(
        left=max([text_width(fit(name, _LONGEST_NAME)) for name in names] or [0.0]) + 0.1,
        width=_WIDTH, heights=tuple(heights), right=0.1, above=_NOTE_LINE * len(note),
    )  # fmt: skip
    figure, (axes,) = new_page(layout, title=track.recording)
    handles = _draw_labels(axes[-1], names, track, truth, stop_s)
    if shown:
        highest_cost = _draw_distances(axes[0], shown, curves)
        add_ramp(
            figure,
            _colours(np.linspace(0, 1, 128)[np.newaxis]),
            ("distance 0", f"{highest_cost:.2g}"),
        )
        handles.append(swatch("no match", WHITE))
    _draw_note(axes[0], note)
    mark_seconds(axes, stop_s)
    add_legend(figure, handles)
    return figure


def _check(distances: Mapping[str, ArrayLike]) -> dict[str, Floats]:
    curves = {name: np.asarray(values, dtype=np.float64) for name, values in distances.items()}
    for name, curve in curves.items():
        if curve.ndim != 1 or len(curve) == 0:
            raise InvalidInput(f"{name}: a distance needs shape (frames,), got {curve.shape}")
    return curves


def _classes(track: LabelTrack, truth: LabelTrack | None, more: Iterable[str]) -> list[str]:
    return sorted({*track.names, *(truth.names if truth else ()), *more})


def _stop_s(track: LabelTrack, truth: LabelTrack | None, curves: Mapping[str, Floats]) -> float:
    ends = [label.end_s for label in (*track, *(truth or ()))]
    ends += [stop for _, stop in track.unassessed]
    ends += [known.duration_s or 0.0 for known in (track, truth) if known is not None]
    ends += [len(curve) / _DISTANCE_HZ for curve in curves.values()]
    return max([*ends, 0.0]) or 1.0


def _draw_note(axes: "Axes", lines: Sequence[str]) -> None:
    if lines:
        axes.set_title("\n".join(lines), loc="left", pad=4.0)


def _draw_labels(
    axes: "Axes", names: Sequence[str], track: LabelTrack, truth: LabelTrack | None, stop_s: float
) -> "list[Artist]":
    handles = [swatch("labels", VERMILLION)]
    # Labels stand over the truth; alone, in the middle of their row.
    top = _BLOCK / 2 if truth is None else _BLOCK
    for row, name in enumerate(names):
        for labels, low, colour in ((track, row - top, VERMILLION), (truth or (), row, BLACK)):
            own = [label for label in labels if label.name == name]
            draw_blocks(axes, own, low=low, height=_BLOCK, colour=colour, stop_s=stop_s)
    if truth is not None:
        handles.append(swatch("truth", BLACK))
    if track.unassessed:
        hatch(axes, track.unassessed)
        handles.append(unknown_swatch("not assessed"))
    axes.hlines(np.arange(1, len(names)) - 0.5, 0, 1, transform=axes.get_yaxis_transform(),
                color=FAINT, linewidth=0.5, zorder=0.6)  # fmt: skip
    axes.set_ylim(max(len(names), 1) - 0.5, -0.5)
    _name_rows(axes, names)
    return handles


def _name_rows(axes: "Axes", names: Sequence[str]) -> None:
    axes.set_yticks(range(len(names)), labels=[fit(name, _LONGEST_NAME) for name in names])
    axes.tick_params(axis="y", length=0)


def _draw_distances(axes: "Axes", names: Sequence[str], curves: Mapping[str, Floats]) -> float:
    """Rows of colours; the distance at the far end of the scale comes back."""
    finite = [curves[name][np.isfinite(curves[name])] for name in names]
    highest_cost = max([float(part.max()) for part in finite if len(part)] or [0.0]) or 1.0
    for row, name in enumerate(names):
        curve = np.where(np.isfinite(curves[name]), curves[name], np.inf)
        # The nearest of neighbours drawn as one: a short match stays visible.
        pooled = np.minimum.reduceat(curve, pool_starts(len(curve)))
        axes.imshow(
            _colours(pooled[np.newaxis] / highest_cost), aspect="auto", interpolation="nearest",
            extent=(0.0, len(curve) / _DISTANCE_HZ, row + 0.5, row - 0.5),
        )  # fmt: skip
    axes.hlines(np.arange(1, len(names)) - 0.5, 0, 1, transform=axes.get_yaxis_transform(),
                color=FAINT, linewidth=0.5)  # fmt: skip
    axes.set_ylim(len(names) - 0.5, -0.5)
    _name_rows(axes, names)
    return highest_cost


def _colours(fractions: Floats) -> Floats:
    """Colours of distances from 0 to 1; infinite ones are white."""
    from matplotlib.colors import LinearSegmentedColormap

    colours = LinearSegmentedColormap.from_list("near to far", NEAR_TO_FAR)(fractions)[..., :3]
    colours[~np.isfinite(fractions)] = 1.0
    return np.asarray(colours, dtype=np.float64)
