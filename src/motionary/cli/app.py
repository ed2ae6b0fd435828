"""All commands, their help, and how one ends.

Exit codes: 0 done; 1 some input failed, or a search found nothing; 2 wrong use; 130 stopped
from the keyboard. Errors of the library are one line on stderr.
"""

import gc
import importlib
import inspect
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from motionary import __version__
from motionary.cli import STOPPED_BY_KEYBOARD
from motionary.cli.options import declare, expand_groups
from motionary.cli.screen import prepare_streams, shorten, warn
from motionary.errors import MotionaryError
from motionary.tables import printable

#: Commands in the sequence of the help, and the modules with functions of these names.
COMMANDS = {
    "search": "search",
    "annotate": "annotate",
    "count": "annotate",
    "report": "report",
    "render": "report",
    "learn": "learn",
    "library": "library",
    "cut": "convert",
    "duplicates": "index",
    "index": "index",
    "info": "info",
    "convert": "convert",
    "features": "convert",
    "evaluate": "evaluate",
    "labels": "labels",
    "imu": "sensors",
    "track": "multiview",
    "untangle": "multiview",
    "depth": "depth",
    "synth": "sensors",
    "live": "live",
    "replay": "live",
    "demo": "app",
}
#: Shells that complete a command line set it.
_COMPLETION = "_MOTIONARY_COMPLETE"
# Objects between two searches for garbage.
_NEW_OBJECTS = 100_000
#: Former names of options, which stay.
_FORMER = {
    "--good": "--relevant", "--bad": "--irrelevant", "--grow": "--expand",
    "--suggest": "--calibrate", "--rate-hz": "--rate",
}  # fmt: skip


class _InSequence(TyperGroup):
    """Lists commands in their sequence; groups would come last. Errors of use stay short."""

    def make_context(self, *args: Any, **extra: Any) -> Any:
        """The context of the options before a command."""
        with _short_errors():
            return super().make_context(*args, **extra)

    def invoke(self, ctx: Any) -> Any:
        """The end of a command, and of reading its options."""
        with _short_errors():
            return super().invoke(ctx)

    def list_commands(self, ctx: Any) -> list[str]:
        """Names of the commands."""
        return [name for name in COMMANDS if name in self.commands]


@contextmanager
def _short_errors() -> Iterator[None]:
    """Make what is said of wrong use one line that a terminal can show."""
    try:
        yield
    except Exception as error:
        message = getattr(error, "message", None)
        # The help that stands in for missing arguments has lines of its own.
        if isinstance(message, str) and "\n" not in message:
            error.message = shorten(printable(message))  # type: ignore[attr-defined]
        raise


