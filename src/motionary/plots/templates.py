"""Motion templates and libraries of them.

Fractions of the examples as colours, after Müller and Röder (2006), figures 4 and 6; beside
them, on request, the cells that a tolerance fixes and those that it leaves free. Of a library
a strip for each template on one scale of time.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from motionary.errors import InvalidInput
from motionary.features import FeatureSet
from motionary.models.library import ClassLibrary, MotionClass, Prototype
from motionary.models.templates import RATE_HZ, ROUNDING_SLACK, MotionTemplate, quantise
from motionary.plots import style
from motionary.plots.features import (
    ROW_HEIGHT,
    Row,
    blocks,
    draw_grid,
    group_room,
    name_group,
    name_room,
    name_rows,
    named_rows,
    shade,
)
from motionary.plots.style import Flags, Floats

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_INCHES_PER_COLUMN = 0.045
_LEAST_WIDTH, _WIDTH_OF_ALL = 3.0, 7.5
_WEIGHTS_HEIGHT = 0.36
_STRIP_HEIGHT = 0.42
_INCHES_PER_SECOND = 1.0
_STRIP_WIDTHS = (2.4, 6.0)
_LONGEST_NAME = 2.6


@style.house_style()
def plot_template(
    template: MotionTemplate,
    *,
    tolerance: float | None = None,
    feature_set: FeatureSet | None = None,
    marks: Mapping[int, Sequence[tuple[int, int]]] | None = None,
) -> "Figure":
    """Picture of a template, and with a tolerance of its fixed cells beside it.

    White: the feature holds in all examples, black: in none, red to yellow: in some.
    Hatched: no example shows the feature. Below, the time that each column stands for. Framed:
    cells that are marked, as what recognised motion tells a track.

    Parameters
    ----------
    template : MotionTemplate
    tolerance : in [0, 0.5); as in `quantise`
    feature_set : gives the rows their phrases and groups; sets that are known by their
        name need not be given
    marks : columns, half-open, by the number of the feature

    Raises
    ------
    InvalidInput
        If the tolerance lies outside [0, 0.5).
    """
    rows = named_rows(template.feature_names, feature_set=feature_set, of=template.feature_set)
    panels = [("fraction of the examples in which the feature holds", _all_cells(template))]
    if tolerance is not None:
        heading = f"fixed and free cells at tolerance {tolerance:g}"
        panels.append((heading, _fixed_cells(template, tolerance)))
    parts = blocks(rows)
    heights = [(part.stop - part.start) * ROW_HEIGHT for part in parts]
    wanted = template.n_columns * _INCHES_PER_COLUMN
    layout = style.Layout(
        left=name_room(rows),
        width=float(np.clip(wanted, _LEAST_WIDTH, _WIDTH_OF_ALL / len(panels))),
        right=group_room(rows),
        heights=(*heights, _WEIGHTS_HEIGHT),
        above=0.2,
        n_stacks=len(panels),
    )
    figure, stacks = style.new_page(layout, title=_title(template))
    stop_s = template.n_columns / RATE_HZ
    unmeasured = _unmeasured(template)
    for axes, (heading, colours) in zip(stacks, panels, strict=True):
        for ax, part in zip(axes, parts, strict=False):
            draw_grid(ax, colours[:, part], unmeasured[:, part], stop_s=stop_s)
            _frame(ax, part, marks or {})
        axes[0].set_title(heading, loc="left", pad=4.0)
        _draw_weights(axes[-1], template.weights)
        style.mark_seconds(axes, stop_s)
    _name_grids(stacks, rows, parts)
    handles = _legend() if tolerance is not None else []
    if marks:
        handles.append(style.swatch("marked: given to tracks", style.GREEN))
    style.add_legend(figure, handles + _legend_of_unmeasured(template))
    style.add_ramp(figure, _ramp(), ("none of the examples", "all"))
    return figure


def _frame(axes: "Axes", part: slice, marks: Mapping[int, Sequence[tuple[int, int]]]) -> None:
    """Rectangles around marked cells of the rows of one block."""
    from matplotlib.patches import Rectangle

    for row, spans in marks.items():
        for first, stop in spans if part.start <= row < part.stop else ():
            corner = (first / RATE_HZ, row - part.start - 0.5)
            size = ((stop - first) / RATE_HZ, 1.0)
            axes.add_patch(Rectangle(corner, *size, fill=False, color=style.GREEN, linewidth=1.4))


def _title(template: MotionTemplate) -> str:
    examples = "1 example" if template.n_examples == 1 else f"{template.n_examples} examples"
    size = f"{examples}, {template.n_columns} columns, {style.in_seconds(template.duration_s)}"
    return f"{template.provenance}: {size}" if template.provenance else f"template of {size}"


def _fractions(values: Floats) -> Floats:
    """Colours of template values, shape (..., 3)."""
    from matplotlib.colors import LinearSegmentedColormap

    ramp = LinearSegmentedColormap.from_list("between", style.BETWEEN)
    colours = ramp(values)[..., :3]
    colours[values <= ROUNDING_SLACK] = 0.0
    colours[values >= 1.0 - ROUNDING_SLACK] = 1.0
    return np.asarray(colours, dtype=np.float64)


def _unmeasured(template: MotionTemplate) -> Flags:
    """Cells of features that no example shows, shape (columns, features)."""
    unmeasured = np.isin(template.feature_names, template.unmeasured)
    return np.tile(unmeasured, (template.n_columns, 1))


def _all_cells(template: MotionTemplate) -> Floats:
    from matplotlib.colors import to_rgb

    colours = _fractions(template.values)
    colours[_unmeasured(template)] = to_rgb(style.UNKNOWN)
    return colours


def _fixed_cells(template: MotionTemplate, tolerance: float) -> Floats:
    quantised = quantise(template, tolerance=tolerance)
    marked = {style.FREE: ~quantised.fixed, style.UNKNOWN: _unmeasured(template)}
    return shade(quantised.values, marked)


def _ramp() -> Floats:
    values = np.concatenate([np.zeros(24), np.linspace(0.01, 0.99, 152), np.ones(24)])
    return _fractions(values[np.newaxis])


def _draw_weights(axes: "Axes", weights: Floats) -> None:
    edges = np.arange(len(weights) + 1) / RATE_HZ
    axes.stairs(weights, edges, fill=True, color=style.BLUE)
    axes.axhline(1.0, color=style.RULE, linewidth=0.6)
    axes.set_ylim(0.0, max(1.25, 1.05 * float(weights.max())))
    axes.set_yticks([])


def _name_grids(stacks: "list[list[Axes]]", rows: list[Row], parts: list[slice]) -> None:
    for first, last, part in zip(stacks[0], stacks[-1], parts, strict=False):
        name_rows(first, rows[part])
        name_group(last, rows[part][0].group)
    stacks[0][-1].set_yticks([0.0, 1.0], labels=["0", "1"])
    stacks[0][-1].tick_params(axis="y", color=style.RULE, length=2.5, width=0.6)
    stacks[0][-1].set_ylabel("column weight", rotation="horizontal", ha="right", va="center")


def _legend() -> "list[Artist]":
    colours = {"holds": style.WHITE, "does not hold": style.BLACK, "free": style.FREE}
    return [style.swatch(label, colour) for label, colour in colours.items()]


def _legend_of_unmeasured(*templates: MotionTemplate) -> "list[Artist]":
    is_needed = any(template.unmeasured for template in templates)
    return [style.swatch("never measured")] if is_needed else []


@style.house_style()
def plot_library(library: ClassLibrary, *, title: str = "") -> "Figure":
    """Picture of a library.

    White: the feature must hold, black: it must not, grey: free, pale blue: no example shows it.

    Parameters
    ----------
    library : at least one class
    title : above the picture; left out, the library's provenance

    Raises
    ------
    InvalidInput
        If the library has no class.
    """
    strips = [(one, prototype) for one in library for prototype in one.prototypes]
    if not strips:
        raise InvalidInput("the library has no classes, so there is nothing to draw")
    longest_s = max(prototype.template.n_columns for _, prototype in strips) / RATE_HZ
    names = [style.fit(_name_of(one, prototype), _LONGEST_NAME) for one, prototype in strips]
    notes = [_note(one, prototype) for one, prototype in strips]
    layout = style.Layout(
        left=max(map(style.text_width, names)) + 0.1,
        width=float(np.clip(longest_s * _INCHES_PER_SECOND, *_STRIP_WIDTHS)),
        right=max(style.text_width(line) for note in notes for line in note) + 0.1,
        heights=(_STRIP_HEIGHT,) * len(strips),
    )
    heading = title or library.provenance or "classes of motion"
    figure, (axes,) = style.new_page(layout, title=heading)
    for ax, name, note, (one, prototype) in zip(axes, names, notes, strips, strict=True):
        _draw_strip(ax, one, prototype)
        _write(ax, name, note)
    style.mark_seconds(axes, longest_s)
    handles = _legend() + _legend_of_unmeasured(*(one.template for _, one in strips))
    style.add_legend(figure, handles)
    return figure


def _draw_strip(axes: "Axes", motion_class: MotionClass, prototype: Prototype) -> None:
    template = prototype.template
    colours = _fixed_cells(template, motion_class.tolerance)
    axes.imshow(
        colours.swapaxes(0, 1), aspect="auto", interpolation="nearest",
        extent=(0.0, template.n_columns / RATE_HZ, template.n_features - 0.5, -0.5),
    )  # fmt: skip
    # White cells end where the template does.
    axes.axvline(template.n_columns / RATE_HZ, color=style.RULE, linewidth=0.6)
    axes.set_yticks([])
    axes.spines[["top", "right", "left"]].set_visible(False)


def _write(axes: "Axes", name: str, note: tuple[str, str]) -> None:
    """Name on the left of a strip, and the note on its right."""
    for text, at, points, side in ((name, 0.0, -4, "right"), ("\n".join(note), 1.0, 4, "left")):
        axes.annotate(
            text, (at, sum(axes.get_ylim()) / 2), xycoords=("axes fraction", "data"), ha=side,
            xytext=(points, 0), textcoords="offset points", va="center", annotation_clip=False,
        )  # fmt: skip


def _name_of(motion_class: MotionClass, prototype: Prototype) -> str:
    if prototype.name.startswith(motion_class.name):
        return prototype.name
    return f"{motion_class.name} / {prototype.name}"


def _note(motion_class: MotionClass, prototype: Prototype) -> tuple[str, str]:
    n_examples = prototype.template.n_examples
    first = "1 example" if n_examples == 1 else f"{n_examples} examples"
    second = f"threshold {motion_class.threshold:.3g}"
    precision, recall = motion_class.estimated_precision, motion_class.estimated_recall
    if precision is not None and recall is not None:
        second += f": {100 * precision:.0f} % right, {100 * recall:.0f} % found"
    return first, second
