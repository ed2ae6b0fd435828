"""`motionary learn`: what do the examples of each class have in common?"""

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from motionary.cli import screen
from motionary.cli.inputs import check_target, complain_of_all
from motionary.cli.options import AsJson, Jobs, LibraryDefault, ReadingOptions
from motionary.cli.pictures import draw_class
from motionary.errors import InvalidInput

if TYPE_CHECKING:
    from motionary.library import ClassLibrary, Examples, Teaching

_TEACHING = "motionary.library:Teaching"
_COLUMNS = ("class", "template", ">examples", ">columns", ">seconds", ">fixed")


class Queries(StrEnum):
    """Where the keyframe queries of a class come from."""

    NONE = "none"
    LEARNED = "learned"


@dataclass(frozen=True, kw_only=True)
class TeachingOptions:
    """How classes are learned."""

    mirror: Annotated[
        bool,
        typer.Option("--mirror", help="Learn the mirror image of each class, too."),
    ] = False
    threshold: Annotated[
        float,
        typer.Option(
            min=0.0,
            max=1.0,
            metavar="COST",
            default_factory=LibraryDefault(_TEACHING, "threshold"),
            help="Largest cost of a match of these classes.",
        ),
    ]
    tolerance: Annotated[
        float,
        typer.Option(
            min=0.0,
            max=0.5,
            metavar="SHARE",
            default_factory=LibraryDefault(_TEACHING, "tolerance"),
            help="A relation may differ in this share of the examples and still be asked for.",
        ),
    ]

    queries: Annotated[
        Queries,
        typer.Option(
            help="Breed keyframe queries from the examples, so that a class is looked for "
            "around their hits only.",
        ),
    ] = Queries.NONE
    query_runs: Annotated[
        int,
        typer.Option(
            min=1,
            default_factory=LibraryDefault("motionary.query_learning:learn_query", "runs"),
            help="Queries to breed for each class; most of them must agree on a hit.",
        ),
    ]

    def teaching(self) -> "Teaching":
        """The same for the library."""
        from motionary.library import Teaching

        return Teaching(threshold=self.threshold, tolerance=self.tolerance, mirror=self.mirror)


def learn(
    examples: Annotated[
        str,
        typer.Argument(metavar="EXAMPLES", help="A folder with one folder per class."),
    ],
    output: Annotated[
        str, typer.Option("--output", "-o", metavar="LIB", help="Folder to write the library to.")
    ],
    options: TeachingOptions,
    plot: Annotated[str | None, typer.Option(metavar="FOLDER", help="Draw the templates.")] = None,
    as_json: AsJson = False,
    *,
    jobs: Jobs,
    reading: ReadingOptions,
) -> int:
    """Learn classes of motion from examples, one folder per class.

    The files in a folder are the examples of its class. Folders in it are ways of doing the
    same, each with a template of its own.

    motionary learn examples/ -o my-classes --mirror
    with examples/squat/one.bvh, examples/squat/two.bvh, examples/kick/one.bvh, ...
    """
    from motionary.library import learn_classes, list_examples, read_examples

    for path in (output, plot):
        check_target(path, is_folder=True)
    folder = Path(examples)
    listed = list_examples(folder)
    with screen.progress("reading", len(listed)) as done:
        read = read_examples(folder, reading=reading.reading(), jobs=jobs, on_done=done)
    complain_of_all((), read.failures)
    problems: list[str] = []
    with screen.progress("learning", len(read.classes)) as done:
        library = learn_classes(
            read.classes,
            teaching=options.teaching(),
            on_done=done,
            on_refused=lambda name, why: problems.append(f"class {name!r} is left out: {why}"),
        )
    if options.queries is Queries.LEARNED:
        library = _with_queries(library, read.classes, runs=options.query_runs, jobs=jobs)
    lost = sorted({name for name, _, _ in listed} - set(read.classes))
    problems += [f"class {name!r}: none of its examples could be read; left out" for name in lost]
    problems += _outside_of_classes(folder)
    for problem in problems:
        screen.complain(problem)
    if not library:
        raise InvalidInput(f"{examples}: no class could be learned; nothing was written")
    library.save(output)
    for motion_class in library if plot else ():
        draw_class(plot or "", motion_class, library=library)
    _say(library, as_json=as_json)
    return 1 if problems or read.failures else 0


def _with_queries(
    library: "ClassLibrary", examples: "Examples", *, runs: int, jobs: int
) -> "ClassLibrary":
    """The library with queries, and on the screen which classes have none."""
    from motionary.library import learn_queries

    with screen.progress("breeding", len(library)) as done:
        queried = learn_queries(library, examples, runs=runs, jobs=jobs, on_done=done)
    for name, reason in queried.without.items():
        screen.complain(f"class {name!r} has no queries: {reason}")
    return queried.library


def _outside_of_classes(folder: Path) -> list[str]:
    from motionary.io import MOTION_SUFFIXES, format_suffix

    stray = sorted(path.name for path in folder.iterdir() if format_suffix(path) in MOTION_SUFFIXES)
    if not stray:
        return []
    more = f" and {len(stray) - 1} more" if len(stray) > 1 else ""
    return [f"{stray[0]}{more}: in no class; put examples into a folder named after their class"]


def _say(library: "ClassLibrary", *, as_json: bool) -> None:
    from motionary.templates import quantise

    rows = []
    for motion_class in library:
        for subclass in motion_class.subclasses:
            template = subclass.template
            quantised = quantise(template, tolerance=motion_class.tolerance)
            row = {
                "class": motion_class.name,
                "template": subclass.name,
                "examples": template.n_examples,
                "columns": template.n_columns,
                "seconds": template.duration_s,
                "fixed": quantised.n_fixed / quantised.fixed.size,
            }
            rows.append(row)
        if all(s.template.n_examples == 1 for s in motion_class.subclasses):
            screen.complain(
                f"class {motion_class.name!r} has one example: nothing may vary in it, so that "
                "it will hardly match another person; add examples"
            )
    if as_json:
        for row in rows:
            screen.say_json(row)
    else:
        screen.say_table(_COLUMNS, [tuple(_cells(row)) for row in rows])


def _cells(row: dict[str, Any]) -> list[str]:
    shown = row | {"seconds": f"{row['seconds']:.2f}", "fixed": f"{100 * row['fixed']:.0f} %"}
    return [str(value) for value in shown.values()]
