"""Options that say what recordings' files do not: declared once, from command line to reader.

Each field of `ReadOptions` carries in its metadata what a command line shows of it: `flag`,
`metavar` and `help`.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from motionary.errors import InvalidInput, check_choice

if TYPE_CHECKING:
    from motionary.motion import Motion
    from motionary.skeletons import SkeletonTable

_TABLE = ".toml"
_MOST_RATE_HZ = 1e6


def _option(usage: str, text: str, *, default: str | None = None) -> Any:
    flag, _, metavar = usage.partition(" ")
    return field(default=default, metadata={"flag": flag, "metavar": metavar, "help": text})


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadOptions:
    """What the caller gives that files do not say, or say wrong.

    What is given goes before what the file says; a unit or an axis that clearly contradicts the
    body is refused, unless it is a number or ends in an exclamation mark ("y!").

    Attributes
    ----------
    asf : skeleton file of an Acclaim motion; by default looked for by name
    rate_hz : frames per second, where the file does not say it or says it wrong
    skeleton : name of a known skeleton, where the joint names do not tell it, or there are
        none and the order of the joints matters; or a .toml file that says which joint is
        which; of an Acclaim motion also the path of its skeleton file
    unit : "m", "dm", "cm", "mm", "inch" or metres per unit of the file, where the size of
        the body does not tell it
    up : axis that points up in the file ("y", "z", "-y", ...), where the body does not
        tell it
    body_model : for motions of SMPL bodies (AMASS): the model's file, which gives the
        person's own proportions
    sides : "named", "swapped" or "mirrored", where the body says that left and right are not
        as named: keep them, exchange the names, or take the axes for left-handed
    fill_gaps_s : gaps of a point up to this many seconds are filled, and counted in the
        notes; by default gaps stay
    fill_by : "cubic", with the velocities on either side, or "linear"
    trust_points : read points that are marked unseen (in C3D by a negative residual) where the
        file has places of them
    even_times : put frames at even times where those in the file have gaps or are uneven; what
        was not seen is unknown
    take : which recording of a file that holds several: its name, or its number from 1

    Raises
    ------
    InvalidInput
        If a rate, unit, axis, side or way of filling is none.
    """

    asf: str | Path | None = _option(
        "--asf FILE", "Skeleton of Acclaim motions (AMC); by default looked for by name."
    )
    rate_hz: float | None = _option(
        "--rate HZ", "Frames per second, where files do not say it or say it wrong."
    )
    skeleton: str | Path | None = _option(
        "--skeleton NAME|TOML",
        "A known skeleton, where joint names do not tell it, or a .toml file that maps them "
        "(`motionary info FILE --save-mapping RIG.toml` writes one).",
    )
    unit: float | str | None = _option(
        "--unit UNIT",
        "m, dm, cm, mm, inch or metres per unit, where the size of the body does not tell it.",
    )
    up: str | None = _option(
        "--up AXIS", "Axis that points up (y, z, -y ...), where the body does not tell it."
    )
    body_model: str | Path | None = _option(
        "--body-model NPZ",
        "Model file of SMPL bodies (AMASS), which gives the person's own proportions.",
    )
    sides: str | None = _option(
        "--sides HOW",
        "named, swapped or mirrored, where the body contradicts the names of left and right: "
        "keep them, exchange them, or take the axes for left-handed.",
    )
    fill_gaps_s: float | None = _option(
        "--fill-gaps SECONDS", "Fill gaps of points up to this long; by default gaps stay."
    )
    fill_by: str = _option(
        "--fill-by HOW",
        "cubic (the usual, with the velocities around the gap) or linear.",
        default="cubic",
    )
    trust_points: bool | None = _option(
        "--trust-points", "Read points that C3D marks unseen, though places are there."
    )
    even_times: bool | None = _option(
        "--even-times", "Put frames at even times where the file's have gaps or are uneven."
    )
    take: str | int | None = _option(
        "--take NAME|N", "Which recording of files that hold several, by name or number."
    )

    def __post_init__(self) -> None:
        # Imported late: a command line declares its flags from this class.
        if self.rate_hz is not None and not 0 < self.rate_hz < _MOST_RATE_HZ:
            raise InvalidInput(f"rate_hz must be a positive number below 1e6, got {self.rate_hz:g}")
        if self.unit is not None:
            from motionary.io.normalise.units import metres_per_unit

            metres_per_unit(self.unit)
        if self.up is not None:
            from motionary.io.normalise.axes import check_up

            check_up(self.up)
        if self.sides is not None:
            from motionary.io.normalise.sides import SIDES

            check_choice(self.sides, SIDES, name="sides")
        if self.fill_by != "cubic" or self.fill_gaps_s is not None:
            from motionary.io.normalise.gaps import check_filling

            check_filling(self.fill_by, self.fill_gaps_s)

    def given(self) -> dict[str, Any]:
        """The options that differ from their defaults, by name."""
        pairs = ((option, getattr(self, option.name)) for option in fields(self))
        return {option.name: value for option, value in pairs if value != option.default}

    def for_file(self, path: str | Path) -> ReadOptions:
        """The same without those that say nothing about a file of this name.

        A folder mixes formats, and not every format takes every option.
        """
        from motionary.io.formats import options_of

        options = options_of(path)
        given = self.given()
        return type(self)(**{name: value for name, value in given.items() if name in options})

    def absolute(self) -> ReadOptions:
        """The same with the paths of files as whoever runs in another folder finds them."""
        paths = {"asf": self.asf, "body_model": self.body_model, "skeleton": self.skeleton}
        if not self._names_asf() and not str(self.skeleton).lower().endswith(_TABLE):
            # The name of a known skeleton.
            del paths["skeleton"]
        found: dict[str, Any] = {
            name: Path(path).absolute() for name, path in paths.items() if path is not None
        }
        return replace(self, **found)

    @property
    def acclaim_skeleton(self) -> str | Path | None:
        """The skeleton file of Acclaim motions, given as `asf` or as `skeleton`."""
        return self.skeleton if self.asf is None and self._names_asf() else self.asf

    def skeleton_table(self) -> SkeletonTable | None:
        """The table of the skeleton that is given; None without one.

        Raises
        ------
        InvalidInput, UnreadableFile
            As of `find_skeleton`.
        """
        return None if self.skeleton is None or self._names_asf() else find_skeleton(self.skeleton)

    def _names_asf(self) -> bool:
        return str(self.skeleton).lower().endswith(".asf")


def find_skeleton(skeleton: str | Path) -> SkeletonTable:
    """A known skeleton by its name, or the one that a .toml file holds.

    Raises
    ------
    InvalidInput
        If no known skeleton has this name, or the file holds none.
    UnreadableFile
        If the file is missing or may not be read.
    """
    if not str(skeleton).lower().endswith(_TABLE):
        from motionary.skeletons import named_table

        return named_table(str(skeleton))
    path = Path(skeleton)
    try:
        stat = path.stat()
    except OSError:
        return _parse_skeleton.__wrapped__(path, (0, 0))
    return _parse_skeleton(path, (stat.st_mtime_ns, stat.st_size))


# Thousands of recordings are read with one table: it is parsed again only once it has changed.
@functools.lru_cache(maxsize=8)
def _parse_skeleton(path: Path, state: tuple[int, int]) -> SkeletonTable:
    from motionary.io.text import read_text
    from motionary.skeletons import parse_table

    return parse_table(path.stem, read_text(path), source=path.name)


def save_skeleton(motion: Motion, path: str | Path) -> None:
    """Write how the joints of a motion are mapped, to be corrected and given back.

    Where no joint is mapped it is a template to fill in.

    Parameters
    ----------
    motion : whose joints are written down
    path : the file, .toml

    Raises
    ------
    InvalidInput
        If the file is called otherwise.
    UnwritableFile
        If the file cannot be written.
    """
    from motionary.io.text import write_text
    from motionary.motion import JointMapping
    from motionary.skeletons import format_table, without_guess

    path = Path(path)
    if path.suffix.lower() != _TABLE:
        raise InvalidInput(f"a skeleton is written as {_TABLE}, got {path.name}")
    mapping = motion.mapping or JointMapping("", {})
    about = f"Joints of {motion.source}" if motion.source else "Joints of a rig"
    write_text(path, [format_table(without_guess(mapping), about=about, names=motion.names)])
