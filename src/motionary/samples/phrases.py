"""How is a motion told in a few lines, and which angles do they give over time?

A line says what a stretch of time brings, comma by comma: a part of the body, a direction
and where it arrives at the end of the stretch.

    0.0-0.7 s: hips 105, knees 115, ankles 40, root pitch 30, shoulders 75
    1.0-1.7 s: hips 0, knees 0, ankles 0, root pitch 0, shoulders 0

`left knee`, `right knee` or `knees`; without a direction a part bends. Angles are degrees
from an upright stand with hanging arms and stay where they are until a later line moves
them. `aside` is away from the body, `twist` of a limb is outward, of the trunk to the
left, as `turn` and `lean` are. The root moves `up` and `forward` in metres; `turn` and
`forward` count from where the stretch began.
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

PAIRED_PARTS = ("hip", "knee", "ankle", "shoulder", "elbow")
DIRECTIONS = {
    "hip": ("bend", "aside", "twist"),
    "knee": ("bend",),
    "ankle": ("bend",),
    "shoulder": ("bend", "aside", "twist"),
    "elbow": ("bend",),
    "spine": ("bend", "lean", "twist"),
    "neck": ("bend", "twist"),
    "root": ("turn", "pitch", "roll", "up", "forward"),
}
RELATIVE = ("root turn", "root forward")

_LINE = re.compile(r"([\d.]+)\s*-\s*([\d.]+) s:(.+)")


class Target(NamedTuple):
    """Where a channel ("lknee bend", "root up") arrives: degrees, or metres of the root."""

    channel: str
    value: float


@dataclass(frozen=True, slots=True)
class Phrase:
    """What a stretch of time brings."""

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
        targets = [target for packed in match[3].split(",") for target in _parse_targets(packed)]
    except ValueError as error:
        raise InvalidInput(f"{error}, in {line!r}") from None
    if not start_s < end_s:
        raise InvalidInput(f"a phrase must start before it ends, got {line!r}")
    return Phrase(start_s, end_s, tuple(targets))


def _parse_targets(text: str) -> list[Target]:
    """Targets of "left knee 90" (one) or "shoulders aside 170" (two)."""
    packed = text.split()
    sides: tuple[str, ...] = ("l", "r")
    if packed and packed[0] in ("left", "right"):
        sides = (packed.pop(0)[0],)
    part = packed.pop(0) if packed else ""
    if len(sides) == 2 and part in (f"{paired}s" for paired in PAIRED_PARTS):
        part = part[:-1]
    elif (len(sides) == 1) != (part in PAIRED_PARTS) or part not in DIRECTIONS:
        raise InvalidInput(
            f"expected 'left', 'right' or a plural with one of {', '.join(PAIRED_PARTS)}, "
            f"or spine, neck, root, got {text.strip()!r}"
        )
    direction = packed.pop(0) if len(packed) == 2 else "bend"
    if direction not in DIRECTIONS[part] or len(packed) != 1:
        raise InvalidInput(
            f"expected a direction of {part} ({', '.join(DIRECTIONS[part])}) and a number, "
            f"got {text.strip()!r}"
        )
    value = float(packed[0])
    if not math.isfinite(value):
        raise InvalidInput(f"expected a finite number, got {text.strip()!r}")
    if part not in PAIRED_PARTS:
        return [Target(f"{part} {direction}", value)]
    return [Target(f"{side}{part} {direction}", value) for side in sides]


def shift(phrases: Sequence[Phrase], seconds: float) -> tuple[Phrase, ...]:
    """The same phrases so many seconds later."""
    return tuple(replace(p, start_s=p.start_s + seconds, end_s=p.end_s + seconds) for p in phrases)


def end_of(phrases: Sequence[Phrase]) -> float:
    """When the last phrase ends, in seconds."""
    return max(phrase.end_s for phrase in phrases)


def vary(
    phrases: Sequence[Phrase], rng: np.random.Generator, *, tempo: float, amplitude: float
) -> tuple[Phrase, ...]:
    """The same motion by somebody else: faster here, slower there, wider or narrower.

    Parameters
    ----------
    tempo : spread of the logarithm of the whole tempo; half of it for single stretches
    amplitude : spread of the factor that a phrase's targets are multiplied with; a third
        of it for single parts, a tenth for their sides
    """
    times = np.unique([0.0, *(t for p in phrases for t in (p.start_s, p.end_s))])
    factors = np.exp(rng.normal(0, tempo) + rng.normal(0, tempo / 2, len(times) - 1))
    warped = np.concatenate([[0.0], np.cumsum(np.diff(times) * factors)])
    moved = dict(zip(times.tolist(), warped.tolist(), strict=True))
    return tuple(
        Phrase(
            moved[phrase.start_s],
            moved[phrase.end_s],
            _scale(phrase.targets, rng, amplitude),
        )
        for phrase in phrases
    )


def _scale(
    targets: Sequence[Target], rng: np.random.Generator, amplitude: float
) -> tuple[Target, ...]:
    whole = 1 + rng.normal(0, amplitude)
    parts: dict[str, float] = {}
    scaled = []
    for channel, value in targets:
        both_sides = channel if channel.split()[0] in DIRECTIONS else channel[1:]
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
            step = value if channel in RELATIVE else value - before
            result[channel] = result.get(channel, np.zeros(len(times))) + step * eased
            now[channel] = (phrase.end_s, before + step)
    return result
