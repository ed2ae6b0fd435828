"""How is a motion written in any format that has a writer?"""

from collections.abc import Callable
from pathlib import Path

from motionary.errors import InvalidInput
from motionary.io.suffixes import PACKED, format_suffix
from motionary.motion import Motion


# Modules of formats are imported when a file of theirs is written.
def _write_amc(motion: Motion, path: Path, asf: str | Path | None, unit: float | str) -> None:
    from motionary.io.formats.acclaim_writing import write_amc

    write_amc(motion, path, asf=asf)


def _write_bvh(motion: Motion, path: Path, asf: str | Path | None, unit: float | str) -> None:
    from motionary.io.formats.bvh_writing import write_bvh

    write_bvh(motion, path, unit=unit)


def _write_c3d(motion: Motion, path: Path, asf: str | Path | None, unit: float | str) -> None:
    from motionary.io.formats.c3d import write_c3d

    write_c3d(motion, path)


def _write_npz(motion: Motion, path: Path, asf: str | Path | None, unit: float | str) -> None:
    from motionary.io.formats.npz import write_npz

    write_npz(motion, path)


def _write_trc(motion: Motion, path: Path, asf: str | Path | None, unit: float | str) -> None:
    from motionary.io.formats.trc import write_trc

    write_trc(motion, path)


_Writer = Callable[[Motion, Path, str | Path | None, float | str], None]

_WRITERS: dict[str, _Writer] = {
    ".amc": _write_amc,
    ".bvh": _write_bvh,
    ".c3d": _write_c3d,
    ".npz": _write_npz,
    ".trc": _write_trc,
}
_WRITERS |= {f"{suffix}.gz": _WRITERS[suffix] for suffix in (".amc", ".bvh", ".trc")}

_LACKING = {
    "rig": (".c3d", ".trc"),
    "events": (".amc", ".bvh", ".trc"),
    "first frame": (".bvh",),
    "rate": (".amc",),
}

#: Suffixes of what can be written.
WRITTEN_SUFFIXES = tuple(_WRITERS)


def write(
    motion: Motion,
    path: str | Path,
    *,
    asf: str | Path | None = None,
    unit: float | str = "cm",
) -> None:
    """Write a motion; the suffix of the file's name says how.

    `.npz` holds all that a motion has. `.bvh` holds the rig, with joints and turns as they
    are, and `.amc` the turns of an Acclaim skeleton. `.c3d` and `.trc` hold positions, gaps
    and the file's first frame, `.c3d` also events. The file is written whole or not at all,
    and holds no folder's name.

    Parameters
    ----------
    motion : what to write
    path : the file; texts are packed where the name ends in .gz
    asf : for .amc: the skeleton's file; by default looked for by name
    unit : for .bvh: of lengths in the file

    Raises
    ------
    InvalidInput
        If the suffix is unknown, or the format cannot hold this motion.
    UnwritableFile
        If the file cannot be written.
    """
    path = Path(path)
    writer = check_writable(path)
    writer(motion, path, asf, unit)


def check_writable(path: str | Path) -> _Writer:
    """What writes a file of this name.

    Raises
    ------
    InvalidInput
        If its suffix is none of `WRITTEN_SUFFIXES`.
    """
    writer = _WRITERS.get(format_suffix(path))
    if writer is None:
        raise InvalidInput(
            f"{Path(path).name}: motions are written as {', '.join(WRITTEN_SUFFIXES)}, got "
            f"{format_suffix(path)!r}"
        )
    return writer


def what_is_lost(motion: Motion, path: str | Path) -> tuple[str, ...]:
    """What a motion has and a file of this name cannot hold, each in a word or two."""
    suffix = format_suffix(path).removesuffix(PACKED)
    has = {
        "rig": motion.rotations is not None,
        "events": bool(motion.events),
        "first frame": motion.first_frame != 0,
        "rate": True,
    }
    return tuple(thing for thing, there in has.items() if there and suffix in _LACKING[thing])
