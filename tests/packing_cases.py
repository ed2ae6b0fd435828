"""Words made by hand: sequences, examples and streams without any motion behind them."""

import numpy as np

from motionary.features import FULL_BODY, SEQUENCE_HZ, FeatureSequence
from motionary.packing import pack
from motionary.recording import Recording

N = len(FULL_BODY)


def sequence(rows, known=None, *, feature_set=FULL_BODY, name="", **about) -> FeatureSequence:
    """Words of a matrix of relations (frames, features); all known unless told.

    `about` are further fields of its `Recording`.
    """
    rows = np.asarray(rows, dtype=np.bool_)
    known = np.ones_like(rows) if known is None else np.asarray(known, dtype=np.bool_)
    return FeatureSequence(pack(rows & known), pack(known), feature_set, Recording(name, **about))


def random_rows(seed, n_frames, *, n_features=N):
    """Relations that hold or not, independently: nothing in one resembles another."""
    return np.random.default_rng(seed).random((n_frames, n_features)) < 0.5


def stream(*parts, seed=0, pause=40):
    """Rows of the parts with random pauses around them, and where each part starts."""
    # Numbers of its own, so that no pause repeats what a test draws.
    rows, starts = [random_rows([7777, seed, 1], pause)], []
    for i, part in enumerate(parts, start=2):
        starts.append(sum(map(len, rows)))
        rows += [part, random_rows([7777, seed, i], pause)]
    return np.concatenate(rows), starts


def seconds(frame) -> float:
    """When a word begins."""
    return frame / SEQUENCE_HZ
