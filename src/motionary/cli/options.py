"""Options: how they are declared, which several commands have, and checks before the work.

A group is a frozen dataclass whose fields are options; a command that takes one has all of
them. Defaults are the library's own: they are looked up when a command needs or shows them.
"""

import importlib
import inspect
import os
import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import MISSING, Field, dataclass, field, fields, is_dataclass
from inspect import Parameter, Signature
from pathlib import Path
from types import UnionType
from typing import TYPE_CHECKING, Annotated, Any, get_args, get_type_hints

import typer

from motionary.errors import InvalidInput, UnreadableFile, UnwritableFile
from motionary.files import NO_SUCH_FILE, check_table_name, holds_others, is_protected, is_stdout
from motionary.io.options import ReadOptions

if TYPE_CHECKING:
    from motionary.features import FeatureSet

PICTURES = (".png", ".svg", ".pdf")
#: By this file a folder is a library.
LIBRARY_FILE = "library.toml"


class LibraryDefault:
    """Default of a parameter of the library, such as ("motionary.retrieval.search:search", …).

    The help shows it; a module is imported for it only where that help is asked for.
    """

    def __init__(self, home: str, parameter: str) -> None:
        self.home = home
        self.parameter = parameter

    def __call__(self) -> Any:
        """The default."""
        module, _, name = self.home.partition(":")
        function = getattr(importlib.import_module(module), name)
        return inspect.signature(function).parameters[self.parameter].default

    def __str__(self) -> str:
        return str(self())


#: Of an option that must be given.
REQUIRED: Any = MISSING


def declare(usage: str, text: str, **limits: Any) -> Any:
    """What `Annotated` takes for an option that several groups or commands have.

    Parameters
    ----------
    usage : its names and what stands for its value, as in "--output -o FILE"; without a word
        for the value the help shows the choices or the type
    text : the help
    limits : what `typer.Option` takes besides, such as `min`
    """
    words = usage.split()
    flags = [word for word in words if word.startswith("-")]
    metavar = " ".join(words[len(flags) :]) or None
    return typer.Option(*flags, metavar=metavar, help=text, **limits)


def argument(metavar: str, text: str) -> Any:
    """What `Annotated` takes for a value without an option, and its help."""
    return typer.Argument(metavar=metavar, help=text)


def option(usage: str, text: str, default: Any = None, **limits: Any) -> Any:
    """A field of a group that is an option, as `declare` has it.

    Parameters
    ----------
    default : a value, `REQUIRED` or a `LibraryDefault`
    """
    shown = {"flag": usage, "metavar": "", "help": text, **limits}
    if isinstance(default, LibraryDefault):
        return field(default_factory=default, metadata=shown)
    return field(default=default, metadata=shown)


def flag(usage: str, text: str) -> Any:
    """A field of a group that is an option without a value, by default not given."""
    return option(usage, text, default=False)


Jobs = Annotated[
    int,
    declare(
        "--jobs N",
        "Processes that read files; the answer is the same.",
        min=1,
        default_factory=LibraryDefault("motionary.batch:map_ordered", "jobs"),
    ),
]
AsJson = Annotated[bool, declare("--json", "JSON on stdout, one object a line, and nothing else.")]
Excel = Annotated[
    bool,
    declare(
        "--excel",
        "Tables with semicolons and decimal commas, as Excel opens them by a double click in most "
        "of Europe.",
    ),
]
TableFile = Annotated[str | None, declare("--output -o CSV", "Write the results as a table, too.")]
LabelFile = Annotated[
    str | None,
    declare(
        "--output -o FILE",
        "Write the results, too: a table (.csv, .tsv, .xlsx), .jsonl, .eaf (ELAN), .TextGrid "
        "(Praat), .srt or .vtt. `motionary labels convert` makes others of a table.",
    ),
]
Force = Annotated[bool, declare("--force", "Replace results of former runs that are in the way.")]
InFrames = Annotated[
    bool,
    declare("--frames", "Times of tables of labels are numbers of frames, the last one included."),
]


