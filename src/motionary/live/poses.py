"""Poses as lines of JSON, as senders and `replay` write them, and at even times.

A line is an object. The first one may say what all have in common: {"rate_hz": 60, "joints":
["Hips", ...]}, or "skeleton" instead of "joints". Every other one is a pose: {"positions":
[[x, y, z], ...]} in the sequence of the joints, metres, y up, null for a joint that is not seen;
or {"joints": {"Hips": [x, y, z], ...}}. "time_s" and "person" may stand beside them.

Conventions: times in seconds of the sender's clock; even times count from the first one.
"""

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from motionary.errors import InvalidInput
from motionary.features.body import Floats
from motionary.motion import Motion

#: No pose is longer, in characters.
LONGEST_LINE = 100_000
_SHOWN = 60
# Seconds since 1970 are such times; milliseconds since then are not.
_LAST_S, _FARTHEST_M = 1e11, 1e9

#: Positions that are farther apart in time leave a gap between them.
MOST_GAP_S = 0.25
#: Two poses of one recording are not farther apart: a gap fills memory, and time.
MOST_JUMP_S = 60.0
# A time so near to an even one is that one: clocks round to microseconds, and seconds since
# 1970 have no more digits.
_SLACK_S = 1e-6


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
        """The pose of a line; None of an empty one, and of one on all poses.

        Raises
        ------
        InvalidInput
            If it is no such line: what was expected, and its beginning.
        """
        text = line.decode("utf-8", "replace") if isinstance(line, bytes) else line
        # Some programs begin a file with a mark of its encoding.
        text = text.strip().removeprefix("\ufeff")
        if not text:
            return None
        if len(line) > LONGEST_LINE:
            raise InvalidInput(f"a line of a pose has at most {LONGEST_LINE} characters, got more")
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
        if time_s is not None and not _is_number(time_s, _LAST_S):
            raise InvalidInput(f"time_s must be a number of seconds, got {_shown(time_s)}")
        person = _as_person(content.get("person"))
        if "positions" in content:
            positions = _as_positions(content["positions"])
        else:
            positions = self._read_named(content["joints"])
        return Pose(self.joints, positions, time_s, person)

    def _read_named(self, named: Mapping[str, Any]) -> Floats:
        """Positions by the names of joints, in the order of the first pose."""
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
        return _as_positions([named.get(name) for name in self.joints])

    def _read_head(self, content: Mapping[str, Any], text: str) -> None:
        if not {"rate_hz", "joints", "skeleton"} & content.keys():
            raise InvalidInput(
                'a line must be a pose, with "positions" or "joints", or say "rate_hz", "joints" '
                f'or "skeleton" of all, got {text[:_SHOWN]!r}'
            )
        rate_hz, names = content.get("rate_hz"), content.get("joints")
        if rate_hz is not None:
            if not _is_number(rate_hz, _FARTHEST_M) or not 1 <= rate_hz < 10_000:
                raise InvalidInput(f"rate_hz must be a number from 1 on, got {_shown(rate_hz)}")
            self.rate_hz = float(rate_hz)
        if isinstance(names, list) and names and all(isinstance(name, str) for name in names):
            self.joints = tuple(names)
        elif names is not None:
            raise InvalidInput('"joints" must be a list of names, or the positions by their names')
        elif "skeleton" in content:
            if not isinstance(content["skeleton"], str):
                raise InvalidInput('"skeleton" must be a name, as "smpl"')
            self.joints = content["skeleton"]


