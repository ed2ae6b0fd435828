"""What is a motion template made of?

Shares of the examples as colours, after Müller and Röder (2006), figures 4 and 6; beside
them, on request, the cells that a tolerance fixes and those that it leaves free.
"""

from typing import TYPE_CHECKING

import numpy as np

from motionary.features import FeatureSet
from motionary.models.templates import RATE_HZ, MotionTemplate, quantise
from motionary.models.templates.template import ROUNDING_SLACK
from motionary.plots.grid import (
    ROW_HEIGHT,
    Floats,
    Row,
    blocks,
    draw_grid,
    group_room,
    name_group,
    name_room,
    name_rows,
    named_rows,
)
from motionary.plots.page import (
    Layout,
    add_legend,
    add_ramp,
    in_seconds,
    mark_seconds,
    new_page,
    swatch,
)
from motionary.plots.style import BETWEEN, BLACK, BLUE, FREE, RULE, WHITE, house_style

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_INCHES_PER_COLUMN = 0.045
_LEAST_WIDTH, _WIDTH_OF_ALL = 3.0, 7.5
_WEIGHTS_HEIGHT = 0.36


@house_style()
def plot_template(
    template: MotionTemplate,
    *,
    tolerance: float | None = None,
    feature_set: FeatureSet | None = None,
) -> "Figure":
    """Picture of a template, and with a tolerance of its fixed cells beside it.

    White: the relation holds in all examples, black: in none, red to yellow: in some.
    Below, the time that each column stands for.

    Parameters
    ----------
    template : MotionTemplate
    tolerance : in [0, 0.5); as in `quantise`
    feature_set : gives the rows their phrases and groups; sets that are known by their
        name need not be given

    Raises
    ------
    InvalidInput
        If the tolerance lies outside [0, 0.5).
    """
    rows = named_rows(template.feature_names, feature_set=feature_set, of=template.feature_set)
    panels = [("share of the examples in which the relation holds", _fractions(template.values))]
    if tolerance is not None:
        packed = f"fixed and free cells at tolerance {tolerance:g}"
        panels.append((packed, _fixed_cells(template, tolerance)))
    parts = blocks(rows)
    heights = [(part.stop - part.start) * ROW_HEIGHT for part in parts]
    wanted = template.n_columns * _INCHES_PER_COLUMN
    layout = Layout(
        left=name_room(rows),
        width=float(np.clip(wanted, _LEAST_WIDTH, _WIDTH_OF_ALL / len(panels))),
        right=group_room(rows),
        heights=(*heights, _WEIGHTS_HEIGHT),
        above=0.2,
        n_stacks=len(panels),
    )
    figure, stacks = new_page(layout, title=_title(template))
    stop_s = template.n_columns / RATE_HZ
    for axes, (packed, colours) in zip(stacks, panels, strict=True):
        for ax, part in zip(axes, parts, strict=False):
            draw_grid(ax, colours[:, part], stop_s=stop_s)
        axes[0].set_title(packed, loc="left", pad=4.0)
        _draw_weights(axes[-1], template.weights)
        mark_seconds(axes, stop_s)
    _name(stacks, rows, parts)
    add_legend(figure, _legend(quantised=tolerance is not None))
    add_ramp(figure, _ramp(), ("none of the examples", "all"))
    return figure


def _title(template: MotionTemplate) -> str:
    examples = "1 example" if template.n_examples == 1 else f"{template.n_examples} examples"
    size = f"{examples}, {template.n_columns} columns, {in_seconds(template.duration_s)}"
    return f"{template.provenance}: {size}" if template.provenance else f"template of {size}"


def _fractions(values: Floats) -> Floats:
    """Colours of template values, shape (..., 3)."""
    from matplotlib.colors import LinearSegmentedColormap

    ramp = LinearSegmentedColormap.from_list("between", BETWEEN)
    colours = ramp(values)[..., :3]
    colours[values <= ROUNDING_SLACK] = 0.0
    colours[values >= 1.0 - ROUNDING_SLACK] = 1.0
    return np.asarray(colours, dtype=np.float64)


def _fixed_cells(template: MotionTemplate, tolerance: float) -> Floats:
    from matplotlib.colors import to_rgb

    quantised = quantise(template, tolerance=tolerance)
    colours = np.repeat(quantised.values[:, :, np.newaxis].astype(np.float64), 3, axis=2)
    colours[~quantised.fixed] = to_rgb(FREE)
    return colours


def _ramp() -> Floats:
    values = np.concatenate([np.zeros(24), np.linspace(0.01, 0.99, 152), np.ones(24)])
    return _fractions(values[np.newaxis])


def _draw_weights(axes: "Axes", weights: Floats) -> None:
    edges = np.arange(len(weights) + 1) / RATE_HZ
    axes.stairs(weights, edges, fill=True, color=BLUE)
    axes.axhline(1.0, color=RULE, linewidth=0.6)
    axes.set_ylim(0.0, max(1.25, 1.05 * float(weights.max())))
    axes.set_yticks([])


def _name(stacks: "list[list[Axes]]", rows: list[Row], parts: list[slice]) -> None:
    for first, last, part in zip(stacks[0], stacks[-1], parts, strict=False):
        name_rows(first, rows[part])
        name_group(last, rows[part][0].group)
    stacks[0][-1].set_yticks([0.0, 1.0], labels=["0", "1"])
    stacks[0][-1].tick_params(axis="y", color=RULE, length=2.5, width=0.6)
    stacks[0][-1].set_ylabel("column weight", rotation="horizontal", ha="right", va="center")


def _legend(*, quantised: bool) -> "list[Artist]":
    if not quantised:
        return []
    return [swatch("holds", WHITE), swatch("does not hold", BLACK), swatch("free", FREE)]
