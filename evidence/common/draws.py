"""Which clips are learned from, if only a few are to be had?"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from evidence.common.recordings import ACTORS, Clip, Recordings


class Draw(NamedTuple):
    """A few clips of each class to learn from, and others to test on."""

    train: tuple[Clip, ...]
    test: tuple[Clip, ...]


def few(pool: Sequence[Clip], n: int, rng: np.random.Generator) -> tuple[Clip, ...]:
    """`n` clips of each class, fewer where there are not so many, in their order."""
    classes = sorted({clip.motion_class for clip in pool})
    chosen: list[Clip] = []
    for name in classes:
        own = [clip for clip in pool if clip.motion_class == name]
        chosen += [own[i] for i in sorted(rng.permutation(len(own))[:n])]
    return tuple(chosen)


def from_half(recordings: Recordings, n: int, *, repeats: int, seed: int) -> list[Draw]:
    """Of the training half, whoever the actors; the same people are tested on."""
    train, test = recordings.halves()
    return [Draw(few(train, n, _rng(seed, 0, n, i)), test) for i in range(repeats)]


def from_others(recordings: Recordings, n: int, *, repeats: int, seed: int) -> list[Draw]:
    """Of four actors, tested on the fifth; each actor in turn."""
    return [
        Draw(
            few(recordings.of(actors=set(ACTORS) - {actor}), n, _rng(seed, 1, n, i, a)),
            recordings.of(actors=[actor]),
        )
        for a, actor in enumerate(ACTORS)
        for i in range(repeats)
    ]


def from_one(recordings: Recordings, n: int, *, repeats: int, seed: int) -> list[Draw]:
    """Of one actor alone, tested on the other four; each actor in turn."""
    return [
        Draw(
            few(recordings.of(actors=[actor]), n, _rng(seed, 2, n, i, a)),
            recordings.of(actors=set(ACTORS) - {actor}),
        )
        for a, actor in enumerate(ACTORS)
        for i in range(repeats)
    ]


def spread(values: Sequence[float]) -> dict[str, Any]:
    """Mean, standard deviation and extremes of repetitions."""
    array = np.array(values)
    return {
        "mean": array.mean(),
        "deviation": array.std(ddof=1) if len(array) > 1 else 0.0,
        "least": array.min(),
        "most": array.max(),
        "repetitions": len(array),
    }


def _rng(seed: int, *more: int) -> np.random.Generator:
    return np.random.default_rng([seed, *more])
