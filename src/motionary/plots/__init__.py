"""Pictures: features, templates, distances, labels and stick figures.

Every function returns a `matplotlib.figure.Figure`, made without pyplot: no window, no
display, no state shared with the pictures of others.
"""

from motionary.plots.features import plot_features
from motionary.plots.figures import (
    BONES,
    MOST_RECORDINGS,
    describe_facing,
    plot_pose,
    plot_recordings,
)
from motionary.plots.sheets import HITS_A_PAGE, plot_depth, plot_sheet, plot_sheets
from motionary.plots.templates import plot_library, plot_template
from motionary.plots.timelines import plot_annotation, plot_check, plot_distance
from motionary.plots.writing import MOVING, check_moving, render, save, save_pages

__all__ = [
    "BONES",
    "HITS_A_PAGE",
    "MOST_RECORDINGS",
    "MOVING",
    "check_moving",
    "describe_facing",
    "plot_annotation",
    "plot_check",
    "plot_depth",
    "plot_distance",
    "plot_features",
    "plot_library",
    "plot_pose",
    "plot_recordings",
    "plot_sheet",
    "plot_sheets",
    "plot_template",
    "render",
    "save",
    "save_pages",
]
