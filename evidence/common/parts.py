"""How alike are two recordings, part by part, whatever the tempo of each?

An example is cut into parts that overlap by half; each is sought by itself, at several
tempos, in every recording. A recording costs the mean of what its parts cost there, each
weighed by how surprising its relations are, so that standing still counts little.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evidence.common.ranking import clip_costs
from motionary.features import FeatureSequence
from motionary.matching import Corpus, self_information
from motionary.models.templates import QuantisedTemplate, pattern_of
from motionary.recording import Recording

Floats = NDArray[np.float64]

#: A part that fits nowhere costs as much as one that is wrong throughout.
_MOST = 1.0


class Parts(NamedTuple):
    """Settings: columns of a part, and the tempos at which it is sought."""

    width: int
    tempos: tuple[float, ...]


def part_costs(example: FeatureSequence, corpus: Corpus, ones: Floats, parts: Parts) -> Floats:
    """Cost of every recording, shape (documents,).

    Parameters
    ----------
    example : words
    corpus : the recordings
    ones : array, shape (features,), share of their frames in which each relation holds
    parts : settings
    """
    costs, weights = [], []
    for part in _cut(example, parts.width):
        patterns = {
            str(tempo): pattern_of(_template_of(at_tempo(part, tempo)), ones=ones)
            for tempo in parts.tempos
        }
        costs.append(np.minimum(clip_costs(patterns, corpus).min(axis=1), _MOST))
        told = self_information(part.features.astype(np.bool_), ones) * part.known_features
        weights.append(told.sum() / len(part))
    return np.asarray(np.average(costs, axis=0, weights=weights), dtype=np.float64)


def at_tempo(sequence: FeatureSequence, tempo: float) -> FeatureSequence:
    """Words as if the motion went so many times as fast."""
    n_frames = max(2, round(len(sequence) / tempo))
    at = np.minimum(((np.arange(n_frames) + 0.5) * tempo).astype(np.intp), len(sequence) - 1)
    return FeatureSequence(
        sequence.packed[at], sequence.known[at], sequence.feature_set, Recording(sequence.source)
    )


def _cut(example: FeatureSequence, width: int) -> Iterator[FeatureSequence]:
    last = max(len(example) - width, 0)
    starts: Sequence[int] = sorted({*range(0, last, max(width // 2, 1)), last})
    for start in starts:
        yield example.part(start, min(start + width, len(example)))


def _template_of(part: FeatureSequence) -> QuantisedTemplate:
    known = part.known_features.astype(np.bool_)
    return QuantisedTemplate(
        part.features.astype(np.bool_) & known,
        known,
        np.ones(len(part)),
        part.feature_set.ids,
        part.feature_set.name,
    )