class _Command(TyperCommand):
    """Takes options by their former names, too."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """What is left of the arguments once they are read."""
        return super().parse_args(ctx, [_rename(argument) for argument in args])

    def invoke(self, ctx: Any) -> Any:
        """The end of the command; no value of a text is empty."""
        params: list[Any] = list(self.params)
        for param in params:
            value = ctx.params.get(param.name)
            if value == "" or (isinstance(value, list | tuple) and "" in value):
                raise typer.BadParameter("must not be empty", ctx=ctx, param=param)
        return super().invoke(ctx)


def _rename(argument: str) -> str:
    option, equals, value = argument.partition("=")
    return _FORMER.get(option, option) + equals + value


def run_app() -> None:
    """Run the command that this process was called with, and exit."""
    prepare_streams()
    # Little that a command makes becomes garbage, and looking for it costs a tenth of its start.
    gc.set_threshold(_NEW_OBJECTS)
    first = sys.argv[1] if len(sys.argv) > 1 else ""
    # Completion asks with the words of the command line in variables.
    one = first if first in COMMANDS and _COMPLETION not in os.environ else None
    is_overview = sys.argv[1:] in ([], ["--help"], ["-h"]) and _COMPLETION not in os.environ
    build_app(one, is_overview=is_overview)(prog_name="motionary")


def build_app(one: str | None = None, *, is_overview: bool = False) -> typer.Typer:
    """All commands, or one of them: others need not be imported to run it.

    For an overview of all, commands are there by what they do, without their options.
    """
    app = typer.Typer(
        cls=_InSequence,
        help=_help_of(_start),
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        # Plain text: no frames around it in a pipe, and twice as fast as with them.
        rich_markup_mode=None,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.callback()(_start)
    for name, home in COMMANDS.items():
        if one not in (None, name):
            continue
        module = importlib.import_module(f"motionary.cli.{home}")
        command = getattr(module, name)
        if is_overview:
            app.command(name, short_help=_summary(command))(_start)
            continue
        below = getattr(module, "SUBCOMMANDS", {}).get(name)
        if below is not None:
            group = _build_group(command, below)
            app.add_typer(group, name=name, short_help=_summary(command))
            continue
        app.command(name, cls=_Command, short_help=_summary(command))(_guarded(command))
    app.command("help", hidden=True)(_show_help)
    app.command("version", hidden=True)(lambda: _show_version(True))
    return app


def _build_group(
    described: Callable[..., Any], commands: Mapping[str, Callable[..., Any]]
) -> typer.Typer:
    """Commands below one, which only describes them."""
    group = typer.Typer(help=_help_of(described), no_args_is_help=True, rich_markup_mode=None)
    for name, command in commands.items():
        group.command(name, cls=_Command, short_help=_summary(command))(_guarded(command))
    return group


def _show_help(
    ctx: typer.Context,
    command: Annotated[list[str] | None, typer.Argument(metavar="COMMAND")] = None,
) -> None:
    """Show the help of a command, as `--help` after it does."""
    context: Any = ctx.find_root()
    for name in command or ():
        found = getattr(context.command, "commands", {}).get(name)
        if found is None:
            raise typer.BadParameter(f"there is no command {' '.join(command or ())!r}")
        context = found.context_class(found, info_name=name, parent=context)
    typer.echo(context.command.get_help(context))


def _show_version(asked: bool) -> None:
    if asked:
        typer.echo(f"motionary {__version__}")
        raise typer.Exit


def _start(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Say which it is."),
    ] = False,
) -> None:
    """Find and name motions in motion capture from a few examples, and say why.

    motionary search recordings/ --like take.bvh --from 1.2 --to 3.4
    motionary learn examples/ -o my-classes
    motionary annotate long.amc --library my-classes
    """


def demo(
    output: Annotated[Path, declare("--output -o", "Folder for labels and pictures.")] = Path(
        "demo-output"
    ),
    jobs: Annotated[int, declare("--jobs", "Processes that read.")] = 2,
) -> None:
    """Label without training, search, train classes, label unseen recordings, score.

    With real recordings in the folder that MOTIONARY_DATA names; without them on
    synthetic motions.

    Example: motionary demo --output demo-output
    """
    from motionary.demo import demonstrate

    for line in demonstrate(output, jobs=jobs):
        typer.echo(line)


def _help_of(command: Callable[..., Any]) -> str:
    """The docstring; the lines of its examples, which start with the command, stay lines."""
    paragraphs = inspect.cleandoc(command.__doc__ or "").split("\n\n")
    return "\n\n".join(f"\b\n{p}" if p.startswith("motionary ") else p for p in paragraphs)


def _summary(command: Callable[..., Any]) -> str:
    """The first sentence of a command's help, whole; lists of commands fold it."""
    first = inspect.cleandoc(command.__doc__ or "").partition("\n\n")[0]
    return " ".join(first.split()).partition(". ")[0].rstrip(".")


def _guarded(command: Callable[..., int | None]) -> Callable[..., None]:
    """The command as typer takes it: groups of options expanded, its end turned into a code."""
    expanded, signature = expand_groups(command)

    def run(**values: Any) -> None:
        raise typer.Exit(_attempt(expanded, values))

    run.__name__, run.__doc__ = command.__name__, _help_of(command)
    run.__signature__ = signature  # type: ignore[attr-defined]
    run.__annotations__ = {p.name: p.annotation for p in signature.parameters.values()}
    return run


def _attempt(command: Callable[..., int | None], values: dict[str, Any]) -> int:
    try:
        code = command(**values)
        sys.stdout.flush()
    except BrokenPipeError:
        # The reader has what it wanted (`| head`). What is left in the buffer goes nowhere.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except MotionaryError as error:
        warn(str(error))
        return 1
    except OSError as error:
        warn(error.strerror or str(error))
        return 1
    except MemoryError:
        warn("there is not enough memory for this; give fewer or shorter recordings")
        return 1
    except KeyboardInterrupt:
        return STOPPED_BY_KEYBOARD
    return code or 0
