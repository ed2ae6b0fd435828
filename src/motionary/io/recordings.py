"""Reading and writing recordings in any known format."""

from collections.abc import Sequence
from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np

from motionary.errors import InvalidInput, SeveralRecordings, UnreadableFile, check_kind, check_path
from motionary.files import open_regular
from motionary.io.formats import (
    FORMATS,
    WRITTEN_SUFFIXES,
    Format,
    find_format,
    label_takes,
    load_function,
    split_take,
    way_out,
)
from motionary.io.formats.content import FileContent
from motionary.io.normalise import normalise
from motionary.io.normalise.gaps import fill_gaps, unsee_zeros
from motionary.io.normalise.quality import check_quality, mark_in_place
from motionary.io.normalise.sides import normalise_sides
from motionary.io.options import ReadOptions
from motionary.io.text import TAKE_MARK, format_suffix
from motionary.motion import JointMapping, Motion, Unmapped
from motionary.recording import Recording
from motionary.skeletons import SkeletonTable, known_mappings, map_joints

# Slower than any recording of a body that moves.
_SLOWEST_HZ = 10.0

_REFUSALS = {
    "asf": "has its own skeleton; leave out asf=",
    "take": "holds one recording; leave out take=",
    "trust_points": "marks no points unseen; leave out trust_points=",
    "even_times": "has no times of single frames; leave out even_times=",
    "body_model": "is no motion of a body model; leave out body_model=",
}


def read(path: str | Path, options: ReadOptions | None = None, **fields: Any) -> Motion:
    """Read a recording; the suffix of its name says how.

    Parameters
    ----------
    path : the file; texts may be packed (`take.bvh.gz`), and one recording of several in a
        file is named behind it (`batch.npy#3`)
    options : what the file does not say
    fields : fields of `ReadOptions` by name, instead of it or on top: `rate_hz=60`, `up="z"`

    Returns
    -------
    Motion, positions in metres, y up

    Raises
    ------
    UnreadableFile
        If the file is missing, broken, or of an unknown format.
    InvalidInput
        If an option does not go with the format, or contradicts the file, or the caller, the
        file and the body contradict each other.
    """
    motion = read_poses(path, options, **fields)
    with np.errstate(all="ignore"):
        return check_quality(motion)


# Damaged files hold numbers beyond all limits: what comes of them is refused where a motion is
# made, and is no warning on the way.
@np.errstate(all="ignore")
def read_poses(path: str | Path, options: ReadOptions | None = None, **fields: Any) -> Motion:
    """As `read`, without the quality checks, whose notes take a third of the time of reading.

    Parameters
    ----------
    path, options, fields : as of `read`

    Raises
    ------
    UnreadableFile, InvalidInput
        As of `read`.
    """
    path = check_path(path, remedy="files are read one after the other: [read(p) for p in paths]")
    options = ReadOptions(**fields) if options is None else replace(options, **fields)
    path, take = split_take(path)
    if take:
        if options.take is not None:
            raise InvalidInput(
                "names a take; leave out take=", file=f"{path.name}{TAKE_MARK}{take}"
            )
        motion = read_poses(path, options, take=take)
        return motion.renamed(f"{motion.source}{TAKE_MARK}{take}")
    form = find_format(path)
    if form is None:
        known = ", ".join(form.suffix for form in FORMATS)
        problem = way_out(path)
        if not problem:
            # What is not there, or is no file, is told first.
            open_regular(path).close()
            problem = f"unknown format {path.suffix!r}; known are {known}"
        raise UnreadableFile(problem, file=path)
    _check_options(options, form, path)
    table = options.skeleton_table()
    content: FileContent = load_function(form.read)(path, options)
    motion = _to_motion(content, path.name, table)
    if content.metadata is not None:
        motion = normalise(motion, content.metadata, unit=options.unit, up=options.up)
    motion = normalise_sides(_note_mapping(motion, table), options.sides)
    if options.fill_gaps_s is not None:
        motion = fill_gaps(motion, longest_s=options.fill_gaps_s, fill_by=options.fill_by)
    return mark_in_place(motion)


