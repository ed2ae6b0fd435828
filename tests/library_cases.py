"""Examples of made-up classes: relations that come and go, each performance at its own pace."""

from contextlib import contextmanager

import numpy as np

from motionary.features import FULL_BODY
from packing_cases import sequence


def made_class(seed, *, n_frames=40, n_features=40):
    """Relations of a class of motion, shape (frames, features): each holds for one stretch."""
    rng = np.random.default_rng([seed, 99])
    ends = np.sort(rng.integers(0, n_frames + 1, size=(2, n_features)), axis=0)
    frames = np.arange(n_frames)[:, None]
    return (ends[0] <= frames) & (frames < ends[1])


def perform(rows, seed, *, slowest=1.4, flaws=0.02, feature_set=FULL_BODY, **about):
    """One performance: parts slower or faster, some entries wrong."""
    rng = np.random.default_rng([*np.atleast_1d(seed), 7])
    pace = np.repeat(rng.uniform(1 / slowest, slowest, size=-(-len(rows) // 8)), 8)[: len(rows)]
    times = np.concatenate([[0.0], np.cumsum(pace)])
    places = np.searchsorted(times, np.arange(int(times[-1])), side="right") - 1
    shown = rows[np.minimum(places, len(rows) - 1)]
    wrong = rng.random(shown.shape) < flaws
    return sequence(shown ^ wrong, feature_set=feature_set, **about)


def performances(class_seed, n, *, first=0, name="class", **how):
    """Several performances of one class, called name/0.bvh and so on."""
    rows = made_class(class_seed)
    return [
        perform(rows, [class_seed, i], name=f"{name}/{i}.bvh", **how)
        for i in range(first, first + n)
    ]


class Listening:
    """A monitor that writes down what it is told."""

    def __init__(self):
        self.stages, self.notices = {}, []

    @contextmanager
    def stage(self, name, total):
        done = []
        yield lambda *_: done.append(name)
        self.stages[name] = (len(done), total)

    def notify(self, notice):
        self.notices.append(notice)
