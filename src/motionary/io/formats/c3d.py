"""C3D files: reading markers and events; see `c3d_writing` for writing and cutting.

Conventions: positions become metres with y up. A point is not seen in a frame where its
residual is negative, its coordinates are all exactly zero, or one of them is no number.
Points that are no places (angles, forces, moments, powers) and unlabelled ones (`*0`) are
left out. Event times in a file run from its frame 1; here from the first frame.

A reader of our own, checked against ezc3d: that one takes 0.6 GB for nine minutes, stops
counting at 65535 frames without a word, and of 190 damaged files crashed on one and did not
come back from three.
"""

import re
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput, MotionaryError, UnreadableFile
from motionary.files import describe_opening, open_regular
from motionary.io.formats.c3d_head import LONGEST_HEAD, MOST_LABELS, Head, parse_head
from motionary.io.formats.c3d_layout import Layout, Points, find_layout, read_segments, read_table
from motionary.io.formats.content import (
    MOST_RATE_HZ,
    POINT_UNITS,
    RATE_HINT,
    FileContent,
    hide_sentinels,
    name_some,
    names_file,
    number_doubles,
)
from motionary.io.normalise.axes import check_up
from motionary.io.normalise.units import NAMES_OF_UNITS, FileMetadata
from motionary.io.options import ReadOptions
from motionary.motion import Event
from motionary.rotations import Floats

# Frames that are converted together.
_TOGETHER = 2048

_VALUE_GROUPS = ("ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS", "REACTIONS")
_PLACE_GROUPS = ("MODELED_MARKERS", "BONES")
_VALUE_NAME = re.compile(
    r"(angles?|moments?|forces?|powers?|torques?|GRF|GRM|progress)\d*$", re.IGNORECASE
)
_VALUE_WORDS = re.compile(r"\b(angles|moments?|powers?|forces?|torques?)\b", re.IGNORECASE)
_VALUE_UNITS = re.compile(r"(deg|rad|N|N\W?m+|Nmm?|W)\b(/kg)?$", re.IGNORECASE)
# Later events are none.
_LATEST_S = 1e9
_SIDES = {"left": "left", "right": "right", "l": "left", "r": "right"}


@names_file
def read_c3d(path: Path, options: ReadOptions) -> FileContent:
    """Points and events of a C3D file; of one without points the places of its segments."""
    with open_regular(path) as file:
        try:
            return _read_content(file, options)
        except MotionaryError:
            raise
        except OSError as error:
            raise UnreadableFile(describe_opening(error), file=path) from error


def _read_content(file: BinaryIO, options: ReadOptions) -> FileContent:
    head = parse_head(file.read(LONGEST_HEAD))
    rate = _rate(head) if options.rate_hz is None else options.rate_hz
    units = head.texts("POINT", "UNITS")
    unit = NAMES_OF_UNITS.get(units[0].lower()) if units else None
    points = _read_points(file, head, trust=bool(options.trust_points))
    subjects = head.count("SUBJECTS", "USED", len(head.texts("SUBJECTS", "NAMES")))
    return FileContent(
        names=points.names,
        positions=points.positions,
        rate_hz=rate,
        metadata=FileMetadata(unit, _stated_up(head), "mm", "z", POINT_UNITS),
        first_frame=points.first_frame,
        events=_read_events(head, points.first_frame, rate),
        notes=(*points.notes, *[f"{subjects} subjects in the file"][: subjects > 1]),
    )


def _read_points(file: BinaryIO, head: Head, *, trust: bool) -> Points:
    counts = (head.header.n_points, head.count("POINT", "USED", 0))
    if not any(counts):
        if head.count("ROTATION", "USED", 0):
            return read_segments(file, head)
        raise UnreadableFile("holds no points (analog signals only?)")
    layout, notes = find_layout(file, head)
    kept, names, left_out = _choose_points(head, layout.n_points)
    positions, distrusted = _read_positions(file, head, layout, kept, trust=trust)
    seen = ~np.isnan(positions[..., 0]).all(axis=0)
    if distrusted.any() and not seen.any():
        raise UnreadableFile(
            "every point is marked unseen (residual -1), though places are there; "
            "--trust-points (trust_points=True) reads them"
        )
    marked = [names[i] for i in np.flatnonzero(distrusted & ~seen)]
    if marked:
        notes.append(
            f"{len(marked)} points are marked unseen throughout, though places are there "
            f"({name_some(marked)}); --trust-points (trust_points=True) reads them"
        )
    notes += hide_sentinels(positions, names)
    return Points(names, positions, layout.first_frame, (*notes, *left_out))