@dataclass(frozen=True, kw_only=True)
class TableOptions:
    """A table that results are written to."""

    output: TableFile = None
    excel: Excel = False
    force: Force = False

    @property
    def holds_labels(self) -> bool:
        """Whether the results are labels, which have more formats than tables."""
        return False

    @property
    def takes_stdout(self) -> bool:
        """Whether the table goes to stdout, in the place of what is said to people."""
        return self.output is not None and is_stdout(self.output)

    def check(self, *, as_json: bool) -> None:
        """Fail before the work where there is no table, or it cannot be written."""
        if as_json and self.takes_stdout:
            raise wrong("--json, --output", "both go to stdout; name a file for one of them")
        if self.excel and self.output is None:
            raise wrong("--excel", "goes with --output CSV")
        if self.output is not None:
            try:
                if self.holds_labels:
                    from motionary.io.labels import check_label_file

                    check_label_file(self.output, excel=self.excel)
                else:
                    check_table_name(self.output)
            except InvalidInput as error:
                raise wrong("--output", str(error)) from error
        check_target(self.output, replace=self.force)


def find_feature_set(name: str | None) -> "FeatureSet":
    """The feature set of a name; the usual one without."""
    from motionary.features import FULL_BODY, known_sets

    if name is None:
        return FULL_BODY
    if name not in known_sets():
        raise wrong("--features", f"no set {name!r}; choose one of {', '.join(known_sets())}")
    return known_sets()[name]


def _check_feature_set(value: str | None) -> str | None:
    if value is not None:
        find_feature_set(value)
    return value


FeatureSetName = Annotated[
    str | None,
    declare(
        "--features SET",
        "Features to measure: full-body-40 (the usual, as published), legs-14, three-levels-129 "
        "(how far and how fast), full-body-39.",
        callback=_check_feature_set,
    ),
]


# -- checks before the work -------------------------------------------------------------


def wrong(option: str, problem: str) -> typer.BadParameter:
    """Wrong use of an option."""
    return typer.BadParameter(problem, param_hint=option)


def refuse(given: Mapping[str, Any], problem: str) -> None:
    """Wrong use of the first of these options that was given, if one was."""
    for name, value in given.items():
        if value is not None and value is not False:
            raise wrong(name, problem)


def check_picture(option: str, path: str | None) -> None:
    """Fail before the work where a picture cannot be written, or not in that format."""
    if path is not None:
        if not path.lower().endswith(PICTURES):
            raise wrong(option, f"pictures are written as {', '.join(PICTURES)}, got {path}")
        check_target(path)


def check_page(option: str, path: str | None, *, replace: bool = True) -> None:
    """Fail before the work where a page cannot be written, or is no HTML."""
    if path is not None:
        if not path.lower().endswith((".html", ".htm")):
            raise wrong(option, f"pages are written as .html, got {path}")
        check_target(path, replace=replace)


def picture_path(folder: str, name: str) -> Path:
    """The path of a picture, its name as file systems like it; folders in it become part of it."""
    called = re.sub(r"[^\w.+-]+", "_", name).strip("._") or "picture"
    return Path(folder, f"{called}.png")


def check_target(path: str | None, *, is_folder: bool = False, replace: bool = True) -> None:
    """Fail before the work, not after it, where a file or folder cannot be made.

    Parameters
    ----------
    replace : whether what is there may be replaced; devices and named pipes always may

    Raises
    ------
    UnwritableFile
        If something above `path` is a file or may not be written to, or `path` is a folder
        where it should be a file, or the other way round, or must not be replaced.
    """
    if path is None or is_stdout(path):
        return
    place = Path(path).absolute()
    if not replace and (place / LIBRARY_FILE if is_folder else place).is_file():
        raise UnwritableFile("exists; say --force to replace it, or name another place", file=path)
    above = next(p for p in place.parents if p.exists())
    problem = ""
    if not above.is_dir():
        problem = f"{above.name} is a file, not a folder"
    elif place.exists() and place.is_dir() != is_folder:
        problem = "it is a file, not a folder" if is_folder else "it is a folder, not a file"
    elif not os.access(above, os.W_OK):
        problem = f"{above} is read-only"
    elif place.exists() and is_protected(place):
        problem = "it is write-protected"
    if problem:
        raise UnwritableFile(f"cannot be written: {problem}; choose another place", file=path)


def refuse_shipped(path: str) -> None:
    """Refuse to make a folder that would stand for the library that ships from then on."""
    from motionary.models.library import EVERYDAY

    if Path(path).name == EVERYDAY and not Path(path, LIBRARY_FILE).exists():
        raise typer.BadParameter(
            f"the library that ships stays as it is; name another folder than {EVERYDAY}: "
            f"`motionary library merge {EVERYDAY} -o my-{EVERYDAY}` makes a copy to change"
        )


