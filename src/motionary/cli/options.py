"""Which options do commands share, and how does a command take several as one?

A group is a frozen dataclass whose fields are options; a command that takes one has all of
them. Defaults are the library's own: they are looked up when a command needs or shows them.
"""

import importlib
import inspect
import math
from collections.abc import Callable
from dataclasses import MISSING, dataclass, fields, is_dataclass
from inspect import Parameter, Signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from motionary.errors import InvalidInput, UnreadableFile

if TYPE_CHECKING:
    from motionary.features import FeatureSet
    from motionary.io import ReadOptions


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


def _check_asf(value: str | None) -> str | None:
    if value is not None and not Path(value).is_file():
        raise typer.BadParameter(f"{value}: no such file")
    return value


def _check_rate(value: float | None) -> float | None:
    if value is not None and not 0 < value < math.inf:
        raise typer.BadParameter(f"needs frames per second above 0, got {value:g}")
    return value


def _check_skeleton(value: str | None) -> str | None:
    if value is not None and value.lower().endswith(".toml"):
        from motionary.io import find_skeleton

        try:
            find_skeleton(value)
        except (InvalidInput, UnreadableFile) as error:
            raise typer.BadParameter(str(error)) from error
    elif value is not None and not value.lower().endswith(".asf"):
        from motionary.skeletons import known_mappings

        if value not in known_mappings():
            known = ", ".join(known_mappings())
            raise typer.BadParameter(f"no known skeleton {value!r}; choose one of {known}")
    return value


def _check_unit(value: str | None) -> str | None:
    if value is not None:
        from motionary.io.normalise.units_axes import metres_per_unit

        try:
            metres_per_unit(value)
        except InvalidInput as error:
            raise typer.BadParameter(str(error)) from error
    return value


def _check_up(value: str | None) -> str | None:
    if value is not None:
        from motionary.io.normalise.axes import check_up

        try:
            check_up(value)
        except InvalidInput as error:
            raise typer.BadParameter(str(error)) from error
    return value


def _check_sides(value: str | None) -> str | None:
    if value is not None:
        from motionary.io.normalise.sides import check_sides

        try:
            check_sides(value)
        except InvalidInput as error:
            raise typer.BadParameter(str(error)) from error
    return value


def _check_seconds(value: float | None) -> float | None:
    if value is not None and not 0 < value < math.inf:
        raise typer.BadParameter(f"needs seconds above 0, got {value:g}")
    return value


def _check_filling(value: str | None) -> str | None:
    if value is not None:
        from motionary.io.normalise.gaps import check_filling

        try:
            check_filling(value)
        except InvalidInput as error:
            raise typer.BadParameter(str(error)) from error
    return value


@dataclass(frozen=True, kw_only=True)
class ReadingOptions:
    """What files do not say themselves."""

    asf: Annotated[
        str | None,
        typer.Option(
            metavar="FILE",
            callback=_check_asf,
            help="Skeleton of Acclaim motions (AMC); by default looked for by name.",
        ),
    ] = None
    rate: Annotated[
        float | None,
        typer.Option(
            metavar="HZ",
            callback=_check_rate,
            help="Frames per second, where files do not say it or say it wrong.",
        ),
    ] = None
    skeleton: Annotated[
        str | None,
        typer.Option(
            metavar="NAME|TOML",
            callback=_check_skeleton,
            help="A known skeleton, where joint names do not tell it, or a .toml file that maps "
            "them (`motionary info FILE --save-mapping RIG.toml` writes one).",
        ),
    ] = None
    unit: Annotated[
        str | None,
        typer.Option(
            metavar="UNIT",
            callback=_check_unit,
            help="m, cm, mm, inch or metres per unit, where the size of the body does not tell it.",
        ),
    ] = None
    up: Annotated[
        str | None,
        typer.Option(
            metavar="AXIS",
            callback=_check_up,
            help="Axis that points up (y, z, -y ...), where the body does not tell it.",
        ),
    ] = None
    sides: Annotated[
        str | None,
        typer.Option(
            metavar="HOW",
            callback=_check_sides,
            help="named, swapped or mirrored, where the body contradicts the names of left and "
            "right: keep them, exchange them, or take the axes for left-handed.",
        ),
    ] = None
    fill_gaps: Annotated[
        float | None,
        typer.Option(
            metavar="SECONDS",
            callback=_check_seconds,
            help="Fill gaps of points up to this long; by default gaps stay.",
        ),
    ] = None
    fill_by: Annotated[
        str | None,
        typer.Option(
            metavar="HOW",
            callback=_check_filling,
            help="cubic (the usual, with the velocities around the gap) or linear.",
        ),
    ] = None

    def reading(self) -> "ReadOptions":
        """The same for the library."""
        from motionary.io import ReadOptions

        if self.fill_by is not None and self.fill_gaps is None:
            raise typer.BadParameter("goes with --fill-gaps SECONDS", param_hint="--fill-by")
        return ReadOptions(
            asf=self.asf,
            rate_hz=self.rate,
            skeleton=self.skeleton,
            unit=self.unit,
            up=self.up,
            sides=self.sides,
            fill_gaps_s=self.fill_gaps,
            **({} if self.fill_by is None else {"fill_by": self.fill_by}),
        )


Jobs = Annotated[
    int,
    typer.Option(
        min=1,
        metavar="N",
        default_factory=LibraryDefault("motionary.batch:map_ordered", "jobs"),
        help="Processes that read files; the answer is the same.",
    ),
]

AsJson = Annotated[
    bool,
    typer.Option("--json", help="JSON on stdout, one object a line, and nothing else."),
]


Excel = Annotated[
    bool,
    typer.Option(
        "--excel",
        help="Tables with semicolons and decimal commas, as Excel opens them by a double click "
        "in most of Europe.",
    ),
]


def _check_feature_set(value: str | None) -> str | None:
    if value is not None:
        find_feature_set(value)
    return value


FeatureSetName = Annotated[
    str | None,
    typer.Option(
        "--features",
        metavar="SET",
        callback=_check_feature_set,
        help="Relations to measure: full-body-40 (the usual), legs-14, three-levels-129 (how far "
        "and how fast), full-body-39.",
    ),
]


def find_feature_set(name: str | None) -> "FeatureSet":
    """The set of relations of a name; the usual one without."""
    from motionary.features import FULL_BODY, known_sets

    if name is None:
        return FULL_BODY
    if name not in known_sets():
        raise typer.BadParameter(f"no set {name!r}; choose one of {', '.join(known_sets())}")
    return known_sets()[name]


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
            values[name] = group(**{f.name: values.pop(f.name) for f in fields(group)})
        return command(**values)

    return expanded, Signature(parameters)


def _parameters_of(group: Any) -> list[Parameter]:
    hints = get_type_hints(group, include_extras=True)
    return [
        Parameter(
            field.name,
            Parameter.KEYWORD_ONLY,
            default=Parameter.empty if field.default is MISSING else field.default,
            annotation=hints[field.name],
        )
        for field in fields(group)
    ]
