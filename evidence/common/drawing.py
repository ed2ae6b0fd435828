"""Curves of the pages: small multiples that share a legend."""

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from evidence.common.pages import called
from motionary.plots.style import BETWEEN, BLACK, BLUE, ORANGE, RULE, TRUNK, VERMILLION, house_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["BETWEEN", "BLACK", "BLUE", "ORANGE", "RULE", "TRUNK", "VERMILLION", "Panel",
           "draw_panels", "house_style", "new_figure"]  # fmt: skip

#: Line styles that differ in hue, lightness and dashes.
STYLES: tuple[dict[str, Any], ...] = (
    {"color": BLUE, "linestyle": "-", "marker": "o"},
    {"color": VERMILLION, "linestyle": (0, (4, 1.5)), "marker": "s"},
    {"color": BLACK, "linestyle": (0, (1, 1)), "marker": "^"},
    {"color": ORANGE, "linestyle": "-.", "marker": "D"},
)


class Panel(NamedTuple):
    """Axes with a title and curves over one scale.

    Attributes
    ----------
    title, x_label, y_label : text
    curves : name -> (x, y) or (x, y, low, high); None in y is left out
    y_limits : ends of the scale; chosen from the curves if left out
    """

    title: str
    curves: Mapping[str, tuple[Sequence[Any], ...]]
    x_label: str = ""
    y_label: str = ""
    y_limits: tuple[float, float] | None = None


def new_figure(
    rows: int,
    columns: int,
    size: tuple[float, float],
    *,
    sharex: bool = False,
    sharey: bool = False,
) -> "tuple[Figure, list[Axes]]":
    """A figure and its axes, row by row, open at the top and to the right."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained")
    axes = list(figure.subplots(rows, columns, squeeze=False, sharex=sharex, sharey=sharey).flat)
    for one in axes:
        one.spines[["top", "right"]].set_visible(False)
    return figure, axes


@house_style()
def draw_panels(
    panels: Sequence[Panel],
    *,
    columns: int,
    size: tuple[float, float] = (2.6, 1.9),
    decorate: "Callable[[Axes, int], None] | None" = None,
) -> "Figure":
    """Small multiples that share their legend."""
    from matplotlib.figure import Figure

    rows = -(-len(panels) // columns)
    figure = Figure(figsize=(size[0] * columns, size[1] * rows + 0.3), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False)
    handles: dict[str, Any] = {}
    for i, ax in enumerate(axes.flat):
        if i >= len(panels):
            ax.set_visible(False)
            continue
        _draw_panel(ax, panels[i], handles)
        if decorate:
            decorate(ax, i)
    figure.legend(
        handles.values(), map(called, handles), loc="outside upper left", ncols=len(handles),
        frameon=False,
    )  # fmt: skip
    return figure


def _draw_panel(axes: "Axes", panel: Panel, handles: dict[str, Any]) -> None:
    for name, curve in panel.curves.items():
        style = STYLES[list(handles).index(name) if name in handles else len(handles)]
        points = [p for p in zip(*curve, strict=True) if None not in p]
        if not points:
            continue
        columns = list(zip(*points, strict=True))
        (line,) = axes.plot(columns[0], columns[1], markersize=2.8, linewidth=1.1, **style)
        if len(columns) == 4:
            axes.fill_between(
                columns[0], columns[2], columns[3], color=style["color"], alpha=0.15, linewidth=0
            )
        handles.setdefault(name, line)
    axes.set_title(panel.title, loc="left", pad=3)
    axes.set(xlabel=panel.x_label, ylabel=panel.y_label)
    if panel.y_limits:
        axes.set_ylim(*panel.y_limits)
    axes.tick_params(color=RULE, length=2.5, width=0.6)
    axes.spines[["top", "right"]].set_visible(False)