def check_library(path: str, *, replace: bool) -> None:
    """Fail before the work where a library cannot be written, as `check_target`."""
    refuse_shipped(path)
    check_target(path, is_folder=True, replace=replace)
    if not Path(path, LIBRARY_FILE).exists() and holds_others(Path(path), LIBRARY_FILE):
        raise UnwritableFile("holds files but no library; give a new or empty folder", file=path)


# -- groups of options ------------------------------------------------------------------


def expand_groups(
    command: Callable[..., int | None],
) -> tuple[Callable[..., int | None], Signature]:
    """The command with a parameter for each field of its groups, and that signature."""
    groups: dict[str, Any] = {}
    parameters: list[Parameter] = []
    hints = get_type_hints(command, include_extras=True)
    for name, parameter in inspect.signature(command).parameters.items():
        if is_dataclass(hints[name]):
            groups[name] = hints[name]
            parameters += _parameters_of(hints[name])
        else:
            kind = Parameter.KEYWORD_ONLY
            parameters.append(parameter.replace(kind=kind, annotation=hints[name]))

    def expanded(**values: Any) -> int | None:
        for name, group in groups.items():
            values[name] = _build(group, {f.name: values.pop(f.name) for f in fields(group)})
        return command(**values)

    return expanded, Signature(parameters)


def _parameters_of(group: Any) -> list[Parameter]:
    hints = get_type_hints(group, include_extras=True)
    return [
        Parameter(
            one.name,
            Parameter.KEYWORD_ONLY,
            default=Parameter.empty if one.default is MISSING else one.default,
            annotation=_annotate(one, hints[one.name]),
        )
        for one in fields(group)
    ]


def _annotate(one: "Field[Any]", hint: Any) -> Any:
    """The field's type for typer, by what its metadata say."""
    shown = dict(one.metadata)
    if not shown:
        return hint
    if isinstance(hint, UnionType) and str in get_args(hint):
        # A text that the library understands as one of several types.
        hint = str | None
    if one.default_factory is not MISSING:
        shown["default_factory"] = one.default_factory
    usage = f"{shown.pop('flag')} {shown.pop('metavar')}"
    return Annotated[hint, declare(usage, shown.pop("help"), **shown)]


def _build(group: Any, values: dict[str, Any]) -> Any:
    """The group of these values; what the library refuses of them is wrong use."""
    try:
        built = group(**values)
    except InvalidInput as error:
        raise wrong(_flag_at_fault(group, values), str(error)) from error
    if isinstance(built, ReadOptions):
        _check_reading(built)
    return built


def _flag_at_fault(group: Any, values: dict[str, Any]) -> str:
    """The flag whose value alone is refused; that of the last field where they disagree."""
    for one in fields(group):
        try:
            group(**{one.name: values[one.name]})
        except InvalidInput:
            break
    return str(one.metadata["flag"]).split()[0]


def _check_reading(reading: ReadOptions) -> None:
    """Refuse files that are not there, and options that do not go together."""
    for name, path in (("--asf", reading.asf), ("--body-model", reading.body_model)):
        if path is not None and not Path(path).is_file():
            raise wrong(name, f"{path}: {NO_SUCH_FILE}")
    if reading.fill_gaps_s is None and "fill_by" in reading.given():
        raise wrong("--fill-by", "goes with --fill-gaps SECONDS")
    try:
        reading.skeleton_table()
    except (InvalidInput, UnreadableFile) as error:
        raise wrong("--skeleton", str(error)) from error


# -- the command again ------------------------------------------------------------------


def given_options(*groups: Any, without: Collection[str] = ()) -> list[str]:
    """What was given of groups of options, as it stands on a command line.

    Files are called by their names alone: pages hold no folders.
    """
    words: list[str] = []
    for group in groups:
        for one in fields(group):
            value = getattr(group, one.name)
            made = one.default_factory
            default = one.default if made is MISSING else made()
            is_default = value == default and type(value) is type(default)
            if one.name in without or value is None or is_default:
                continue
            on, _, off = one.metadata["flag"].split()[0].partition("/")
            words += [off if value is False else on]
            words += [] if isinstance(value, bool) else [_called(value)]
    return words


def _called(value: Any) -> str:
    text = f"{value:g}" if isinstance(value, float) else str(value)
    try:
        return Path(text).name if Path(text).exists() else text
    except OSError:
        # A text may be longer than any name.
        return text