class EvenTimes:
    """Positions at an even rate, a straight line between neighbours in time.

    Parameters
    ----------
    rate_hz : of the positions that come out
    """

    REMEMBERED = ("_first_s", "_last_s", "_last", "_n_given")

    def __init__(self, rate_hz: float) -> None:
        self.rate_hz = rate_hz
        self._first_s: float | None = None
        self._last_s = -math.inf
        self._last: Floats = np.empty(0)
        self._n_given = 0

    def push(self, positions: Floats, times_s: Floats) -> Floats:
        """Positions at the even times up to the last of these, shape (new frames, ...).

        Parameters
        ----------
        positions : array, shape (frames, joints, 3), NaN = not seen
        times_s : array, shape (frames,)

        Raises
        ------
        InvalidInput
            If a time is not a number, not later than the one before, or so much later that
            it is another recording's; nothing is kept then.
        """
        before = np.concatenate([[self._last_s], times_s[:-1]])
        if not np.isfinite(times_s).all() or not (times_s > before).all():
            wrong = np.flatnonzero(~(np.isfinite(times_s) & (times_s > before)))[0]
            raise InvalidInput(
                f"times must grow, got {times_s[wrong]} s after {before[wrong]} s: is the sender's "
                "clock going backwards? A new recording needs a new annotator"
            )
        if len(times_s) == 0:
            return positions
        jumps = np.diff(times_s, prepend=times_s[0] if self._first_s is None else self._last_s)
        if jumps.max() > MOST_JUMP_S:
            raise InvalidInput(
                f"times must be seconds, at most {MOST_JUMP_S:g} s apart, got poses that are "
                f"{jumps.max():g} s apart; a new recording needs a new annotator"
            )
        if self._first_s is None:
            self._first_s = float(times_s[0])
        else:
            positions = np.concatenate([self._last[np.newaxis], positions])
            times_s = np.concatenate([[self._last_s], times_s])
        self._last, self._last_s = positions[-1], float(times_s[-1])
        elapsed = (times_s - self._first_s) * self.rate_hz
        slack = _SLACK_S * self.rate_hz
        numbers = np.arange(self._n_given, math.floor(elapsed[-1] + slack) + 1)
        self._n_given += len(numbers)
        if len(times_s) == 1:
            return positions[: len(numbers)]
        right = np.clip(np.searchsorted(elapsed, numbers - slack), 1, len(elapsed) - 1)
        span = (elapsed[right] - elapsed[right - 1])[:, np.newaxis, np.newaxis]
        along = (numbers - elapsed[right - 1])[:, np.newaxis, np.newaxis] / span
        is_right = (numbers > elapsed[right - 1]) & (elapsed[right] - numbers <= slack)
        along[is_right] = 1.0
        along = np.clip(along, 0.0, 1.0)
        low, high = positions[right - 1], positions[right]
        between = np.where(span > MOST_GAP_S * self.rate_hz, np.nan, low + along * (high - low))
        return np.where(along <= 0, low, np.where(along >= 1, high, between))


def write_lines(motion: Motion) -> Iterator[str]:
    """A recording as lines of JSON, the first of what all poses have in common."""
    head = {"recording": motion.source, "rate_hz": motion.rate_hz, "joints": list(motion.names)}
    yield json.dumps(head)
    for i, pose in enumerate(np.round(motion.positions, 5)):
        rows = [None if np.isnan(joint).any() else joint.tolist() for joint in pose]
        yield json.dumps({"time_s": round(i / motion.rate_hz, 6), "positions": rows})


def _as_person(name: Any) -> str:
    """Name of a person; that of two people must not become one by being cut."""
    if name is None:
        return ""
    if isinstance(name, bool) or not isinstance(name, str | int):
        raise InvalidInput(f"person must be a name or a number, got {_shown(name)}")
    if len(text := str(name)) > _SHOWN:
        raise InvalidInput(f"person must have at most {_SHOWN} characters, got {len(text)}")
    return text


def _as_positions(rows: Any) -> Floats:
    if not isinstance(rows, list) or not rows:
        raise InvalidInput("positions must be a list with [x, y, z] or null for each joint")
    positions = np.full((len(rows), 3), np.nan)
    for i, row in enumerate(rows):
        if row is None:
            continue
        if not (isinstance(row, list) and len(row) == 3 and all(map(_is_coordinate, row))):
            raise InvalidInput(f"a position must be [x, y, z] in metres or null, got {_shown(row)}")
        if None not in row and not any(map(math.isnan, row)):
            positions[i] = row
    return positions


def _is_number(value: Any, limit: float) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < limit


def _is_coordinate(value: Any) -> bool:
    """Whether it is one, or NaN or null: some write what is not seen so."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return True
    return _is_number(value, _FARTHEST_M)


def _shown(value: Any) -> str:
    return repr(str(value)[:_SHOWN])
