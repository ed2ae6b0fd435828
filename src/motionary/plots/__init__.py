"""Pictures: relations, templates, distances, labels and stick figures.

Every function returns a `matplotlib.figure.Figure`, made without pyplot: no window, no
display, no state shared with the pictures of others.
"""

from motionary.plots.annotation import plot_annotation
from motionary.plots.distance import plot_distance
from motionary.plots.features import plot_features
from motionary.plots.figures import BONES, plot_pose
from motionary.plots.library import plot_library
from motionary.plots.recordings import MOST_RECORDINGS, describe_facing, plot_recordings
from motionary.plots.saving import save
from motionary.plots.sheet import plot_sheet
from motionary.plots.template import plot_template

__all__ = [
    "BONES",
    "MOST_RECORDINGS",
    "describe_facing",
    "plot_annotation",
    "plot_distance",
    "plot_features",
    "plot_library",
    "plot_pose",
    "plot_recordings",
    "plot_sheet",
    "plot_template",
    "save",
]