def _choose_points(head: Head, n_points: int) -> tuple[list[int], list[str], list[str]]:
    """Places and names of the points that are places and have a name, and notes."""
    more = [f"LABELS{i}" for i in range(2, 2 + n_points // MOST_LABELS)]
    labels = head.texts("POINT", "LABELS", *more)[:n_points]
    values = _value_points(head, labels)
    kept = [
        i
        for i, label in enumerate(labels)
        if label and not _bare(label).startswith("*") and i not in values
    ]
    some = name_some([labels[i] for i in sorted(values)])
    if not kept and values:
        raise UnreadableFile(
            f"holds angles, forces, moments or powers ({some}) and no places; export its markers"
        )
    if not kept:
        raise UnreadableFile(f"none of its {n_points} points has a name")
    notes = []
    if values:
        notes.append(
            f"{len(values)} of {n_points} points are angles, forces, moments or powers and "
            f"left out ({some})"
        )
    unlabelled = n_points - len(kept) - len(values)
    if unlabelled:
        notes.append(f"{unlabelled} of {n_points} points have no label and are left out")
    return kept, number_doubles([labels[i] for i in kept]), notes


def _value_points(head: Head, labels: tuple[str, ...]) -> set[int]:
    """Points that are no places, by parameter group, name, description or unit."""
    groups = {*_VALUE_GROUPS, *(g.upper() for g in head.texts("POINT", "TYPE_GROUPS"))}
    listed = {
        text
        for group in sorted(groups - {*_PLACE_GROUPS})
        for text in head.texts("POINT", group, f"{group}2")
    }
    described = head.texts("POINT", "DESCRIPTIONS")
    units = head.texts("POINT", "UNITS")
    found = set()
    for i, label in enumerate(labels):
        by_name = label in listed or _bare(label) in listed or _VALUE_NAME.search(_bare(label))
        by_packed = i < len(described) and _VALUE_WORDS.search(described[i])
        by_unit = len(units) > 1 and i < len(units) and _VALUE_UNITS.match(units[i])
        if by_name or by_packed or by_unit:
            found.add(i)
    return found


def _bare(label: str) -> str:
    """The label without the person's prefix."""
    return label.rpartition(":")[2]


def _read_positions(
    file: BinaryIO, head: Head, layout: Layout, kept: list[int], *, trust: bool
) -> tuple[Floats, NDArray[np.bool_]]:
    """Positions of the kept points in file units, and which of them have unseen places.

    Returns
    -------
    positions : array, shape (frames, points, 3); NaN = not seen
    distrusted : array, shape (points,); whether places are marked unseen that are there
    """
    positions = np.empty((layout.n_frames, len(kept), 3))
    distrusted = np.zeros(len(kept), dtype=np.bool_)
    file.seek(layout.start)
    for start in range(0, layout.n_frames, _TOGETHER):
        n = min(_TOGETHER, layout.n_frames - start)
        table = read_table(file, head, layout, n)[:, kept]
        places = table[..., :3] if layout.scale < 0 else table[..., :3] * layout.scale
        x, y, z = np.moveaxis(places, 2, 0)
        absent = ((x == 0) & (y == 0) & (z == 0)) | np.isnan(x + y + z)
        # The fourth number holds residual and cameras; negative: not seen.
        marked = table[..., 3] < 0
        distrusted |= (marked & ~absent).any(axis=0)
        unseen = absent if trust else absent | marked
        positions[start : start + n] = places
        positions[start : start + n][unseen] = np.nan
    return positions, distrusted


def _rate(head: Head) -> float:
    rate = head.number("POINT", "RATE", 0.0)
    rate = rate if rate > 0 else head.header.rate_hz
    if not 0 < rate < MOST_RATE_HZ:
        raise UnreadableFile(f"says {rate:g} frames per second; {RATE_HINT}")
    # 32-bit floats: 59.94 is written as 59.9399986.
    return float(np.format_float_positional(np.float32(rate)))


def _stated_up(head: Head) -> str | None:
    """The vertical axis of the screen, which is the one that points up.

    Qualisys writes -X and -Z for x and z: of its signs, none counts.
    """
    axis = (*head.texts("POINT", "Y_SCREEN"), "")[0]
    makers = head.texts("MANUFACTURER", "COMPANY", "SOFTWARE")
    if any("qualisys" in maker.lower() for maker in makers):
        axis = axis.lstrip("+-")
    try:
        return check_up(axis)
    except InvalidInput:
        return None


def _read_events(head: Head, first_frame: int, rate_hz: float) -> tuple[Event, ...]:
    labels = head.texts("EVENT", "LABELS", "LABELS2")
    sides = head.texts("EVENT", "CONTEXTS", "CONTEXTS2")
    times = head.numbers("EVENT", "TIMES")
    before = (first_frame - 1) / rate_hz
    if len(times) % 2 and labels:
        raise UnreadableFile(
            f"EVENT:TIMES has {len(times)} numbers; expected minutes and seconds of each "
            "event; remove the group EVENT or correct it"
        )
    if len(labels) and len(times) >= 2 * len(labels):
        # Minutes and seconds of the first event, of the second ...: flat in that sequence.
        value = head.groups["EVENT"]["TIMES"]
        minutes, seconds = np.asarray(value, dtype=np.float64).reshape(2, -1)[:, : len(labels)]
        at = 60 * minutes + seconds - before
        found = [
            Event(label, _SIDES.get(side.lower(), ""), float(t))
            for label, side, t in zip(labels, (*sides, *[""] * len(labels)), at, strict=False)
        ]
    else:
        found = [Event(label, "", t - before) for label, t in head.header.events]
    # Comparing with NaN is False.
    possible = (event for event in found if abs(event.time_s) < _LATEST_S)
    return tuple(sorted(possible, key=lambda event: event.time_s))
