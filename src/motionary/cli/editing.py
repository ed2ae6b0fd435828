"""`motionary library edit`, `merge` and `add`: classes of libraries changed."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from motionary.cli import screen
from motionary.cli.learn import ScreenMonitor, draw_prototype, warn_of_unused
from motionary.cli.multiview import read_marks
from motionary.cli.options import (
    LIBRARY_FILE,
    FeatureSetName,
    Force,
    Jobs,
    argument,
    check_library,
    check_picture,
    check_target,
    declare,
    find_feature_set,
    flag,
    option,
    refuse_shipped,
    wrong,
)
from motionary.cli.recordings import find_files, measure_all, open_library, warn_of_all
from motionary.errors import InvalidInput
from motionary.io.options import ReadOptions
from motionary.tables import enumerate_names

if TYPE_CHECKING:
    from motionary.features import FeatureSequence
    from motionary.models.library import ClassEdit, ClassLibrary

LibraryFolder = Annotated[str, argument("LIB", "A folder that `motionary learn` wrote.")]
ClassName = Annotated[str, argument("CLASS", "One of its classes.")]
TemplateName = Annotated[
    str | None, declare("--template NAME", "Which template, of a class of several.")
]
PlotTemplate = Annotated[
    str | None, declare("--plot PICTURE", "Draw the template: png, svg or pdf.")
]
PlotLibrary = Annotated[str | None, declare("--plot PICTURE", "Draw the classes: png, svg or pdf.")]


# -- edit -------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Changes:
    """What becomes of a class."""

    text: str | None = option("--text FILE", "Take the template from a text; - reads stdin.")
    new: bool = flag("--new", "Make the class, and the library, from the text.")
    template: TemplateName = None
    restrict: list[str] | None = option(
        "--restrict FEATURE", "Ask for this feature only; may come repeatedly."
    )
    threshold: float | None = option(
        "--threshold COST", "Largest cost of a match.", min=0.0, max=1.0
    )
    join: str | None = option("--join CLASS", "Make one class of this and another.")
    rename: str | None = option("--rename NAME", "Call it so.")
    remove: bool = flag("--remove", "Take it out of the library.")

    def check(self) -> None:
        """Refuse no change, and changes that do not go together."""
        rest = (self.text, self.threshold, self.join, self.rename)
        if not (any(x is not None for x in rest) or self.remove or self.restrict):
            raise wrong("CLASS", "nothing to change; see --help")
        if self.new and (self.text is None or self.remove or self.join):
            raise wrong("--new", "needs --text, and nothing to remove or join")

    def for_library(self) -> "ClassEdit":
        """The same for the library, the text read."""
        from motionary.models.library import ClassEdit

        return ClassEdit(
            remove=self.remove,
            join=self.join,
            text=None if self.text is None else _read_text(self.text),
            new=self.new,
            restrict=self.restrict or (),
            threshold=self.threshold,
            rename=self.rename,
            template=self.template,
        )


def edit(
    folder: LibraryFolder,
    name: ClassName,
    changes: Changes,
    plot: PlotTemplate = None,
    features: FeatureSetName = None,
) -> None:
    """Change a class by hand: its template, threshold or name; join, remove or make one.

    A text from `motionary library show`, edited, keeps what was learned from the examples
    wherever its meaning did not change.

    motionary library edit my-classes squat --text squat.txt --plot squat.png
    motionary library edit my-classes squat --threshold 0.05 --rename "deep squat"
    motionary library edit my-classes wave_left --join wave_right --rename wave
    motionary library edit my-classes sweeping --new --text sweeping.txt
    """
    check_picture("--plot", plot)
    changes.check()
    refuse_shipped(folder)
    check_target(folder, is_folder=True)
    from motionary.models.library import edit_class

    library = _load(folder, features, new=changes.new)
    try:
        edited = edit_class(library, name, changes.for_library(), monitor=ScreenMonitor())
    except InvalidInput as error:
        if changes.text is None:
            raise
        where = "stdin" if changes.text == "-" else changes.text
        raise InvalidInput(str(error), file=where) from error
    edited.library.save(folder)
    if edited.name not in edited.library.names:
        screen.say(f"{name}: removed")
        return
    _say_changed(edited.library, edited.name, lost_queries=edited.lost_queries)
    if plot:
        draw_template(plot, edited.library, edited.name, changes.template, folder=None)


def _load(folder: str, features: str | None, *, new: bool) -> "ClassLibrary":
    from motionary.models.library import ClassLibrary

    if new and not Path(folder, LIBRARY_FILE).exists():
        return ClassLibrary((), find_feature_set(features))
    return open_library(folder)


def _read_text(path: str) -> str:
    if path == "-":
        return sys.stdin.read()
    from motionary.io import read_text

    return read_text(Path(path))


# -- add --------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class AddOptions:
    """Where examples are, and whose."""

    recordings: list[str] | None = option(
        "--recordings PATH",
        "The recordings of labels: each FILE is then a file of labels, and those called CLASS are "
        "the examples.",
    )
    template: TemplateName = None
    plot: PlotTemplate = None


def add(
    folder: LibraryFolder,
    name: ClassName,
    files: Annotated[list[str], argument("FILE", "Files, folders or patterns: examples.")],
    options: AddOptions,
    *,
    jobs: Jobs,
    reading: ReadOptions,
) -> int:
    """Let a class learn from more examples.

    A library that was learned with --keep-examples becomes what it would be had they been
    there from the start, thresholds included. Otherwise the class's template stands for
    its examples, and its threshold stays.

    motionary library add my-classes squat new/*.bvh
    motionary library add my-classes squat times.csv --recordings takes/
    """
    from motionary.models.library import add_examples

    check_picture("--plot", options.plot)
    refuse_shipped(folder)
    check_target(folder, is_folder=True)
    library = open_library(folder)
    before = library[name]
    if options.recordings is None:
        found = find_files(files, reading)
        sequences, failures = measure_all(
            found, "reading", reading=reading, feature_set=library.feature_set, jobs=jobs
        )
        warn_of_all(found.missing.values(), failures)
        code = 1 if found.missing or failures else 0
    else:
        sequences, code = _read_parts(
            files, options.recordings, name, library, jobs=jobs, reading=reading
        )
    expanded = add_examples(
        library, name, sequences, prototype=options.template, jobs=jobs, monitor=ScreenMonitor()
    )
    if expanded is library:
        screen.warn("no example is new; nothing was changed")
    expanded.save(folder)
    had, has = (any(x.queries for x in one.prototypes) for one in (before, expanded[name]))
    _say_changed(expanded, name, lost_queries=had and not has)
    if options.plot:
        draw_template(options.plot, expanded, name, options.template, folder=None)
    return code


def _read_parts(
    files: Sequence[str],
    recordings: Sequence[str],
    name: str,
    library: "ClassLibrary",
    *,
    jobs: int,
    reading: ReadOptions,
) -> "tuple[list[FeatureSequence], int]":
    """Features of what labels of one name cover, and 1 if something could not be used."""
    from motionary.models.library import list_tracks, read_labelled

    tracks = [track for file in files for track in list_tracks(file, reading)]
    names = sorted({label.name for track in tracks for label in track})
    if name not in names:
        raise InvalidInput(f"no label is called {name!r}; there are {enumerate_names(names)}")
    own = [replace(t, labels=tuple(x for x in t if x.name == name)) for t in tracks]
    with screen.progress("reading", sum(len(track) > 0 for track in own)) as done:
        read = read_labelled(
            own, recordings, reading=reading, feature_set=library.feature_set, jobs=jobs,
            on_done=done,
        )  # fmt: skip
    return read.classes.get(name, {}).get(name, []), warn_of_unused(read)


# -- merge ------------------------------------------------------------------------------


def merge(
    folders: Annotated[list[str], argument("LIB", "Libraries, in the order of their classes.")],
    output: Annotated[str, declare("--output -o LIB", "Folder to write to.")],
    on_clash: Annotated[
        Literal["refuse", "first", "both"],
        declare(
            "--on-clash",
            "Where several have a class: refuse, take the first, or give the first the templates "
            "of the others, too.",
        ),
    ] = "refuse",
    force: Force = False,
    plot: PlotLibrary = None,
) -> None:
    """Put the classes of several libraries into one.

    motionary library merge my-classes yours -o ours --on-clash first
    """
    from motionary.models.library import find_clashes, merge_libraries

    check_picture("--plot", plot)
    check_library(output, replace=force)
    libraries = [open_library(folder) for folder in folders]
    clashing = find_clashes(libraries)
    if clashing and on_clash == "refuse":
        raise InvalidInput(
            f"several of the libraries have {', '.join(map(repr, clashing))}; nothing was "
            "written: rename them, or say --on-clash first or both"
        )
    merged = merge_libraries(libraries, clash=on_clash)
    merged.save(output)
    kept = "the first is kept" if on_clash == "first" else "the templates of all are kept"
    for clash in clashing:
        screen.warn(f"class {clash!r} is in several libraries: {kept}")
    screen.say(describe_library(merged, output))
    if plot and len(merged):
        draw_library(plot, merged, output)


# -- what is said and drawn of classes -----------------------------------------------------


def describe_library(library: "ClassLibrary", folder: str) -> str:
    """A library in a line."""
    classes = screen.count(len(library), "class", "classes")
    parts = [f"{folder}: {classes} over {library.feature_set.name}"]
    parts += [f"from: {library.provenance}"] if library.provenance else []
    parts += [f"licence: {library.licence}"] if library.licence else []
    return "; ".join(parts)


def draw_template(
    plot: str, library: "ClassLibrary", name: str, template: str | None, *, folder: str | None
) -> None:
    """Draw a template of a class, and what it tells tracks by the priors in a folder."""
    from motionary.models.library import find_prototype

    prototype, rows = find_prototype(library[name], template), None
    marks = None if folder is None else read_marks(folder, library)
    if marks:
        from motionary.multiview import find_rows

        rows = find_rows(marks.get((name, prototype.name), ()), library.feature_set.names)
    draw_prototype(plot, library, library[name], prototype, marks=rows)


def _say_changed(library: "ClassLibrary", name: str, *, lost_queries: bool) -> None:
    """What has become of a class."""
    from motionary.models.library import fractions_fixed

    if lost_queries:
        screen.warn(
            f"class {name!r}: its keyframe queries were of the template before, and are gone"
        )
    changed = library[name]
    fractions = zip(changed.prototypes, fractions_fixed(changed), strict=True)
    parts = [
        f"{one.name} {one.template.duration_s:.2f} s, {100 * fraction:.0f} % fixed, "
        f"{one.template.provenance}"
        for one, fraction in fractions
    ]
    screen.say(f"{name}: threshold {changed.threshold:.3g}; {'; '.join(parts)}")


def draw_library(plot: str, library: "ClassLibrary", folder: str) -> None:
    """Draw the classes of a library."""
    from motionary.plots import plot_library, save

    save(plot_library(library, title=Path(folder).name), plot)
