"""How does a motion go into a .npz file and out of it, with all that it holds?

A file of ours holds `positions` (frames, joints, 3) in metres with y up, `names`, `rate_hz`,
`first_frame` and what its joints are, of rigs also `parents`, `offsets`, `ends` and
`rotations`, of recordings with events also `event_names`, `event_sides` and
`event_times_s`. Files of others: motions of SMPL bodies (AMASS), or positions under one of
the usual names.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from motionary.batch import write_atomically
from motionary.errors import NO_MOTION, UnreadableFile
from motionary.io.formats.arrays import array_to_motion, check_positions, name_joints
from motionary.io.formats.numpy_files import Array, read_npz
from motionary.io.formats.smpl import is_smpl, read_smpl_arrays
from motionary.io.normalise.body_frame import FileMetadata, rescale, settle_claims, turn
from motionary.motion import Event, JointMapping, Motion, Skeleton
from motionary.skeletons import (
    SkeletonTable,
    find_mapping,
    format_table,
    known_mappings,
    named_mapping,
    parse_table,
)

Floats = NDArray[np.float64]

_FORMAT = 1
_OWN = FileMetadata("m", "y")
_POSITIONS = ("positions", "joints", "keypoints3d", "joints3d", "jtr", "xyz")
_NAMES = ("names", "joint_names", "marker_names", "labels")
RATES = ("rate_hz", "fps", "mocap_framerate", "mocap_frame_rate", "frame_rate", "framerate")


def read_npz_motion(
    path: str | Path,
    *,
    rate_hz: float | None = None,
    skeleton: SkeletonTable | None = None,
    unit: float | str | None = None,
    up: str | None = None,
    body_model: str | Path | None = None,
) -> Motion:
    """Read a .npz file.

    Parameters
    ----------
    path : the file
    rate_hz, unit, up, body_model : as in `read`
    skeleton : as in `read`; order of joints where the file has no names

    Raises
    ------
    UnreadableFile
        If the file is missing, damaged, or holds no motion.
    InvalidInput
        If rate or names are neither known nor told, or the body contradicts what is.
    """
    path = Path(path)
    arrays = read_npz(path)
    if "motionary_motion" in arrays:
        motion = _read_own(arrays, path.name, rate_hz, skeleton)
        if unit is None and up is None:
            return motion
        normalised = settle_claims(motion, _OWN, unit=unit, up=up)
        told = [note for note in normalised.notes if note.endswith("as told")]
        return replace(turn(rescale(motion, normalised.metres), normalised.up), notes=tuple(told))
    rate = rate_hz if rate_hz is not None else find_rate(arrays)
    if is_smpl(arrays):
        return read_smpl_arrays(
            arrays, path.name, rate_hz=rate, unit=unit, up=up, body_model=body_model
        )
    key = next((key for key in _POSITIONS if key in arrays), None)
    if key is None:
        raise UnreadableFile(
            f"{path.name}: {NO_MOTION}; expected poses and trans (AMASS) or positions "
            f"(frames, joints, 3), got {', '.join(sorted(arrays)) or 'no arrays'}"
        )
    positions = check_positions(arrays[key], path.name)
    joints = name_joints(positions, path.name, skeleton=skeleton, names=_find_names(arrays))
    return array_to_motion(positions, joints, path.name, rate_hz=rate, unit=unit, up=up)


def find_rate(arrays: dict[str, Array]) -> float | None:
    """Frames per second, under one of the usual names; None if there is none."""
    for key in RATES:
        if key in arrays and arrays[key].size == 1 and arrays[key].dtype.kind in "fiu":
            rate = float(arrays[key].reshape(()))
            if 0 < rate < 1e6:
                return rate
    return None


def _find_names(arrays: dict[str, Array]) -> list[str] | None:
    key = next((key for key in _NAMES if key in arrays), None)
    if key is None or arrays[key].dtype.kind not in "US" or arrays[key].ndim != 1:
        return None
    return [n.decode("latin-1") if isinstance(n, bytes) else n for n in arrays[key].tolist()]


def _read_own(
    arrays: dict[str, Array], source: str, rate_hz: float | None, told: SkeletonTable | None
) -> Motion:
    try:
        if int(arrays["motionary_motion"]) > _FORMAT:
            raise UnreadableFile(f"{source}: was written by a newer version; update motionary")
        names = tuple(str(name) for name in arrays["names"].tolist())
        # Of a file's own numbers, -0.0 and all, none is touched.
        positions = np.array(arrays["positions"], dtype=np.float64)
        skeleton = None
        if "parents" in arrays:
            skeleton = Skeleton(
                names,
                arrays["parents"].astype(np.intp),
                np.array(arrays["offsets"], dtype=np.float64),
                ends=bool(arrays["ends"]),
            )
        return Motion(
            names=names,
            positions=positions,
            rate_hz=float(arrays["rate_hz"]) if rate_hz is None else rate_hz,
            mapping=_mapping(arrays, names, skeleton, told),
            skeleton=skeleton,
            rotations=_rotations(arrays, positions.shape[:2]),
            source=source,
            first_frame=int(arrays["first_frame"]),
            events=_events(arrays),
        )
    except (KeyError, ValueError, TypeError, OverflowError) as error:
        raise UnreadableFile(f"{source}: is no whole motion: {error}") from error


def _mapping(
    arrays: dict[str, Array],
    names: tuple[str, ...],
    skeleton: Skeleton | None,
    told: SkeletonTable | None,
) -> JointMapping | None:
    if told is None and "skeleton" in arrays:
        name = str(arrays["skeleton"])
        if "skeleton_table" in arrays:
            return parse_table(name, str(arrays["skeleton_table"])).resolve(names)
        return named_mapping(name, names)
    positions = np.array(arrays["positions"], dtype=np.float64)
    return find_mapping(names, skeleton, positions, told=told)


def _rotations(arrays: dict[str, Array], shape: tuple[int, ...]) -> Floats | None:
    if "rotations" not in arrays:
        return None
    rotations = np.array(arrays["rotations"], dtype=np.float64)
    if rotations.shape != (*shape, 4) or not np.isfinite(rotations).all():
        raise ValueError(f"rotations need shape {(*shape, 4)}, got {rotations.shape}")
    if (np.abs(np.linalg.norm(rotations, axis=-1) - 1) > 1e-6).any():
        raise ValueError("rotations must be unit quaternions")
    return rotations


def _events(arrays: dict[str, Array]) -> tuple[Event, ...]:
    if "event_names" not in arrays:
        return ()
    columns = (arrays[key].tolist() for key in ("event_names", "event_sides", "event_times_s"))
    return tuple(Event(str(n), str(s), float(t)) for n, s, t in zip(*columns, strict=True))


def _is_known(mapping: JointMapping, names: tuple[str, ...]) -> bool:
    """Whether a known skeleton tells the mapping: a file may change one and keep its name."""
    name = mapping.name
    return name in known_mappings() and named_mapping(name, names) == mapping


def write_npz(motion: Motion, path: str | Path) -> None:
    """Write all that a motion holds but its notes; the same motion gives the same bytes.

    Raises
    ------
    UnwritableFile
        If the file cannot be written.
    """
    arrays: dict[str, Array] = {
        "motionary_motion": np.array(_FORMAT),
        "positions": motion.positions,
        "names": np.array(motion.names, dtype=np.str_),
        "rate_hz": np.array(motion.rate_hz),
        "first_frame": np.array(motion.first_frame),
    }
    if motion.mapping is not None:
        arrays["skeleton"] = np.array(motion.mapping.name)
        if not _is_known(motion.mapping, motion.names):
            table = format_table(motion.mapping, about=motion.mapping.name)
            arrays["skeleton_table"] = np.array(table)
    if motion.skeleton is not None:
        arrays["parents"] = motion.skeleton.parents.astype(np.int64)
        arrays["offsets"] = motion.skeleton.offsets
        arrays["ends"] = np.array(motion.skeleton.ends)
    if motion.rotations is not None:
        arrays["rotations"] = motion.rotations
    if motion.events:
        arrays["event_names"] = np.array([e.name for e in motion.events], dtype=np.str_)
        arrays["event_sides"] = np.array([e.side for e in motion.events], dtype=np.str_)
        arrays["event_times_s"] = np.array([e.time_s for e in motion.events])
    with write_atomically(path) as beside, beside.open("wb") as file:
        np.savez_compressed(file, **arrays)  # type: ignore[arg-type]
