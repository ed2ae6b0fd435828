"""How is a recording of any known format read?"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path
from typing import NamedTuple

from motionary.errors import InvalidInput, UnreadableFile
from motionary.io.normalise.gaps import check_filling, fill_gaps
from motionary.io.normalise.quality import check_quality
from motionary.io.normalise.sides import check_sides, normalise_sides
from motionary.io.skeleton_files import find_skeleton
from motionary.io.suffixes import format_suffix
from motionary.motion import NO_FEATURES, Motion
from motionary.skeletons import SkeletonTable, explain_unmapped, known_mappings


@dataclass(frozen=True, slots=True)
class _Told:
    """What the caller says that files do not."""

    asf: str | Path | None = None
    rate_hz: float | None = None
    skeleton: SkeletonTable | None = None
    unit: float | str | None = None
    up: str | None = None
    body_model: str | Path | None = None
    sides: str | None = None


# Modules of formats are imported when a file of theirs is read.
def _read_amc(path: Path, told: _Told) -> Motion:
    from motionary.io.formats.acclaim import read_amc

    return read_amc(
        path,
        asf=told.asf,
        rate_hz=told.rate_hz,
        skeleton=told.skeleton,
        unit=told.unit,
        up=told.up,
    )


def _read_bvh(path: Path, told: _Told) -> Motion:
    from motionary.io.formats.bvh import read_bvh

    return read_bvh(path, rate_hz=told.rate_hz, skeleton=told.skeleton, unit=told.unit, up=told.up)


def _read_c3d(path: Path, told: _Told) -> Motion:
    from motionary.io.formats.c3d import read_c3d

    return read_c3d(path, rate_hz=told.rate_hz, skeleton=told.skeleton, unit=told.unit, up=told.up)


def _read_trc(path: Path, told: _Told) -> Motion:
    from motionary.io.formats.trc import read_trc

    return read_trc(path, rate_hz=told.rate_hz, skeleton=told.skeleton, unit=told.unit, up=told.up)


def _read_opensim(path: Path, told: _Told) -> Motion:
    from motionary.io.formats.opensim import read_opensim

    return read_opensim(
        path, rate_hz=told.rate_hz, skeleton=told.skeleton, unit=told.unit, up=told.up
    )


def _read_npz(path: Path, told: _Told) -> Motion:
    from motionary.io.formats.npz import read_npz_motion

    return read_npz_motion(
        path,
        rate_hz=told.rate_hz,
        skeleton=told.skeleton,
        unit=told.unit,
        up=told.up,
        body_model=told.body_model,
    )


def _read_npy(path: Path, told: _Told) -> Motion:
    from motionary.io.formats.arrays import read_array

    return read_array(
        path, rate_hz=told.rate_hz, skeleton=told.skeleton, unit=told.unit, up=told.up
    )


def _read_pkl(path: Path, told: _Told) -> Motion:
    from motionary.io.formats.pickled import read_pickle

    return read_pickle(
        path, rate_hz=told.rate_hz, skeleton=told.skeleton, unit=told.unit, up=told.up
    )


def _read_fbx(path: Path, told: _Told) -> Motion:
    from motionary.io.formats.fbx import read_fbx

    return read_fbx(path, rate_hz=told.rate_hz, skeleton=told.skeleton, unit=told.unit, up=told.up)


class _Format(NamedTuple):
    """How a format is read, and which of the options say something about it."""

    read: Callable[[Path, _Told], Motion]
    takes: frozenset[str]


_POINTS = frozenset({"rate_hz", "unit", "up"})

_FORMATS: dict[str, _Format] = {
    ".amc": _Format(_read_amc, _POINTS | {"asf"}),
    ".bvh": _Format(_read_bvh, _POINTS),
    ".c3d": _Format(_read_c3d, _POINTS),
    ".trc": _Format(_read_trc, _POINTS),
    ".npz": _Format(_read_npz, _POINTS | {"body_model"}),
    ".npy": _Format(_read_npy, _POINTS),
    ".pkl": _Format(_read_pkl, _POINTS),
    ".fbx": _Format(_read_fbx, _POINTS),
    ".sto": _Format(_read_opensim, _POINTS),
    ".mot": _Format(_read_opensim, _POINTS),
}
_TEXTS = (".amc", ".bvh", ".trc", ".sto", ".mot")
_READERS = _FORMATS | {f"{suffix}.gz": _FORMATS[suffix] for suffix in _TEXTS}

# OpenSim's tables rarely hold places: they are read where they are named.
_NAMED_ONLY = (".sto", ".mot")

#: Suffixes that are looked for in folders.
MOTION_SUFFIXES = tuple(s for s in _READERS if s.removesuffix(".gz") not in _NAMED_ONLY)

_REFUSALS = {
    "asf": "has its own skeleton; leave out asf=",
    "body_model": "is no motion of a body model; leave out body_model=",
}


def read(  # noqa: PLR0913 - each thing that files do not say has a name of its own
    path: str | Path,
    *,
    asf: str | Path | None = None,
    rate_hz: float | None = None,
    skeleton: str | Path | None = None,
    unit: float | str | None = None,
    up: str | None = None,
    body_model: str | Path | None = None,
    sides: str | None = None,
    fill_gaps_s: float | None = None,
    fill_by: str = "cubic",
) -> Motion:
    """Read a recording; the suffix of its name says how.

    What is told goes before what the file says; a unit or an axis that clearly contradicts the
    body is refused, unless it is a number or ends in an exclamation mark ("y!").

    Parameters
    ----------
    path : the file; texts may be packed (`take.bvh.gz`)
    asf : skeleton file of an Acclaim motion; by default looked for by name
    rate_hz : frames per second, where the file does not say it or says it wrong
    skeleton : name of a known skeleton, where the joint names do not tell it, or there are
        none and the order of the joints matters; or a .toml file that says which joint is
        which; of an Acclaim motion also the path of its skeleton file
    unit : "m", "cm", "mm", "inch" or metres per unit of the file, where the size of
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

    Returns
    -------
    Motion, positions in metres, y up

    Raises
    ------
    UnreadableFile
        If the file is missing, broken, or of an unknown format.
    InvalidInput
        If an argument does not go with the format, or contradicts the file, or the caller, the
        file and the body contradict each other.
    """
    path = Path(path)
    known = _READERS.get(format_suffix(path))
    if known is None:
        raise UnreadableFile(
            f"{path}: unknown format {path.suffix!r}; known are {', '.join(_FORMATS)}"
        )
    if rate_hz is not None and not 0 < rate_hz < 1e6:
        raise InvalidInput(f"rate_hz must be a positive number below 1e6, got {rate_hz:g}")
    if skeleton is not None and str(skeleton).lower().endswith(".asf"):
        asf, skeleton = skeleton, None
    table = None if skeleton is None else find_skeleton(skeleton)
    if sides is not None:
        check_sides(sides)
    check_filling(fill_by)
    told = _Told(asf, rate_hz, table, unit, up, body_model, sides)
    for option, reason in _REFUSALS.items():
        if option not in known.takes and getattr(told, option) is not None:
            raise InvalidInput(f"{path.name}: this format {reason}")
    motion = known.read(path, told)
    motion = normalise_sides(_map_joints(motion, table), sides)
    if fill_gaps_s is not None:
        motion = fill_gaps(motion, longest_s=fill_gaps_s, fill_by=fill_by)
    return check_quality(motion)


def _map_joints(motion: Motion, table: SkeletonTable | None) -> Motion:
    """The motion with its joints mapped as told, and a note if they cannot be mapped."""
    if table is not None:
        if motion.mapping is None or motion.mapping.name != table.name:
            motion = replace(motion, mapping=table.resolve(motion.names))
        names = set(motion.names)
        weights = {} if motion.mapping is None else motion.mapping.weights
        if not any(names.issuperset(source) for source in weights.values()):
            raise InvalidInput(
                f"{motion.source}: has none of the joints of skeleton {table.name}; its joints "
                f"are {', '.join(motion.names[:6])}, ..."
            )
        if table.name not in known_mappings():
            motion = replace(motion, notes=(*motion.notes, *_misnamed(table, motion.names)))
    if motion.mapping is not None:
        return motion
    why = explain_unmapped(motion.names, motion.skeleton, motion.positions)
    return replace(motion, notes=(*motion.notes, f"{NO_FEATURES}{why}"))


def _misnamed(table: SkeletonTable, names: tuple[str, ...]) -> list[str]:
    """A note on names of a table that nearly are names of the file: slips of the pen."""
    own = {name.rpartition(":")[2]: name for name in names}
    slips = []
    for joint, alternatives in table.joints.items():
        if any(all(n in own or n in names for n in source) for source in alternatives):
            continue
        for name in alternatives[0]:
            near = get_close_matches(name, own, n=1, cutoff=0.8)
            if name not in own and near and not name.startswith("End of "):
                slips.append(f"{joint} is {name!r}, which is not there; is it {near[0]!r}?")
    return [f"{table.name}: {slip}" for slip in slips]


def options_of(path: str | Path) -> frozenset[str]:
    """Which options of `read` say something about a file, by its name."""
    known = _READERS.get(format_suffix(path))
    return frozenset({"skeleton", "sides", "fill_gaps_s", "fill_by"}) | (
        known.takes if known else frozenset()
    )
