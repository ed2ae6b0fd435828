"""How far limbs and their sensors disagree along a recording.

After the thesis, figures 7.7 and 7.12: a row per sensor, the angle between limb and sensor; bars
where it is wrong, hatched where one of both is not known.
"""

from typing import TYPE_CHECKING

import numpy as np

from motionary.errors import InvalidInput
from motionary.plots import page, style
from motionary.recording import find_runs

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from motionary.inertial import TrackingCheck

_WIDTH = 7.5
_ROW = 0.42
# Angles beyond are drawn at the edge.
_MOST_DEG = 45.0
_POINTS = 1500


@style.house_style()
def plot_check(
    check: "TrackingCheck", *, limits_deg: tuple[float, float] = (12.0, 25.0)
) -> "Figure":
    """Picture of the angles between limbs and sensors, and of what is wrong.

    Parameters
    ----------
    check : a motion held against its sensors
    limits_deg : drawn as lines: above the first a stretch goes on, above the second it is one
    """
    if not check.limbs:
        raise InvalidInput("there is no sensor to draw")
    recording = check.track.recording
    names = [f"{one.limb or 'no limb'} ({one.sensor})" for one in check.limbs]
    layout = page.Layout(
        left=max(style.text_width(name) for name in names) + 0.55,
        width=_WIDTH,
        heights=(_ROW,) * len(names),
        right=0.1,
    )
    figure, columns = page.new_page(layout, title=recording.name)
    rows = [axes for column in columns for axes in column]
    for axes, one, name in zip(rows, check.limbs, names, strict=True):
        residual = np.minimum(one.residual_deg, _MOST_DEG)
        times = np.arange(len(residual)) / recording.rate_hz
        step = max(len(residual) // _POINTS, 1)
        # The largest of each block: a peak of one frame stays to be seen.
        highest = np.maximum.reduceat(np.nan_to_num(residual), np.arange(0, len(residual), step))
        axes.fill_between(times[::step], highest, color=style.BLUE, lw=0)
        for limit in limits_deg:
            axes.axhline(limit, color=style.BLACK, lw=0.5, alpha=0.5)
        for first, stop in one.wrong:
            ends = first / recording.rate_hz, stop / recording.rate_hz
            axes.axvspan(*ends, color=style.PALE_ORANGE, linewidth=0.5, zorder=0.5)
        unknown = find_runs(np.isnan(residual))
        page.hatch(axes, [(a / recording.rate_hz, b / recording.rate_hz) for a, b in unknown])
        axes.set_ylim(0, _MOST_DEG)
        axes.set_yticks([0, 30], ["0°", "30°"])
        axes.set_ylabel(name, rotation=0, ha="right", va="center", labelpad=6)
    page.mark_seconds(rows, recording.duration_s)
    page.add_legend(
        figure,
        [
            page.swatch("angle between limb and sensor", style.BLUE),
            page.swatch("wrong", style.PALE_ORANGE),
            page.unknown_swatch("not known"),
        ],
    )
    return figure
