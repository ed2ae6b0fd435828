"""Poses as lines of JSON: what a sender writes, and what `replay` writes.

A line is an object. The first one may say what all have in common: {"rate_hz": 60, "joints":
["Hips", ...]}, or "skeleton" instead of "joints". Every other one is a pose: {"positions":
[[x, y, z], ...]} in the sequence of the joints, metres, y up, null for a joint that is not seen;
or {"joints": {"Hips": [x, y, z], ...}}. "time_s" and "person" may stand beside them.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from motionary.errors import InvalidInput
from motionary.features.body import Floats
from motionary.motion import Motion

_SHOWN = 60


@dataclass(frozen=True, slots=True)
class Pose:
    """One pose of one person.

    Attributes
    ----------
    joints : names of the joints, or a known skeleton's name; None for the 24 generic joints
    positions : array, shape (joints, 3), NaN where a joint is not seen
    time_s : by the sender's clock; None if it has none
    person : empty where there is one
    """

    joints: str | tuple[str, ...] | None
    positions: Floats
    time_s: float | None = None
    person: str = ""


@dataclass(slots=True)
class PoseLines:
    """Poses from lines of JSON.

    Attributes
    ----------
    rate_hz : poses per second, as the first line or the caller says; None if unknown
    joints : as of `Pose`, where poses have no names of their own
    """

    rate_hz: float | None = None
    joints: str | tuple[str, ...] | None = None

    def read(self, line: str | bytes) -> Pose | None:
        """The pose of a line; None of one that is empty, or says what poses have in common.

        Raises
        ------
        InvalidInput
            If it is no such line: what was expected, and its beginning.
        """
        text = line.decode("utf-8", "replace") if isinstance(line, bytes) else line
        if not text.strip():
            return None
        try:
            content = json.loads(text)
        except (ValueError, RecursionError):
            raise InvalidInput(f"a line must be one JSON object, got {text[:_SHOWN]!r}") from None
        if not isinstance(content, dict):
            raise InvalidInput(f"a line must be one JSON object, got {text[:_SHOWN]!r}")
        if "positions" not in content and not isinstance(content.get("joints"), dict):
            self._read_head(content, text)
            return None
        time_s = content.get("time_s")
        if time_s is not None and not _is_number(time_s):
            raise InvalidInput(f"time_s must be a number of seconds, got {str(time_s)[:_SHOWN]!r}")
        person = str(content.get("person", ""))[:_SHOWN]
        if "positions" in content:
            return Pose(self.joints, _as_positions(content["positions"]), time_s, person)
        named: dict[str, Any] = content["joints"]
        if not named:
            raise InvalidInput("a pose needs at least one joint, got none")
        if not isinstance(self.joints, tuple):
            self.joints = tuple(named)
        new = [name for name in named if name not in self.joints]
        if new:
            raise InvalidInput(
                f"joint {new[0][:_SHOWN]!r} was not among those of the first pose; a first line "
                'with "joints" names all of them, and poses may then leave some out'
            )
        rows = [named.get(name) for name in self.joints]
        return Pose(self.joints, _as_positions(rows), time_s, person)

    def _read_head(self, content: Mapping[str, Any], text: str) -> None:
        if not {"rate_hz", "joints", "skeleton"} & content.keys():
            raise InvalidInput(
                'a line must be a pose, with "positions" or "joints", or say "rate_hz", "joints" '
                f'or "skeleton" of all, got {text[:_SHOWN]!r}'
            )
        rate_hz, names = content.get("rate_hz"), content.get("joints")
        if rate_hz is not None:
            if not _is_number(rate_hz) or not 1 <= rate_hz < 10_000:
                raise InvalidInput(
                    f"rate_hz must be a number from 1 on, got {str(rate_hz)[:_SHOWN]!r}"
                )
            self.rate_hz = float(rate_hz)
        if isinstance(names, list) and names and all(isinstance(name, str) for name in names):
            self.joints = tuple(names)
        elif names is not None:
            raise InvalidInput('"joints" must be a list of names, or the positions by their names')
        elif isinstance(content.get("skeleton"), str):
            self.joints = content["skeleton"]


def write_lines(motion: Motion) -> Iterator[str]:
    """A recording as lines of JSON, the first of what all poses have in common."""
    head = {"recording": motion.source, "rate_hz": motion.rate_hz, "joints": list(motion.names)}
    yield json.dumps(head)
    for i, pose in enumerate(np.round(motion.positions, 5)):
        rows = [None if np.isnan(joint).any() else joint.tolist() for joint in pose]
        yield json.dumps({"time_s": round(i / motion.rate_hz, 6), "positions": rows})


def _as_positions(rows: Any) -> Floats:
    if not isinstance(rows, Sequence) or isinstance(rows, str) or not rows:
        raise InvalidInput("positions must be a list with [x, y, z] or null for each joint")
    positions = np.full((len(rows), 3), np.nan)
    for i, row in enumerate(rows):
        if row is None:
            continue
        if not (isinstance(row, list) and len(row) == 3 and all(map(_is_number_or_null, row))):
            raise InvalidInput(
                f"a position must be [x, y, z] in metres or null, got {str(row)[:_SHOWN]!r}"
            )
        if None not in row:
            positions[i] = row
    return positions


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < 1e9


def _is_number_or_null(value: Any) -> bool:
    return value is None or _is_number(value)
