"""What happens along a recording: labels, distance functions, limbs beside their sensors.

Labels after the thesis, figure 5.2: a row per class, labels above truth; over it, on request,
the classes' modified distance functions in colours. Distance functions after Müller and Röder
(2006), figures 7 and 8: low where a matching motion ends; where no path fits, nothing is drawn.
Sensors after the thesis, figures 7.7 and 7.12: a row each, the angle between limb and sensor;
bars where it is wrong, hatched where one of both is not known.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from motionary.errors import InvalidInput
from motionary.labels import LabelTrack
from motionary.plots import style
from motionary.plots.features import pool_starts
from motionary.plots.style import Floats
from motionary.recording import find_runs

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from motionary.inertial import TrackingCheck

_WIDTH = 7.5
_LABEL_ROW = 0.26
_DISTANCE_ROW = 0.18
_LONGEST_NAME = 2.5
_BLOCK = 0.4
_SMALL_PT = 6.0
_NOTE_LINE = 0.17
_DISTANCE_HZ = 30.0
_HEIGHTS = (1.9, 1.0)
_NAME_HEIGHT = 0.2
_TRUTH_FRACTION = 0.08
_SENSOR_ROW = 0.42
# Angles beyond are drawn at the edge.
_MOST_DEG, _LIMITS_DEG = 45.0, (12.0, 25.0)
_POINTS = 1500


@style.house_style()
def plot_annotation(
    track: LabelTrack,
    truth: LabelTrack | None = None,
    *,
    distances: Mapping[str, ArrayLike] | None = None,
    classes: Sequence[str] | None = None,
    note: str = "",
) -> "Figure":
    """Picture of a recording's labels, over those that are true.

    Segments that could not be assessed are hatched. Labels by scores show how probably they
    are right, and their row how many there are.

    Parameters
    ----------
    track : labels to show
    truth : labels to compare with
    distances : per class its modified distance function, shape (frames,) at 30 Hz;
        infinite where the class is out of the question: white
    classes : rows, in this order; labels of other classes are left out. By default all
        classes that occur, sorted
    note : written above, such as the least score of a label

    Raises
    ------
    InvalidInput
        If a distance function is empty or not one-dimensional.
    """
    curves = _check_curves(distances or {})
    occurring = sorted({*track.names, *(truth.names if truth else ()), *curves})
    names = occurring if classes is None else list(classes)
    shown = [name for name in names if name in curves]
    stop_s = _stop_s(track, truth, curves)
    lines = style.wrap(note, _WIDTH) if note else []
    if not len(track):
        lines += style.wrap(f"no labels: {track.nearest}".rstrip(": "), _WIDTH)
    heights = [len(shown) * _DISTANCE_ROW] if shown else []
    heights.append(max(len(names), 1) * _LABEL_ROW)
    layout = style.Layout(
        left=max([style.text_width(text) for text in _count(names, track)] or [0.0]) + 0.1,
        width=_WIDTH, heights=tuple(heights), right=0.1, above=_NOTE_LINE * len(lines),
    )  # fmt: skip
    figure, (axes,) = style.new_page(layout, title=track.recording.name)
    handles = _draw_labels(axes[-1], names, track, truth, stop_s)
    if shown:
        highest_cost = _draw_distances(axes[0], shown, curves)
        ramp = _colours(np.linspace(0, 1, 128)[np.newaxis])
        style.add_ramp(figure, ramp, ("distance 0", f"{highest_cost:.2g}"))
        handles.append(style.swatch("no match", style.WHITE))
    if lines:
        axes[0].set_title("\n".join(lines), loc="left", pad=4.0)
    style.mark_seconds(axes, stop_s)
    style.add_legend(figure, handles)
    return figure


def _check_curves(distances: Mapping[str, ArrayLike]) -> dict[str, Floats]:
    curves = {name: np.array(values, dtype=np.float64) for name, values in distances.items()}
    for name, curve in curves.items():
        if curve.ndim != 1 or len(curve) == 0:
            raise InvalidInput(f"{name}: a distance needs shape (frames,), got {curve.shape}")
    return curves


def _stop_s(track: LabelTrack, truth: LabelTrack | None, curves: Mapping[str, Floats]) -> float:
    ends = [label.end_s for label in (*track, *(truth or ()))]
    ends += [stop for _, stop in track.unassessed]
    ends += [known.duration_s or 0.0 for known in (track, truth) if known is not None]
    ends += [len(curve) / _DISTANCE_HZ for curve in curves.values()]
    return max([*ends, 0.0]) or 1.0


def _draw_labels(
    axes: "Axes", names: Sequence[str], track: LabelTrack, truth: LabelTrack | None, stop_s: float
) -> "list[Artist]":
    handles = [style.swatch("labels", style.LABEL)]
    # Labels stand over the truth; alone, in the middle of their row.
    top = _BLOCK / 2 if truth is None else _BLOCK
    for row, name in enumerate(names):
        rows = (track, row - top, style.LABEL), (truth or (), row, style.TRUTH)
        for labels, low, colour in rows:
            own = [label for label in labels if label.name == name]
            style.draw_blocks(axes, own, low=low, height=_BLOCK, colour=colour, stop_s=stop_s)
    if truth is not None:
        handles.append(style.swatch("truth", style.TRUTH))
    if track.unassessed:
        style.hatch(axes, track.unassessed)
        handles.append(style.swatch("not assessed"))
    _write_probabilities(axes, names, track, top=top, stop_s=stop_s)
    _name_rows(axes, _count(names, track))
    return handles


def _write_probabilities(
    axes: "Axes", names: Sequence[str], track: LabelTrack, *, top: float, stop_s: float
) -> None:
    """How probably each label is right, in those that are long enough to hold it."""
    for label in track:
        if label.probability is None or label.name not in names:
            continue
        text = f"{label.probability:.0%}"
        width = (label.end_s - label.start_s) / stop_s * _WIDTH
        if style.text_width(text, size=_SMALL_PT) + 0.04 <= width:
            place = (label.start_s + label.end_s) / 2, names.index(label.name) - top + _BLOCK / 2
            axes.text(*place, text, fontsize=_SMALL_PT, color=style.WHITE, ha="center",
                      va="center_baseline", clip_on=True)  # fmt: skip


def _count(names: Sequence[str], track: LabelTrack) -> list[str]:
    """Names of rows; of labels by scores with their number."""
    shortened = [style.fit(name, _LONGEST_NAME) for name in names]
    if all(label.score is None for label in track):
        return shortened
    numbers = [sum(label.name == name for label in track) for name in names]
    return [f"{text} ({n})" for text, n in zip(shortened, numbers, strict=True)]


def _name_rows(axes: "Axes", names: Sequence[str]) -> None:
    axes.hlines(np.arange(1, len(names)) - 0.5, 0, 1, transform=axes.get_yaxis_transform(),
                color=style.FAINT, linewidth=0.5, zorder=0.6)  # fmt: skip
    axes.set_ylim(max(len(names), 1) - 0.5, -0.5)
    axes.set_yticks(range(len(names)), labels=names)
    axes.tick_params(axis="y", length=0)


def _draw_distances(axes: "Axes", names: Sequence[str], curves: Mapping[str, Floats]) -> float:
    """Rows of colours; the distance at the far end of the scale comes back."""
    finite = [curves[name][np.isfinite(curves[name])] for name in names]
    highest_cost = max([float(part.max()) for part in finite if len(part)] or [0.0]) or 1.0
    for row, name in enumerate(names):
        curve = np.where(np.isfinite(curves[name]), curves[name], np.inf)
        # The least of neighbours drawn as one: a short match stays visible.
        pooled = np.minimum.reduceat(curve, pool_starts(len(curve)))
        axes.imshow(
            _colours(pooled[np.newaxis] / highest_cost), aspect="auto", interpolation="nearest",
            extent=(0.0, len(curve) / _DISTANCE_HZ, row + 0.5, row - 0.5),
        )  # fmt: skip
    _name_rows(axes, [style.fit(name, _LONGEST_NAME) for name in names])
    return highest_cost


def _colours(fractions: Floats) -> Floats:
    """Colours of distances from 0 to 1; infinite ones are white."""
    from matplotlib.colors import LinearSegmentedColormap

    ramp = LinearSegmentedColormap.from_list("near to far", style.NEAR_TO_FAR)
    colours = ramp(fractions)[..., :3]
    colours[~np.isfinite(fractions)] = 1.0
    return np.asarray(colours, dtype=np.float64)


@style.house_style()
def plot_distance(
    distances: Mapping[str, ArrayLike],
    *,
    hits: Mapping[str, Sequence[style.Timed]] | None = None,
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
    curves = _check_panels(distances, hits or {}, rate_hz)
    tall = _HEIGHTS[0] if len(curves) == 1 else _HEIGHTS[1]
    layout = style.Layout(
        left=0.6, width=_WIDTH, heights=(tall,) * len(curves), gap=_NAME_HEIGHT + 0.06,
        above=_NAME_HEIGHT, right=0.1,
    )  # fmt: skip
    figure, (axes,) = style.new_page(layout, title=title or "distance")
    stop_s = max(len(curve) for curve in curves.values()) / rate_hz
    for ax, (name, curve) in zip(axes, curves.items(), strict=True):
        _draw_curve(ax, curve, rate_hz)
        _scale(ax, curve, threshold)
        ax.set_ylabel("distance", labelpad=2.0)
        for hit in (hits or {}).get(name, ()):
            _draw_hit(ax, hit, curve, stop_s=stop_s, rate_hz=rate_hz)
        low, top = ax.get_ylim()
        bars = [label for label in truth or () if label.name == name]
        height, colour = 0.6 * -low, style.TRUTH
        style.draw_blocks(ax, bars, low=low, height=height, colour=colour, stop_s=stop_s)
        ax.set_ylim(low, top)
        ax.set_title(style.fit(name, _WIDTH), loc="left", pad=3.0)
    style.mark_seconds(axes, stop_s)
    has_hits = any(len(found) for found in (hits or {}).values())
    has_truth = truth is not None and any(label.name in curves for label in truth)
    style.add_legend(figure, _legend(hits=has_hits, threshold=threshold, truth=has_truth))
    return figure


def _draw_hit(
    axes: "Axes", hit: style.Timed, curve: Floats, *, stop_s: float, rate_hz: float
) -> None:
    """A hit shaded, its end on the curve marked; its length and cost, where there is room."""
    axes.axvspan(hit.start_s, hit.end_s, color=style.PALE_BLUE, linewidth=0.5, zorder=0.5)
    last = min(max(round(hit.end_s * rate_hz) - 1, 0), len(curve) - 1)
    axes.plot((last + 0.5) / rate_hz, curve[last], "o", color=style.BLUE, markersize=3.5)
    cost = getattr(hit, "cost", None)
    text = f"{hit.end_s - hit.start_s:.1f} s" + ("" if cost is None else f"\n{cost:.3f}")
    inches = (hit.end_s - hit.start_s) / stop_s * _WIDTH
    if max(style.text_width(line) for line in text.split("\n")) < inches:
        axes.annotate(
            text, ((hit.start_s + hit.end_s) / 2, 1.0), xycoords=("data", "axes fraction"),
            xytext=(0, -2), textcoords="offset points", ha="center", va="top",
            size=style.TEXT_PT, color=style.TRUNK,
        )  # fmt: skip


def _check_panels(
    distances: Mapping[str, ArrayLike], hits: Mapping[str, Sequence[style.Timed]], rate_hz: float
) -> dict[str, Floats]:
    if not isinstance(distances, Mapping) or not distances:
        raise InvalidInput(
            "a picture needs at least one distance function with its name, got "
            f"{type(distances).__name__}; pass {{name: array}}"
        )
    if not rate_hz > 0:
        raise InvalidInput(f"rate_hz must be a positive number, got {rate_hz}")
    curves = _check_curves(distances)
    for curve in curves.values():
        curve[~np.isfinite(curve)] = np.nan
    strangers = sorted(set(hits) - set(curves))
    if strangers:
        raise InvalidInput(f"hits of {strangers[0]!r} need its distance function, got none")
    return curves


def _draw_curve(axes: "Axes", curve: Floats, rate_hz: float) -> None:
    # A frame's value stands at its middle: a recording of one frame shows, too.
    seconds = (np.arange(len(curve)) + 0.5) / rate_hz
    axes.plot(seconds, curve, color=style.BLUE, linewidth=1.1, solid_joinstyle="round")
    seen = ~np.isnan(curve)
    beside = np.concatenate([[False], seen, [False]])
    lonely = seen & ~beside[:-2] & ~beside[2:]
    axes.plot(seconds[lonely], curve[lonely], ".", color=style.BLUE, markersize=3)
    if not seen.any():
        axes.text(
            0.5, 0.5, "no match fits anywhere", transform=axes.transAxes, ha="center",
            va="center", color=style.TRUNK,
        )  # fmt: skip


def _scale(axes: "Axes", curve: Floats, threshold: float | None) -> None:
    values = curve[~np.isnan(curve)].tolist()
    if not values:
        axes.set_yticks([])
    if threshold is not None and np.isfinite(threshold):
        axes.axhline(threshold, color=style.THRESHOLD, linewidth=1.0, linestyle=(0, (4, 2)))
        values.append(1.25 * threshold)
    top = 1.08 * max([*values, 0.01])
    axes.set_ylim(-_TRUTH_FRACTION * top, top)
    if values:
        axes.locator_params(axis="y", nbins=5)
    axes.tick_params(axis="y", color=style.RULE, length=2.5, width=0.6)
    axes.spines[["top", "right"]].set_visible(False)


def _legend(*, hits: bool, threshold: float | None, truth: bool) -> "list[Artist]":
    from matplotlib.lines import Line2D

    curve = Line2D([], [], color=style.BLUE, label="distance of the best match that ends here")
    handles: list[Artist] = [curve]
    if threshold is not None:
        line = Line2D([], [], color=style.THRESHOLD, linestyle=(0, (4, 2)))
        line.set_label(f"threshold {threshold:g}")
        handles.append(line)
    if hits:
        handles.append(style.swatch("hit", style.PALE_BLUE))
        end = Line2D([], [], color=style.BLUE, marker="o", markersize=3.5, linestyle="")
        end.set_label("its end")
        handles.append(end)
    if truth:
        handles.append(style.swatch("truth", style.TRUTH))
    return handles


@style.house_style()
def plot_check(check: "TrackingCheck") -> "Figure":
    """Picture of the angles between limbs and sensors, and of what is wrong.

    Of the two lines, a wrong segment rises above the upper and stays above the lower.

    Parameters
    ----------
    check : a motion held against its sensors
    """
    if not check.limbs:
        raise InvalidInput("there is no sensor to draw")
    recording = check.track.recording
    names = [f"{one.limb or 'no limb'} ({one.sensor})" for one in check.limbs]
    layout = style.Layout(
        left=max(map(style.text_width, names)) + 0.55, width=_WIDTH, right=0.1,
        heights=(_SENSOR_ROW,) * len(names),
    )  # fmt: skip
    figure, (rows,) = style.new_page(layout, title=recording.name)
    for axes, one, name in zip(rows, check.limbs, names, strict=True):
        residual = np.minimum(one.residual_deg, _MOST_DEG)
        times = np.arange(len(residual)) / recording.rate_hz
        step = max(len(residual) // _POINTS, 1)
        # The largest of each block: a peak of one frame stays to be seen.
        highest = np.maximum.reduceat(np.nan_to_num(residual), np.arange(0, len(residual), step))
        axes.fill_between(times[::step], highest, color=style.BLUE, lw=0)
        for limit in _LIMITS_DEG:
            axes.axhline(limit, color=style.BLACK, lw=0.5, alpha=0.5)
        for first, stop in one.wrong:
            ends = first / recording.rate_hz, stop / recording.rate_hz
            axes.axvspan(*ends, color=style.PALE_ORANGE, linewidth=0.5, zorder=0.5)
        style.hatch(axes, (find_runs(np.isnan(residual)) / recording.rate_hz).tolist())
        axes.set_ylim(0, _MOST_DEG)
        axes.set_yticks([0, 30], ["0°", "30°"])
        axes.set_ylabel(name, rotation=0, ha="right", va="center", labelpad=6)
    style.mark_seconds(rows, recording.duration_s)
    handles = [
        style.swatch("angle between limb and sensor", style.BLUE),
        style.swatch("wrong", style.PALE_ORANGE),
        style.swatch("not known"),
    ]
    style.add_legend(figure, handles)
    return figure
