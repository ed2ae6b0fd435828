"""Which commands are there, and how does one end?

Exit codes: 0 done; 1 some input failed, or a search found nothing; 2 wrong use; 130 stopped
from the keyboard. Errors of the library are one line on stderr.
"""

import importlib
import inspect
import os
import sys
from collections.abc import Callable, Mapping
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from motionary import __version__
from motionary.cli import STOPPED_BY_KEYBOARD
from motionary.cli.options import expand_groups
from motionary.cli.screen import prepare_streams, warn
from motionary.errors import MotionaryError

#: Modules of this package, each with a function of its name, in the sequence of the help.
COMMANDS = (
    "search", "annotate", "learn", "library", "cut", "duplicates", "index", "info", "convert",
    "features", "evaluate", "demo",
)  # fmt: skip


class _InSequence(TyperGroup):
    """Lists commands in their sequence; groups would come last."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Names of the commands."""
        return [name for name in COMMANDS if name in self.commands]


def run_app() -> None:
    """Run the command that this process was called with, and exit."""
    prepare_streams()
    build_app()(prog_name="motionary")


def build_app() -> typer.Typer:
    """All commands."""
    app = typer.Typer(
        cls=_InSequence,
        help=_help_of(_start),
        add_completion=False,
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        # Plain text: no frames around it in a pipe, and twice as fast as with them.
        rich_markup_mode=None,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.callback()(_start)
    for name in COMMANDS:
        module = importlib.import_module(f"motionary.cli.{name}")
        command = getattr(module, name)
        if hasattr(module, "SUBCOMMANDS"):
            app.add_typer(_build_group(command, module.SUBCOMMANDS), name=name)
            continue
        # The demonstration is the one command that needs nothing said.
        app.command(name, no_args_is_help=name != "demo")(_guarded(command))
    return app


def _build_group(
    described: Callable[..., Any], commands: Mapping[str, Callable[..., Any]]
) -> typer.Typer:
    """Commands below one, which only describes them."""
    group = typer.Typer(help=_help_of(described), no_args_is_help=True, rich_markup_mode=None)
    for name, command in commands.items():
        group.command(name, no_args_is_help=True)(_guarded(command))
    return group


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


def _help_of(command: Callable[..., Any]) -> str:
    """The docstring; the lines of its examples, which start with the command, stay lines."""
    paragraphs = inspect.cleandoc(command.__doc__ or "").split("\n\n")
    return "\n\n".join(f"\b\n{p}" if p.startswith("motionary ") else p for p in paragraphs)


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
    except KeyboardInterrupt:
        return STOPPED_BY_KEYBOARD
    return code or 0
