"""How does the documentation show what the package itself says, so that it stays true?

Directives: `command-help` (every command with its help), `contents-of MODULE` (its public
names and their first lines), `features` (the 40), `skeletons` and `formats` (the known ones).
"""

import importlib
import inspect
from collections.abc import Iterator
from typing import Any

import typer
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from motionary.cli.app import build_app
from motionary.features import FULL_BODY, Feature
from motionary.features import quantities as q
from motionary.io import MOTION_SUFFIXES, WRITTEN_SUFFIXES, options_of
from motionary.skeletons import known_mappings, named_mapping

_SIMPLE = (int, float, str)
_SIGNS = {">": "> ", ">=": "≥ ", "<": "< ", "<=": "≤ "}
_VELOCITIES = (q.move_plane, q.move_along, q.move_against, q.speed, q.turning)


class CommandHelp(SphinxDirective):
    """A section per command, with what `--help` prints."""

    def run(self) -> list[nodes.Node]:
        """Sections."""
        program = typer.main.get_command(build_app())
        return [self._section(name, text) for name, text in _helps(program, "motionary", None)]

    def _section(self, name: str, text: str) -> nodes.section:
        section = nodes.section(ids=[nodes.make_id(name)], names=[name])
        section += nodes.title(text=name)
        section += nodes.literal_block(text, text, language="text")
        self.state.document.note_explicit_target(section, section)
        return section


def _helps(command: Any, name: str, above: Any) -> Iterator[tuple[str, str]]:
    """Names and helps of a command and of those below it."""
    # Typer's commands are of click's kind; some versions bring a click of their own.
    context = command.context_class(command, info_name=name.split()[-1], parent=above)
    yield name, command.get_help(context)
    if hasattr(command, "list_commands"):
        for below in command.list_commands(context):
            found = command.get_command(context, below)
            if found is not None and not found.hidden:
                yield from _helps(found, f"{name} {below}", context)


class ContentsOf(SphinxDirective):
    """What a module has for others: names, and the first line of what each says of itself."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """A table."""
        module = importlib.import_module(self.arguments[0])
        rows = [
            [nodes.literal(text=name), nodes.Text(_first_line(getattr(module, name)))]
            for name in sorted(module.__all__, key=str.casefold)
        ]
        return [_table(["name", ""], rows, widths=[32, 68])]


def _first_line(value: Any) -> str:
    if isinstance(value, _SIMPLE):
        return f"{value!r}"
    of_its_own = inspect.isclass(value) or inspect.isroutine(value)
    return (inspect.getdoc(value) or "").split("\n")[0] if of_its_own else ""


class Features(SphinxDirective):
    """The catalogue of the 40 features."""

    def run(self) -> list[nodes.Node]:
        """A table."""
        rows = [
            [nodes.Text(cell) for cell in (r.id, r.name, r.group, _thresholds(r), r.sentence)]
            for r in FULL_BODY.features
        ]
        heads = ["", "feature", "group", "ends / starts", "in words"]
        return [_table(heads, rows, widths=[6, 28, 8, 22, 36])]


def _thresholds(feature: Feature) -> str:
    def shown(value: float | tuple[float, float]) -> str:
        return f"{value[0]:g}–{value[1]:g}" if isinstance(value, tuple) else f"{value:g}"

    test = _SIGNS.get(feature.test, "")
    per = " per s" if feature.quantity in _VELOCITIES else ""
    return f"{test}{shown(feature.weak)} / {shown(feature.strong)} {feature.unit}{per}"


class Skeletons(SphinxDirective):
    """The skeletons and marker sets that are known by name."""

    def run(self) -> list[nodes.Node]:
        """A table."""
        rows = []
        for name in known_mappings():
            mapping = named_mapping(name)
            order = str(len(mapping.order)) if mapping.order else "by name"
            cells = nodes.Text(order), nodes.Text(mapping.note)
            rows.append([nodes.literal(text=name), *cells])
        return [_table(["skeleton=", "joints", "note"], rows, widths=[22, 12, 66])]


class Formats(SphinxDirective):
    """The formats that are read and written."""

    def run(self) -> list[nodes.Node]:
        """A table."""
        rows = []
        for suffix in MOTION_SUFFIXES:
            if not suffix.endswith(".gz"):
                written = "yes" if suffix in WRITTEN_SUFFIXES else ""
                options = ", ".join(f"{name}=" for name in sorted(options_of(f"x{suffix}")))
                cells = nodes.Text(written), nodes.Text(options)
                rows.append([nodes.literal(text=suffix), *cells])
        return [_table(["read", "written", "options"], rows, widths=[16, 14, 70])]


def _table(heads: list[str], rows: list[list[nodes.Node]], *, widths: list[int]) -> nodes.table:
    table = nodes.table(classes=["from-package"])
    group = nodes.tgroup(cols=len(heads))
    group.extend(nodes.colspec(colwidth=width) for width in widths)
    head, body = nodes.thead(), nodes.tbody()
    head += _row([nodes.Text(text) for text in heads])
    body.extend(_row(cells) for cells in rows)
    group += [head, body]
    table += group
    return table


def _row(cells: list[nodes.Node]) -> nodes.row:
    row = nodes.row()
    for cell in cells:
        row += nodes.entry("", nodes.paragraph("", "", cell))
    return row


def setup(app: Sphinx) -> dict[str, bool]:
    """Tell Sphinx of the directives."""
    app.add_directive("command-help", CommandHelp)
    app.add_directive("contents-of", ContentsOf)
    app.add_directive("features", Features)
    app.add_directive("skeletons", Skeletons)
    app.add_directive("formats", Formats)
    return {"parallel_read_safe": True}
