"""What a careful reader makes of a file: read right, right with a note, or refused.

A case lists every outcome that is right; a file passes with any of them.
"""

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

import motionary
from motionary.features import compute_features
from motionary.motion import GENERIC_JOINTS

LONGEST_MESSAGE = 500


@dataclass(frozen=True)
class Read:
    """Read, with these values; what is None is not looked at.

    Attributes
    ----------
    notes : regular expressions, each found in one note or more
    unknown : pairs of frame and joint name that are NaN; "*" means every joint
    same_as : path below the data folder of a recording with the same places
    leg_m : least and most length of a leg, hip to knee to ankle, in metres
    height_m : least and most extent along y over all joints and frames, in metres
    root_m : least and most median height of the first joint, in metres
    farthest_m : no coordinate is larger
    upper, lower : a joint that is above another one in every frame
    """

    frames: int | None = None
    joints: int | None = None
    rate_hz: float | None = None
    features: int | None = None
    generic: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    unknown: tuple[tuple[int, str], ...] = ()
    same_as: str | None = None
    leg_m: tuple[float, float] | None = None
    height_m: tuple[float, float] | None = None
    root_m: tuple[float, float] | None = None
    farthest_m: float | None = None
    upper: str | None = None
    lower: str | None = None


@dataclass(frozen=True)
class Refused:
    """Refused in one line that names the file and matches a regular expression."""

    message: str


@dataclass(frozen=True)
class Case:
    """A file below the data folder, its right outcomes, and options of `read`."""

    file: str
    right: tuple[Read | Refused, ...]
    options: dict[str, Any] = field(default_factory=dict)

    def __str__(self) -> str:
        return self.file


def case(file: str, *right: Read | Refused, **options: Any) -> Case:
    return Case(file, right, options)


def check_case(data: Path, one: Case) -> None:
    """Fail unless the file comes out as one of the right outcomes says."""
    try:
        motion = motionary.read(data / one.file, **one.options)
    except motionary.MotionaryError as error:
        problems = message_problems(str(error), Path(one.file).name, one.right)
    else:
        found = [read_problems(motion, r, data) for r in one.right if isinstance(r, Read)]
        problems = min(found, key=len) if found else [f"read, but must be refused: {one.right}"]
    assert not problems, "; ".join(problems)


def message_problems(message: str, name: str, right: tuple[Read | Refused, ...]) -> list[str]:
    """What is wrong with a refusal."""
    problems = []
    wanted = [outcome.message for outcome in right if isinstance(outcome, Refused)]
    # The names of the files tell their faults.
    if not any(re.search(pattern, message.replace(name, "")) for pattern in wanted):
        problems.append(f"refused with {message!r}, right is {wanted or 'to read it'}")
    if "\n" in message or len(message) > LONGEST_MESSAGE:
        problems.append(f"a message of {len(message)} characters, or of several lines")
    if name not in message:
        problems.append(f"the message does not name {name}")
    return problems


def read_problems(motion: motionary.Motion, right: Read, data: Path) -> list[str]:
    """What of a recording differs from what is right."""
    problems = [*_number_problems(motion, right), *_size_problems(motion, right)]
    notes = [note.replace(motion.source, "") for note in all_notes(motion)]
    for pattern in right.notes:
        if not any(re.search(pattern, note) for note in notes):
            problems.append(f"no note has {pattern!r}: {notes}")
    for frame, name in right.unknown:
        joints = slice(None) if name == "*" else motion.names.index(name)
        if not np.isnan(motion.positions[frame, joints]).all():
            problems.append(f"frame {frame} of {name} should be unknown")
    if right.same_as is not None:
        other = motionary.read(data / right.same_as)
        if other.names != motion.names or other.rate_hz != motion.rate_hz:
            problems.append(f"other joints or rate than {right.same_as}")
        elif not _are_equal(motion.positions, other.positions, right.unknown, motion.names):
            problems.append(f"other places than {right.same_as}")
    return problems


def all_notes(motion: motionary.Motion) -> tuple[str, ...]:
    """Notes of the reader, and of the mapping of joints, as `info` lists them."""
    own = motion.mapping.note if motion.mapping is not None else ""
    return (*motion.notes, own) if own else motion.notes


def _are_equal(a: Any, b: Any, unknown: tuple[tuple[int, str], ...], names: Any) -> bool:
    if a.shape != b.shape:
        return False
    looked_at = np.ones(a.shape[:2], dtype=bool)
    for frame, name in unknown:
        looked_at[frame, slice(None) if name == "*" else names.index(name)] = False
    return bool(np.allclose(a[looked_at], b[looked_at], atol=1e-6, equal_nan=True))


def _number_problems(motion: motionary.Motion, right: Read) -> list[str]:
    problems = []
    for what, got, wanted in (
        ("frames", motion.n_frames, right.frames),
        ("joints", len(motion.names), right.joints),
    ):
        if wanted is not None and got != wanted:
            problems.append(f"{got} {what}, right are {wanted}")
    if right.rate_hz is not None and not np.isclose(motion.rate_hz, right.rate_hz, rtol=2e-4):
        problems.append(f"{motion.rate_hz:g} Hz, right is {right.rate_hz:g} Hz")
    if right.features is not None:
        known = (
            0
            if motion.mapping is None
            else int(compute_features(motion).known_features.any(axis=0).sum())
        )
        if known < right.features:
            problems.append(f"{known} features known, right are {right.features} or more")
    if right.generic:
        weights = {} if motion.mapping is None else motion.mapping.weights
        lacking = [joint for joint in right.generic if joint not in weights]
        problems += [f"no {', '.join(lacking)}"] if lacking else []
    return problems


def _size_problems(motion: motionary.Motion, right: Read) -> list[str]:
    places = motion.positions
    measured: list[tuple[str, float, tuple[float, float] | None]] = [
        ("leg", _leg(motion) if right.leg_m else np.nan, right.leg_m),
        (
            "height",
            float(np.nanmax(places[..., 1]) - np.nanmin(places[..., 1]))
            if right.height_m
            else np.nan,
            right.height_m,
        ),
        (
            "height of the root",
            float(np.nanmedian(places[:, 0, 1])) if right.root_m else np.nan,
            right.root_m,
        ),
    ]
    problems = [
        f"{what} of {size:.3g} m, right is {limits}"
        for what, size, limits in measured
        if limits is not None and not limits[0] <= size <= limits[1]
    ]
    if right.farthest_m is not None and not np.nanmax(np.abs(places)) <= right.farthest_m:
        problems.append(f"places {np.nanmax(np.abs(places)):.3g} m away")
    if right.upper is not None and right.lower is not None:
        upper, lower = (places[:, motion.names.index(n), 1] for n in (right.upper, right.lower))
        if not (upper > lower).all():
            problems.append(f"{right.upper} is not above {right.lower}")
    return problems


def _leg(motion: motionary.Motion) -> float:
    """The longer leg's median length; one of a body that collapsed is no measure."""
    if motion.mapping is None:
        return float("nan")
    body = motion.generic_positions()
    lengths = []
    for side in "lr":
        a, b, c = (body[:, GENERIC_JOINTS.index(side + j)] for j in ("hip", "knee", "ankle"))
        lengths.append(np.linalg.norm(a - b, axis=1) + np.linalg.norm(b - c, axis=1))
    return float(np.nanmax(np.nanmedian(lengths, axis=1)))
