"""What do the examples of a class share at each moment?

Every example is aligned with the class's template; a column of the template is a moment
that all examples pass.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motionary.features import FeatureSequence
from motionary.models.keyframes.query import Gap
from motionary.models.keyframes.steadiness import count_steady
from motionary.models.templates import MotionTemplate
from motionary.models.templates.alignment import Pair, align_batched

Floats = NDArray[np.float64]

#: Relations that are steady for longer, half a second around, are not told apart.
MOST_STEADY = 15


@dataclass(frozen=True, slots=True, eq=False)
class Moments:
    """What aligned examples share.

    Attributes
    ----------
    frames : array, shape (examples, columns): the frame of each moment
    values : array, shape (columns, features): what most examples show
    share : array of that shape: share of the examples that show it steadily
    steadiness : array of that shape: for how many frames around, in the least steady of
        the examples that show it
    dissent : array, shape (features,): per relation, the share of the moments at which one
        example breaks what all others agree on, summed over the examples
    """

    frames: NDArray[np.intp]
    values: NDArray[np.bool_]
    fraction: Floats
    steadiness: NDArray[np.intp]
    dissent: Floats

    @property
    def n_columns(self) -> int:
        """Number of moments."""
        return int(self.frames.shape[1])

    def gap(self, first: int, second: int, stiffness: float) -> Gap:
        """Frames between two moments: as in the examples, and looser by a stiffness."""
        distance = self.frames[:, second] - self.frames[:, first]
        least, most = float(distance.min()), float(distance.max())
        return Gap(int(np.floor(stiffness * least)), int(np.ceil(most / stiffness)))


def find_moments(
    template: MotionTemplate, examples: Sequence[FeatureSequence], *, steady: int
) -> Moments:
    """Moments of examples.

    Parameters
    ----------
    template : learned from the examples
    examples : words of each
    steady : frames around for which a value must be kept to count as shown
    """
    frames = _align_whole(template, examples)
    pairs = list(zip(examples, frames, strict=True))
    shown = np.array([e.features[at] for e, at in pairs], dtype=np.bool_)
    known = np.array([e.known_features[at] for e, at in pairs], dtype=np.bool_)
    kept = np.array([count_steady(e, at, MOST_STEADY) for e, at in pairs])
    counts = known & (kept >= steady)
    on, off = (shown & counts).mean(axis=0), (~shown & counts).mean(axis=0)
    values = on >= off
    conforming = np.where(shown == values, kept, MOST_STEADY)
    fraction = np.maximum(on, off)
    return Moments(frames, values, fraction, conforming.min(axis=0), _dissent(shown))


def _align_whole(template: MotionTemplate, examples: Sequence[FeatureSequence]) -> NDArray[np.intp]:
    """Frame of each column, shape (examples, columns): the middle of those that it meets.

    As in learning, an example begins and ends with the template, and what is unknown is
    half a disagreement with either value.
    """
    n_columns, offset = template.n_columns, template.n_columns
    pairs = []
    for example in examples:
        seen = np.where(example.known_features, example.features, 0.5)
        cost = np.abs(template.values[:, np.newaxis] - seen).sum(axis=2)
        pairs.append(Pair(cost, 0, offset))
        offset += len(example)
    met = align_batched(iter(pairs))
    of_template = met.reference < n_columns
    columns, rows = met.reference[of_template], met.warped[of_template]
    starts = np.array([pair.second for pair in pairs])
    which = np.searchsorted(starts, rows, side="right") - 1
    total = np.zeros((len(examples), n_columns))
    count = np.zeros((len(examples), n_columns))
    np.add.at(total, (which, columns), rows - starts[which])
    np.add.at(count, (which, columns), 1.0)
    return np.floor(total / count + 0.5).astype(np.intp)


def _dissent(shown: NDArray[np.bool_]) -> Floats:
    """Per feature: of the moments at which all but one example agree, how many has that one."""
    n, ones = len(shown), shown.sum(axis=0)
    if n < 2:
        return np.zeros(shown.shape[2])
    total = np.zeros(shown.shape[2])
    for example in shown:
        others = ones - example
        agreed = (others == 0) | (others == n - 1)
        broken = agreed & (example != (others > 0))
        total += broken.sum(axis=0) / np.maximum(agreed.sum(axis=0), 1)
    return total
