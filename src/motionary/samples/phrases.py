"""Motions written in a few lines, the angles that they give, and the synthetic classes.

A line says what a segment of time brings, comma by comma: a part of the body, a direction
and where it arrives at the end of the segment.

    0.0-0.7 s: hips 105, knees 115, ankles 40, root pitch 30, shoulders 75
    1.0-1.7 s: hips 0, knees 0, ankles 0, root pitch 0, shoulders 0

`left knee`, `right knee` or `knees`; without a direction a part bends. Angles are degrees
from an upright stand with hanging arms and stay where they are until a later line moves
them. `aside` is away from the body, `twist` of a limb is outward, of the trunk to the
left, as `turn` and `lean` are. The root moves `up` and `forward` in metres; `turn` and
`forward` count from where the segment began.

Every class starts and ends in an upright stand. The foot stays flat where
ankles = knees + root pitch - hips.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput

Floats = NDArray[np.float64]

_PAIRED_PARTS = ("hip", "knee", "ankle", "shoulder", "elbow")
_DIRECTIONS = {
    "hip": ("bend", "aside", "twist"),
    "knee": ("bend",),
    "ankle": ("bend",),
    "shoulder": ("bend", "aside", "twist"),
    "elbow": ("bend",),
    "spine": ("bend", "lean", "twist"),
    "neck": ("bend", "twist"),
    "root": ("turn", "pitch", "roll", "up", "forward"),
}
_RELATIVE = ("root turn", "root forward")

_LINE = re.compile(r"([\d.]+)\s*-\s*([\d.]+) s:(.+)")

_SQUAT = """
    0.0-0.7 s: hips 120, knees 130, ankles 40, root pitch 30, shoulders 80
    1.0-1.7 s: hips 0, knees 0, ankles 0, root pitch 0, shoulders 0
"""

_KICK = """
    0.0-0.3 s: {side} hip -20, {side} knee 45, {other} shoulder -10
    0.3-0.6 s: {side} hip 90, {side} knee 5, spine -10, {other} shoulder 45
    0.7-1.2 s: {side} hip 0, {side} knee 0, spine 0, {other} shoulder 0
"""

_RAISE_ARMS = """
    0.0-0.7 s: shoulders aside 165
    1.1-1.8 s: shoulders aside 0
"""

# Up in front of the body, down behind it.
_ROTATE_ARMS = """
    0.0-1.3 s: shoulders 360
"""

_JUMP = """
    0.0-0.4 s: hips 70, knees 85, ankles 40, root pitch 25, shoulders -45
    0.4-0.6 s: hips 0, knees 0, ankles -35, root pitch 0, shoulders 130
    0.55-0.8 s: root up 0.35
    0.8-1.05 s: root up 0.0
    0.8-1.0 s: ankles 0
    1.0-1.2 s: hips 50, knees 60, ankles 30, root pitch 20, shoulders 30
    1.2-1.6 s: hips 0, knees 0, ankles 0, root pitch 0, shoulders 0
"""

# A step: the thigh swings first, then the shank, the foot last, so that it clears the floor.
_WALK = """
    0.0-0.25 s: right hip 32, left shoulder 22, right shoulder -20
    0.0-0.18 s: right knee 65, right ankle 10
    0.22-0.4 s: right knee 3
    0.25-0.4 s: right ankle -25
    0.1-0.5 s: left hip -18, left ankle 16
    0.4-1.0 s: right hip -22, right ankle 18
    0.5-0.75 s: left hip 32, left shoulder -20, right shoulder 22
    0.5-0.68 s: left knee 65, left ankle 10
    0.72-0.9 s: left knee 3
    0.75-0.9 s: left ankle -25
    0.9-1.5 s: left hip -22, left ankle 18
    1.0-1.25 s: right hip 32, left shoulder 22, right shoulder -20
    1.0-1.18 s: right knee 65, right ankle 10
    1.22-1.4 s: right knee 3
    1.25-1.4 s: right ankle -25
    1.4-1.9 s: right hip 0, right ankle 0, right knee 0
    1.5-1.7 s: left hip 15, left knee 60, left ankle 15
    1.55-1.8 s: shoulders 0
    1.7-1.95 s: left hip 0, left knee 0, left ankle 0
"""

_BOW = """
    0.0-0.8 s: root pitch 75, hips 75, spine 25, neck 15
    1.2-2.0 s: root pitch 0, hips 0, spine 0, neck 0
