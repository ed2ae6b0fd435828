"""Frames classified one by one from what surrounds them.

Arikan, Forsyth and O'Brien (2003) classify frames by support vector machines with a radial
kernel on windows of positions. The kernel is approximated here by random cosines (Rahimi
and Recht, 2007), so that training is one smooth convex problem, a squared hinge for each
class against all others, for any number of frames: an exact machine needs a matrix of
frames by frames and a solver of its own, for differences below those of its settings.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize

from motionary.errors import InvalidInput

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class FrameTraining:
    """Settings of the machine.

    Attributes
    ----------
    cosines : random features; more are nearer to the kernel
    width : of the kernel, in medians of the distance between two frames
    penalty : of the squared weights, beside the mean loss
    rounds : most steps of the solver
    seed : of the random features
    """

    cosines: int = 512
    width: float = 1.0
    penalty: float = 1e-4
    rounds: int = 200
    seed: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class FrameClassifier:
    """A trained machine.

    Attributes
    ----------
    names : of the classes
    directions, phases : arrays, shapes (dimensions, cosines) and (cosines,)
    weights : array, shape (cosines + 1, classes); the last row is added
    """

    names: tuple[str, ...]
    directions: Floats
    phases: Floats
    weights: Floats

    def scores(self, windows: ArrayLike) -> Floats:
        """How far each frame is on the side of each class, shape (frames, classes).

        Raises
        ------
        InvalidInput
            If the windows have other dimensions than those of training.
        """
        given = np.asarray(windows, dtype=np.float64)
        if given.ndim != 2 or given.shape[1] != len(self.directions):
            raise InvalidInput(
                f"windows need shape (frames, {len(self.directions)}), as in training, "
                f"got {given.shape}"
            )
        scores: Floats = _lift(given, self.directions, self.phases) @ self.weights
        return scores

    def classify(self, windows: ArrayLike) -> list[str]:
        """The class of each frame: the one with the largest score."""
        return [self.names[i] for i in self.scores(windows).argmax(axis=1)]


def train_frame_classifier(
    examples: Mapping[str, Sequence[ArrayLike]], *, training: FrameTraining | None = None
) -> FrameClassifier:
    """Machine that tells classes apart by single frames.

    Parameters
    ----------
    examples : per class, windows of each example, shape (frames, dimensions)
    training : settings

    Raises
    ------
    InvalidInput
        If there are fewer than two classes, or windows that do not fit or are not finite.
    """
    chosen = training or FrameTraining()
    names = tuple(sorted(examples))
    x, labels = _stack(examples, names)
    random = np.random.default_rng(chosen.seed)
    pairs = random.integers(len(x), size=(2, 1000))
    scale = float(np.median(np.linalg.norm(x[pairs[0]] - x[pairs[1]], axis=1))) or 1.0
    directions = random.normal(size=(x.shape[1], chosen.cosines)) / (scale * chosen.width)
    phases = random.uniform(0, 2 * np.pi, size=chosen.cosines)
    weights = _solve(_lift(x, directions, phases), labels, len(names), chosen)
    return FrameClassifier(names, directions, phases, weights)


def _stack(
    examples: Mapping[str, Sequence[ArrayLike]], names: Sequence[str]
) -> tuple[Floats, NDArray[np.intp]]:
    arrays = [(i, np.asarray(one, float)) for i, name in enumerate(names) for one in examples[name]]
    if len({i for i, _ in arrays}) < max(2, len(names)):
        raise InvalidInput(
            f"a classifier needs at least two classes with an example each, got {list(names)}"
        )
    shapes = {one.shape[1:] for _, one in arrays}
    if len(shapes) != 1 or len(next(iter(shapes))) != 1:
        raise InvalidInput(
            f"windows need shape (frames, dimensions), alike in all examples, got {shapes}"
        )
    x = np.concatenate([one for _, one in arrays])
    if not np.isfinite(x).all():
        raise InvalidInput("windows must be finite; position_windows puts 0 for unseen joints")
    return x, np.repeat([i for i, _ in arrays], [len(one) for _, one in arrays])


def _lift(x: Floats, directions: Floats, phases: Floats) -> Floats:
    """Random cosines of the frames, and a column of ones."""
    cosines = np.cos(x @ directions + phases) * np.sqrt(2 / len(phases))
    return np.concatenate([cosines, np.ones((len(x), 1))], axis=1)


def _solve(
    lifted: Floats, labels: NDArray[np.intp], n_classes: int, training: FrameTraining
) -> Floats:
    """Weights of least squared hinge, all classes at once; each class weighs alike."""
    sides = np.where(labels[:, np.newaxis] == np.arange(n_classes), 1.0, -1.0)
    fraction = (sides > 0).mean(axis=0)
    balance = np.where(sides > 0, 0.5 / fraction, 0.5 / (1 - fraction)) / len(labels)
    shape = (lifted.shape[1], n_classes)

    def loss(flat: Floats) -> tuple[float, Floats]:
        weights = flat.reshape(shape)
        short = np.maximum(1 - sides * (lifted @ weights), 0.0)
        slope = lifted.T @ (-2 * balance * short * sides)
        # The added column is no direction: it is not held small.
        held = weights.copy()
        held[-1] = 0.0
        value = float((balance * short**2).sum() + training.penalty * (held**2).sum())
        return value, (slope + 2 * training.penalty * held).ravel()

    start = np.zeros(shape[0] * shape[1])
    options = {"maxiter": training.rounds}
    found = minimize(loss, start, jac=True, method="L-BFGS-B", options=options)
    weights: Floats = np.asarray(found.x, dtype=np.float64).reshape(shape)
    return weights
