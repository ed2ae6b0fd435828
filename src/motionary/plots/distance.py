"""Where does a distance function say that a motion occurs?

After Müller and Röder (2006), figures 7 and 8: distance over time, low where a matching
motion ends; where no path fits, nothing is drawn.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motionary.errors import InvalidInput
from motionary.labels import LabelTrack
from motionary.plots.lettering import fit
from motionary.plots.page import Layout, add_legend, mark_seconds, new_page, swatch
from motionary.plots.segments import Stretch, draw_blocks
from motionary.plots.style import BLACK, BLUE, PALE_BLUE, RULE, TRUNK, VERMILLION, house_style

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_WIDTH = 7.5
_HEIGHTS = (1.9, 1.0)
_NAME_HEIGHT = 0.2
_TRUTH_SHARE = 0.08


@house_style()
def plot_distance(
    distances: Mapping[str, ArrayLike],
    *,
    hits: Mapping[str, Sequence[Stretch]] | None = None,
    threshold: float | None = None,
    truth: LabelTrack | None = None,
    rate_hz: float = 30.0,
    title: str = "",
) -> "Figure":
    """Picture of one or several distance functions of a recording, one below the other.

    Parameters
    ----------
    distances : per class an array, shape (frames,); inf and NaN are left blank
    hits : per class its hits or labels; shaded
    threshold : largest distance of a hit; drawn as a line
    truth : true labels of the recording; those of a panel's class stand in it as bars
    rate_hz : frames per second
    title : written above

    Raises
    ------
    InvalidInput
        If there is no distance function, one has no frame or another shape, or hits come
        for a class without one.
    """
    curves = _check(distances, hits or {}, rate_hz)
    tall = _HEIGHTS[0] if len(curves) == 1 else _HEIGHTS[1]
    layout = Layout(
        left=0.4, width=_WIDTH, heights=(tall,) * len(curves), gap=_NAME_HEIGHT + 0.06,
        above=_NAME_HEIGHT, right=0.1,
    )  # fmt: skip
    figure, (axes,) = new_page(layout, title=title or "distance")
    stop_s = max(len(curve) for curve in curves.values()) / rate_hz
    for ax, (name, curve) in zip(axes, curves.items(), strict=True):
        _draw_curve(ax, curve, rate_hz)
        _scale(ax, curve, threshold)
        for hit in (hits or {}).get(name, ()):
            ax.axvspan(hit.start_s, hit.end_s, color=PALE_BLUE, linewidth=0.5, zorder=0.5)
        _draw_truth(ax, truth, name, stop_s)
        ax.set_title(fit(name, _WIDTH), loc="left", pad=3.0)
    mark_seconds(axes, stop_s)
    has_hits = any(len(found) for found in (hits or {}).values())
    has_truth = truth is not None and any(label.name in curves for label in truth)
    add_legend(figure, _legend(hits=has_hits, threshold=threshold, truth=has_truth))
    return figure


def _check(
    distances: Mapping[str, ArrayLike], hits: Mapping[str, Sequence[Stretch]], rate_hz: float
) -> dict[str, NDArray[np.float64]]:
    if not isinstance(distances, Mapping) or not distances:
        raise InvalidInput(
            "a picture needs at least one distance function with its name, got "
            f"{type(distances).__name__}; pass {{name: array}}"
        )
    if not rate_hz > 0:
        raise InvalidInput(f"rate_hz must be a positive number, got {rate_hz}")
    curves = {name: np.array(values, dtype=np.float64) for name, values in distances.items()}
    for name, curve in curves.items():
        if curve.ndim != 1 or len(curve) == 0:
            raise InvalidInput(f"{name}: a distance needs shape (frames,), got {curve.shape}")
        curve[~np.isfinite(curve)] = np.nan
    strangers = sorted(set(hits) - set(curves))
    if strangers:
        raise InvalidInput(f"hits of {strangers[0]!r} need its distance function, got none")
    return curves


def _draw_curve(axes: "Axes", curve: NDArray[np.float64], rate_hz: float) -> None:
    # A frame's value stands at its middle: a recording of one frame shows, too.
    seconds = (np.arange(len(curve)) + 0.5) / rate_hz
    axes.plot(seconds, curve, color=BLUE, linewidth=1.1, solid_joinstyle="round")
    seen = ~np.isnan(curve)
    beside = np.concatenate([[False], seen, [False]])
    lonely = seen & ~beside[:-2] & ~beside[2:]
    axes.plot(seconds[lonely], curve[lonely], ".", color=BLUE, markersize=3)
    if not seen.any():
        axes.text(
            0.5, 0.5, "no match fits anywhere", transform=axes.transAxes, ha="center",
            va="center", color=TRUNK,
        )  # fmt: skip


def _scale(axes: "Axes", curve: NDArray[np.float64], threshold: float | None) -> None:
    values = curve[~np.isnan(curve)].tolist()
    if not values:
        axes.set_yticks([])
    if threshold is not None and np.isfinite(threshold):
        axes.axhline(threshold, color=VERMILLION, linewidth=1.0, linestyle=(0, (4, 2)))
        values.append(1.25 * threshold)
    top = 1.08 * max([*values, 0.01])
    axes.set_ylim(-_TRUTH_SHARE * top, top)
    if values:
        axes.locator_params(axis="y", nbins=5)
    axes.tick_params(axis="y", color=RULE, length=2.5, width=0.6)
    axes.spines[["top", "right"]].set_visible(False)


def _draw_truth(axes: "Axes", truth: LabelTrack | None, name: str, stop_s: float) -> None:
    low, top = axes.get_ylim()
    labels = [label for label in truth or () if label.name == name]
    draw_blocks(axes, labels, low=low, height=0.6 * -low, colour=BLACK, stop_s=stop_s)
    axes.set_ylim(low, top)


def _legend(*, hits: bool, threshold: float | None, truth: bool) -> "list[Artist]":
    from matplotlib.lines import Line2D

    handles: list[Artist] = [Line2D([], [], color=BLUE, label="distance")]
    if threshold is not None:
        line = Line2D([], [], color=VERMILLION, linestyle=(0, (4, 2)))
        line.set_label(f"threshold {threshold:g}")
        handles.append(line)
    if hits:
        handles.append(swatch("hit", PALE_BLUE))
    if truth:
        handles.append(swatch("truth", BLACK))
    return handles