"""

_PICK_UP = """
    0.0-0.9 s: root pitch 50, hips 108, knees 102, ankles 44, spine 30, {side} shoulder 75
    1.2-2.0 s: root pitch 0, hips 0, knees 0, ankles 0, spine 0, {side} shoulder 30, {side} elbow 80
    2.2-2.6 s: {side} shoulder 0, {side} elbow 0
"""

_WAVE = """
    0.0-0.5 s: {side} shoulder aside 95, {side} shoulder twist 85, {side} elbow 90
    0.5-0.75 s: {side} elbow 40
    0.75-1.0 s: {side} elbow 110
    1.0-1.25 s: {side} elbow 40
    1.25-1.5 s: {side} elbow 110
    1.5-2.0 s: {side} shoulder aside 0, {side} shoulder twist 0, {side} elbow 0
"""

_PUNCH = """
    0.0-0.35 s: shoulders 30, elbows 125, {other} hip 12, {other} ankle -12
    0.45-0.7 s: {side} shoulder 88, {side} elbow 5
    0.8-1.05 s: {side} shoulder 30, {side} elbow 125
    1.15-1.5 s: shoulders 0, elbows 0, {other} hip 0, {other} ankle 0
"""

_SPIN_LEFT = """
    0.0-0.4 s: shoulders aside 75, right hip -10, right knee 90
    0.2-1.4 s: root turn 360
    1.2-1.6 s: shoulders aside 0, right hip 0, right knee 0
"""

_JUMPING_JACK = """
    0.0-0.15 s: hips 25, knees 45, ankles 20
    0.15-0.35 s: hips 0, knees 0, ankles -20
    0.2-0.5 s: shoulders aside 150, hips aside 25
    0.25-0.4 s: root up 0.12
    0.4-0.55 s: root up 0.0
    0.5-0.6 s: ankles 0
    0.7-0.85 s: root up 0.12
    0.7-1.0 s: shoulders aside 0, hips aside 0
    0.85-1.0 s: root up 0.0
