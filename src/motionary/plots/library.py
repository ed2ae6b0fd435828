"""What is in a library of motion classes?

A strip for each template on one scale of time: its fixed cells, a relation a line; beside
it what the class was learned from, its threshold and what that promises.
"""

from typing import TYPE_CHECKING

import numpy as np

from motionary.errors import InvalidInput
from motionary.models.library import ClassLibrary, MotionClass, Prototype
from motionary.models.templates import RATE_HZ
from motionary.models.templates import quantise as quantise_template
from motionary.plots.lettering import fit, text_width
from motionary.plots.page import Layout, add_legend, mark_seconds, new_page, swatch
from motionary.plots.style import BLACK, FREE, RULE, WHITE, house_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_STRIP_HEIGHT = 0.42
_INCHES_PER_SECOND = 1.0
_LEAST_WIDTH, _MOST_WIDTH = 2.4, 6.0
_LONGEST_NAME = 2.6


@house_style()
def plot_library(library: ClassLibrary, *, title: str = "") -> "Figure":
    """Picture of a library.

    White: the relation must hold, black: it must not, grey: free.

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
    names = [fit(_name(one, prototype), _LONGEST_NAME) for one, prototype in strips]
    notes = [_note(one, prototype) for one, prototype in strips]
    layout = Layout(
        left=max(map(text_width, names)) + 0.1,
        width=float(np.clip(longest_s * _INCHES_PER_SECOND, _LEAST_WIDTH, _MOST_WIDTH)),
        right=max(text_width(line) for note in notes for line in note) + 0.1,
        heights=(_STRIP_HEIGHT,) * len(strips),
    )
    figure, (axes,) = new_page(layout, title=title or library.provenance or "classes of motion")
    for ax, name, note, (one, prototype) in zip(axes, names, notes, strips, strict=True):
        _draw_strip(ax, one, prototype)
        _write(ax, name, note)
    mark_seconds(axes, longest_s)
    add_legend(
        figure, [swatch("holds", WHITE), swatch("does not hold", BLACK), swatch("free", FREE)]
    )
    return figure


def _draw_strip(axes: "Axes", motion_class: MotionClass, prototype: Prototype) -> None:
    from matplotlib.colors import to_rgb

    template = quantise_template(prototype.template, tolerance=motion_class.tolerance)
    colours = np.repeat(template.values[:, :, np.newaxis].astype(np.float64), 3, axis=2)
    colours[~template.fixed] = to_rgb(FREE)
    axes.imshow(
        colours.swapaxes(0, 1), aspect="auto", interpolation="nearest",
        extent=(0.0, template.n_columns / RATE_HZ, template.n_features - 0.5, -0.5),
    )  # fmt: skip
    # White cells end where the template does.
    axes.axvline(template.n_columns / RATE_HZ, color=RULE, linewidth=0.6)
    axes.set_yticks([])
    for side in ("top", "right", "left"):
        axes.spines[side].set_visible(False)


def _write(axes: "Axes", name: str, note: tuple[str, str]) -> None:
    """Name on the left of a strip, and the note on its right."""
    middle = axes.get_ylim()
    axes.annotate(
        name, (0.0, sum(middle) / 2), xycoords=("axes fraction", "data"), xytext=(-4, 0),
        textcoords="offset points", ha="right", va="center", annotation_clip=False,
    )  # fmt: skip
    axes.annotate(
        "\n".join(note), (1.0, sum(middle) / 2), xycoords=("axes fraction", "data"), xytext=(4, 0),
        textcoords="offset points", ha="left", va="center", annotation_clip=False,
    )  # fmt: skip


def _name(motion_class: MotionClass, prototype: Prototype) -> str:
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
