"""How do synthetic motions of one class come to differ?

A seed draws a figure (its proportions, how it stands and sways) and how it moves: tempo
and amplitudes around those of the phrases. The same seed gives the same motion.
"""

import zlib
from collections.abc import Sequence

import numpy as np

from motionary.errors import InvalidInput
from motionary.motion import Motion
from motionary.samples.classes import PHRASES
from motionary.samples.figure import Proportions, pose_figure
from motionary.samples.phrases import Floats, Phrase, curves, end_of, parse_phrases, shift, vary

TEMPO_SPREAD = 0.12
AMPLITUDE_SPREAD = 0.08

# How a figure stands: mean and spread of the angles, degrees.
_STAND = {
    "shoulder aside": (8.0, 2.0),
    "elbow bend": (12.0, 3.0),
    "hip aside": (3.0, 1.0),
}
_SWAYING = ("hip", "knee", "ankle", "shoulder", "elbow")
_SWAY_DEGREES = 0.8
_AROUND_S = (0.05, 0.15)
_PAUSE_S = (0.8, 1.6)

#: A stretch of a stream: name of the class, start and end in seconds.
Stretch = tuple[str, float, float]


def synthetic_motion(name: str, *, seed: int, rate_hz: float = 120.0) -> Motion:
    """One motion of a class, from an upright stand back to it.

    Parameters
    ----------
    name : one of `SYNTHETIC_CLASSES`
    seed : whole number, at least 0; another one gives another figure and performance
    rate_hz : frames per second

    Returns
    -------
    Motion of 24 joints that says in source and notes that it is synthetic

    Raises
    ------
    InvalidInput
        If there is no such class, or the seed is negative.
    """
    rng = _generator(seed, name)
    before, after = rng.uniform(*_AROUND_S, 2).tolist()
    phrases = shift(_performance(name, rng), before)
    duration_s = end_of(phrases) + after
    return _perform(phrases, duration_s, rng, rate_hz, f"synthetic {name} {seed}")


def synthetic_stream(
    names: Sequence[str], *, seed: int, rate_hz: float = 120.0
) -> tuple[Motion, list[Stretch]]:
    """One figure's motions one after the other, with standing pauses around them.

    Parameters
    ----------
    names : classes in sequence, each one of `SYNTHETIC_CLASSES`
    seed, rate_hz : as in `synthetic_motion`

    Returns
    -------
    motion : Motion
    labels : list of (name, start_s, end_s), in seconds from the first frame
    """
    rng = _generator(seed, " ".join(names))
    time_s = float(rng.uniform(*_PAUSE_S))
    phrases: list[Phrase] = []
    labels: list[Stretch] = []
    for name in names:
        motion = shift(_performance(name, rng), time_s)
        labels.append((name, time_s, end_of(motion)))
        phrases += motion
        time_s = end_of(motion) + float(rng.uniform(*_PAUSE_S))
    return _perform(phrases, time_s, rng, rate_hz, f"synthetic stream {seed}"), labels


def _generator(seed: int, text: str) -> np.random.Generator:
    if seed < 0:
        raise InvalidInput(f"a seed must be a whole number of at least 0, got {seed}")
    return np.random.default_rng([seed, zlib.crc32(text.encode())])


def _performance(name: str, rng: np.random.Generator) -> tuple[Phrase, ...]:
    if name not in PHRASES:
        raise InvalidInput(
            f"no synthetic class {name!r}; choose one of {', '.join(sorted(PHRASES))}"
        )
    phrases = parse_phrases(PHRASES[name])
    return vary(phrases, rng, tempo=TEMPO_SPREAD, amplitude=AMPLITUDE_SPREAD)


def _perform(
    phrases: Sequence[Phrase],
    duration_s: float,
    rng: np.random.Generator,
    rate_hz: float,
    source: str,
) -> Motion:
    if not 1.0 <= rate_hz <= 10_000.0:
        raise InvalidInput(f"rate_hz must lie between 1 and 10000, got {rate_hz}")
    size, legs, arms, trunk = 1 + rng.uniform(-1, 1, 4) * (0.1, 0.04, 0.04, 0.04)
    times = np.arange(max(2, round(duration_s * rate_hz))) / rate_hz
    angles = _standing(times, rng)
    for channel, curve in curves(phrases, times).items():
        angles[channel] = angles.get(channel, np.zeros(len(times))) + curve
    return pose_figure(angles, Proportions(size, legs, arms, trunk), rate_hz=rate_hz, source=source)


def _standing(times: Floats, rng: np.random.Generator) -> dict[str, Floats]:
    """Angles of a figure that stands, sways a little and faces anywhere, degrees."""
    angles = {f"{side}{part} bend": _sway(times, rng) for part in _SWAYING for side in "lr"}
    angles |= {f"spine {d}": _sway(times, rng) for d in ("bend", "lean", "twist")}
    for channel, (mean, spread) in _STAND.items():
        habit = rng.normal(mean, spread)
        for side in "lr":
            sway = angles.get(f"{side}{channel}", _sway(times, rng))
            angles[f"{side}{channel}"] = sway + habit + rng.normal(0, spread / 3)
    angles["root turn"] = np.full(len(times), rng.uniform(-180, 180))
    return angles


def _sway(times: Floats, rng: np.random.Generator) -> Floats:
    """A slow, small movement: two waves of 2 to 5 seconds."""
    periods = rng.uniform(2, 5, 2)
    phases = rng.uniform(0, 2 * np.pi, 2)
    waves: Floats = np.sin(2 * np.pi * times[:, None] / periods + phases).sum(axis=1)
    return _SWAY_DEGREES / 2 * waves
