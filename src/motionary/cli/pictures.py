"""Which pictures go with an answer?"""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from motionary.cli.inputs import read_as_told

if TYPE_CHECKING:
    from motionary.cli.example import Example
    from motionary.features import FeatureSequence, FeatureSet
    from motionary.io import ReadOptions
    from motionary.labels import LabelTrack
    from motionary.models.library import ClassLibrary, MotionClass
    from motionary.models.templates import MotionTemplate
    from motionary.motion import Floats, Motion
    from motionary.retrieval.search import Hit


def draw_sheet(
    path: str,
    hits: Sequence["Hit"],
    *,
    example: "Example | None",
    files: Mapping[str, Path],
    reading: "ReadOptions",
) -> None:
    """Stick figures of an example and its hits; without an example the best hit leads."""
    from motionary.plots import plot_sheet, save

    motions: dict[str, Motion] = {}
    rows = []
    if example is not None:
        part = example.packed.recording
        last = part.first_frame + part.n_frames - 1
        rows.append((f"example: {example.title}", _cut(example.motion, part.first_frame, last)))
    for rank, hit in enumerate(hits, start=1):
        name = hit.recording.name
        if name not in motions:
            motions[name] = read_as_told(files[name], reading)
        title = f"{rank}: {name} {hit.start_s:.2f}–{hit.end_s:.2f} s, cost {hit.cost:.3f}"
        rows.append((title, _cut(motions[name], hit.start_frame, hit.end_frame)))
    if rows:
        save(plot_sheet(rows[0], rows[1:]), path)


def draw_template(
    path: str,
    template: "MotionTemplate",
    tolerance: float,
    *,
    feature_set: "FeatureSet | None" = None,
) -> None:
    """A template, and its fixed cells beside it."""
    from motionary.plots import plot_template, save

    save(plot_template(template, tolerance=tolerance, feature_set=feature_set), path)


def draw_library(path: str, library: "ClassLibrary", *, title: str) -> None:
    """The classes of a library."""
    from motionary.plots import plot_library, save

    save(plot_library(library, title=title), path)


def draw_annotation(
    folder: str,
    track: "LabelTrack",
    *,
    words: "FeatureSequence",
    library: "ClassLibrary",
    threshold: float | None,
    preselect: bool = True,
) -> None:
    """Labels of a recording below the distances of the classes, into a folder."""
    from motionary.plots import plot_annotation, save
    from motionary.retrieval.annotation import class_distance

    distances = {
        one.name: class_distance(words, one, threshold=threshold, preselect=preselect).modified
        for one in library
    }
    figure = plot_annotation(track, distances=distances, classes=library.names)
    save(figure, Path(folder, f"{_file_name(track.recording.name)}.png"))


def draw_class(folder: str, motion_class: "MotionClass", *, library: "ClassLibrary") -> None:
    """Templates of a class and their fixed cells, a picture a template, into a folder."""
    from motionary.plots import plot_template, save

    for prototype in motion_class.prototypes:
        figure = plot_template(
            prototype.template, tolerance=motion_class.tolerance, feature_set=library.feature_set
        )
        name = motion_class.name
        if prototype.name != name:
            name = f"{name}-{prototype.name.removeprefix(name)}"
        save(figure, Path(folder, f"{_file_name(name)}.png"))


def _cut(motion: "Motion", first: int, last: int) -> "Floats":
    """Generic joints of frames as the file numbers them, both ends included."""
    start = max(first - motion.first_frame, 0)
    stop = min(max(last + 1 - motion.first_frame, start + 1), motion.n_frames)
    return motion.cut(start, stop).generic_positions()


def _file_name(name: str) -> str:
    """A name as file systems like it; folders in it become part of it."""
    return re.sub(r"[^\w.+-]+", "_", name).strip("._") or "picture"