def read_all(path: str | Path, options: ReadOptions | None = None, **fields: Any) -> list[Motion]:
    """All recordings of a file: one, or those of a batch, named `batch.npy#001` and so on.

    Parameters
    ----------
    path, options, fields : as of `read`

    Raises
    ------
    UnreadableFile, InvalidInput
        As of `read`.
    """
    path = Path(path)
    options = ReadOptions(**fields) if options is None else replace(options, **fields)
    try:
        return [read(path, options)]
    except SeveralRecordings as several:
        takes = label_takes(several.takes)
    return [read(path.with_name(f"{path.name}{TAKE_MARK}{take}"), options) for take in takes]


def write(
    motion: Motion, path: str | Path, *, asf: str | Path | None = None, unit: float | str = "cm"
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
    path = check_path(path, remedy="the motion comes first: write(motion, path)")
    check_kind(motion, (Motion,), name="motion", remedy="motions are written one after the other")
    form = find_format(path)
    if form is None or not form.write:
        raise InvalidInput(
            f"motions are written as {', '.join(WRITTEN_SUFFIXES)}, got {format_suffix(path)!r}",
            file=path.name,
        )
    given = {"asf": asf, "unit": unit}
    load_function(form.write)(motion, path, **{name: given[name] for name in form.write_takes})


def what_is_lost(motion: Motion, path: str | Path) -> tuple[str, ...]:
    """What a motion has and a file of this name cannot hold, each in a word or two."""
    form = find_format(path)
    has = {
        "rig": motion.rotations is not None,
        "events": bool(motion.events),
        "first frame": motion.first_frame != 0,
        "rate": True,
    }
    lacks = form.lacks if form else ()
    return tuple(thing for thing, there in has.items() if there and thing in lacks)


def _check_options(options: ReadOptions, form: Format, path: Path) -> None:
    """Refuse what would be passed over in silence."""
    for option, reason in _REFUSALS.items():
        if option not in form.takes and getattr(options, option) not in (None, False):
            raise InvalidInput(f"this format {reason}", file=path.name)


def _to_motion(content: FileContent, source: str, table: SkeletonTable | None) -> Motion:
    """The motion, in the file's unit and axes, with its joints mapped."""
    # Before anything is told by the body; the joints of a rig are computed, and never missing.
    if content.rotations is None and content.skeleton is None:
        positions, zeros = unsee_zeros(content.positions, content.names)
        content = replace(content, positions=positions, notes=(*content.notes, *zeros))
    mapping = _find_mapping(content, table)
    notes = content.notes
    if content.rate_hz < _SLOWEST_HZ:
        notes = (
            *notes,
            f"{content.rate_hz:g} Hz is slow for a motion; if the file's rate is wrong, pass the "
            "right one with --rate (rate_hz=...)",
        )
    return Motion(
        names=tuple(content.names),
        positions=content.positions,
        recording=Recording(source, rate_hz=content.rate_hz, first_frame=content.first_frame),
        mapping=mapping if isinstance(mapping, JointMapping) else None,
        skeleton=content.skeleton,
        rotations=content.rotations,
        events=content.events,
        notes=notes,
        unmapped=mapping if isinstance(mapping, Unmapped) else None,
    )


def _find_mapping(content: FileContent, table: SkeletonTable | None) -> JointMapping | Unmapped:
    own = content.mapping
    if own is not None and (table is None or own.name == table.name):
        return own
    return map_joints(content.names, content.skeleton, content.positions, given=table)


def _note_mapping(motion: Motion, table: SkeletonTable | None) -> Motion:
    """The motion with a note on joints that cannot be mapped, or not as given."""
    if table is not None and motion.mapping is not None:
        names = set(motion.names)
        if not any(names.issuperset(source) for source in motion.mapping.weights.values()):
            raise InvalidInput(
                f"has none of the joints of skeleton {table.name}; its joints "
                f"are {', '.join(motion.names[:6])}, ...",
                file=motion.source,
            )
        if table.name not in known_mappings():
            motion = replace(motion, notes=(*motion.notes, *_misnamed(table, motion.names)))
    if motion.unmapped is None:
        return motion
    return replace(motion, notes=(*motion.notes, f"no features: {motion.unmapped.reason}"))


def _misnamed(table: SkeletonTable, names: Sequence[str]) -> list[str]:
    """Notes on names of a table that are nearly those of the file, as misspelt ones are."""
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