"""


class Target(NamedTuple):
    """End of a channel ("lknee bend", "root up"): degrees, or metres of the root."""

    channel: str
    value: float


@dataclass(frozen=True, slots=True)
class Phrase:
    """Targets that a segment of time arrives at."""

    start_s: float
    end_s: float
    targets: tuple[Target, ...]


def parse_phrases(text: str) -> tuple[Phrase, ...]:
    """Phrases of a text, one a line.

    Raises
    ------
    InvalidInput
        If a line is no phrase; the message quotes it.
    """
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    if not lines:
        raise InvalidInput("a motion needs at least one phrase, got an empty text")
    return tuple(_parse_line(line) for line in lines)


def _parse_line(line: str) -> Phrase:
    match = _LINE.fullmatch(line)
    if match is None:
        raise InvalidInput(f"expected '0.0-0.6 s: knees 90, ...', got {line!r}")
    try:
        start_s, end_s = float(match[1]), float(match[2])
        targets = [target for part in match[3].split(",") for target in _parse_targets(part)]
    except ValueError as error:
        raise InvalidInput(f"{error}, in {line!r}") from None
    if not start_s < end_s:
        raise InvalidInput(f"a phrase must start before it ends, got {line!r}")
    return Phrase(start_s, end_s, tuple(targets))


def _parse_targets(text: str) -> list[Target]:
    """Targets of "left knee 90" (one) or "shoulders aside 170" (two)."""
    terms = text.split()
    sides: tuple[str, ...] = ("l", "r")
    if terms and terms[0] in ("left", "right"):
        sides = (terms.pop(0)[0],)
    part = terms.pop(0) if terms else ""
    if len(sides) == 2 and part in (f"{paired}s" for paired in _PAIRED_PARTS):
        part = part[:-1]
    elif (len(sides) == 1) != (part in _PAIRED_PARTS) or part not in _DIRECTIONS:
        raise InvalidInput(
            f"expected 'left', 'right' or a plural with one of {', '.join(_PAIRED_PARTS)}, "
            f"or spine, neck, root, got {text.strip()!r}"
        )
    direction = terms.pop(0) if len(terms) == 2 else "bend"
    if direction not in _DIRECTIONS[part] or len(terms) != 1:
        raise InvalidInput(
            f"expected a direction of {part} ({', '.join(_DIRECTIONS[part])}) and a number, "
            f"got {text.strip()!r}"
        )
    value = float(terms[0])
    if not math.isfinite(value):
        raise InvalidInput(f"expected a finite number, got {text.strip()!r}")
    if part not in _PAIRED_PARTS:
        return [Target(f"{part} {direction}", value)]
    return [Target(f"{side}{part} {direction}", value) for side in sides]


def shift(phrases: Sequence[Phrase], seconds: float) -> tuple[Phrase, ...]:
    """The same phrases so many seconds later."""
    return tuple(replace(p, start_s=p.start_s + seconds, end_s=p.end_s + seconds) for p in phrases)


def end_of(phrases: Sequence[Phrase]) -> float:
    """End of the last phrase, in seconds."""
    return max(phrase.end_s for phrase in phrases)


def vary(
    phrases: Sequence[Phrase], rng: np.random.Generator, *, tempo: float, amplitude: float
) -> tuple[Phrase, ...]:
    """The same motion by somebody else: faster here, slower there, wider or narrower.

    Parameters
    ----------
    tempo : spread of the logarithm of the whole tempo; half of it for single segments
    amplitude : spread of the factor that a phrase's targets are multiplied with; a third
        of it for single parts, a tenth for their sides
    """
    times = np.unique([0.0, *(t for p in phrases for t in (p.start_s, p.end_s))])
    factors = np.exp(rng.normal(0, tempo) + rng.normal(0, tempo / 2, len(times) - 1))
    warped = np.concatenate([[0.0], np.cumsum(np.diff(times) * factors)])
    moved = dict(zip(times.tolist(), warped.tolist(), strict=True))
    return tuple(
        Phrase(moved[p.start_s], moved[p.end_s], _scale(p.targets, rng, amplitude)) for p in phrases
    )


def _scale(
    targets: Sequence[Target], rng: np.random.Generator, amplitude: float
) -> tuple[Target, ...]:
    whole = 1 + rng.normal(0, amplitude)
    parts: dict[str, float] = {}
    scaled = []
    for channel, value in targets:
        both_sides = channel if channel.split()[0] in _DIRECTIONS else channel[1:]
        part = parts.setdefault(both_sides, 1 + rng.normal(0, amplitude / 3))
        side = 1 + rng.normal(0, amplitude / 10)
        scaled.append(Target(channel, value * whole * part * side))
    return tuple(scaled)


def curves(phrases: Sequence[Phrase], times: Floats) -> dict[str, Floats]:
    """Value of each channel that the phrases name, over time.

    A channel starts at zero and moves to each target in turn, smoothly from rest to rest.

    Parameters
    ----------
    times : array, shape (frames,), seconds

    Returns
    -------
    dict of channel to array, shape (frames,), degrees or metres

    Raises
    ------
    InvalidInput
        If two phrases move a channel at the same time.
    """
    result: dict[str, Floats] = {}
    now: dict[str, tuple[float, float]] = {}
    for phrase in sorted(phrases, key=lambda p: p.start_s):
        fraction = np.clip((times - phrase.start_s) / (phrase.end_s - phrase.start_s), 0, 1)
        eased = fraction * fraction * (3 - 2 * fraction)
        for channel, value in phrase.targets:
            busy_until, before = now.get(channel, (0.0, 0.0))
            if busy_until > phrase.start_s + 1e-9:
                raise InvalidInput(f"two phrases move {channel!r} at once, at {phrase.start_s:g} s")
            step = value if channel in _RELATIVE else value - before
            result[channel] = result.get(channel, np.zeros(len(times))) + step * eased
            now[channel] = (phrase.end_s, before + step)
    return result


def _one_sided(text: str, side: str) -> str:
    return text.format(side=side, other="left" if side == "right" else "right")


PHRASES = {
    "squat": _SQUAT,
    "kick_left": _one_sided(_KICK, "left"),
    "kick_right": _one_sided(_KICK, "right"),
    "raise_arms": _RAISE_ARMS,
    "rotate_arms": _ROTATE_ARMS,
    "jump": _JUMP,
    "walk": _WALK,
    "bow": _BOW,
    "pick_up_right": _one_sided(_PICK_UP, "right"),
    "wave_right": _one_sided(_WAVE, "right"),
    "punch_right": _one_sided(_PUNCH, "right"),
    "spin_left": _SPIN_LEFT,
    "jumping_jack": _JUMPING_JACK,
}

SYNTHETIC_CLASSES = tuple(PHRASES)
