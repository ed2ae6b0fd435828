"""Settings and priors of labels that are assigned by scores.

A class needs, beside its templates, the fraction of frames of motion in general in which
each feature holds. Examples and a general corpus count half each; where templates are
mirrored, so is the prior.

Conventions: probabilities of path scores are kept off 0 and 1 by their own settings; here
they only stay within (0, 1).
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.features import FULL_BODY, FeatureSequence, FeatureSet
from motionary.matching import SchedulingSettings, concatenate, feature_prior
from motionary.models.library.toml_tables import (
    Keys,
    check_keys,
    is_number,
    refuse,
    refuse_value,
)
from motionary.packing import full_mask

Floats = NDArray[np.float64]

_DIGITS = 6
_KEYS: Keys = {"corpus": list, "threshold": float, "look_ahead_s": float}
_OPTIONAL_KEYS: Keys = {"false_slope": float, "probability": list}
_DEFAULTS = SchedulingSettings()

#: Fraction of frames in which each feature of the full-body set holds, in 66 recordings of
#: 17 people of the CMU Graphics Lab Motion Capture Database (8.3 minutes of everyday motion,
#: sports and exercises).
CORPUS_OF_CMU = (
    0.1979, 0.1876, 0.2659, 0.2249, 0.1145, 0.1073, 0.2646, 0.2424, 0.0593, 0.1498,
    0.1132, 0.1029, 0.6117, 0.5577, 0.3364, 0.3354, 0.0082, 0.0214, 0.0148, 0.2045,
    0.1722, 0.0155, 0.0556, 0.0667, 0.2731, 0.2686, 0.4326, 0.3774, 0.2538, 0.2506,
    0.1376, 0.0317, 0.0191, 0.0124, 0.0391, 0.0479, 0.0639, 0.0799, 0.5127, 0.1626,
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Scoring:
    """How labels of a library are assigned by scores.

    Attributes
    ----------
    corpus : fraction of frames of a general corpus in which each feature holds
    threshold : score at which a match is as good as no label
    look_ahead_s : how long after its end a match is decided
    false_slope : how fast false labels become rare, a unit of score; None if unknown
    probability : logarithm of the odds that a label of the least score of its class is
        right, and how it grows with each unit above; None if unknown
    """

    corpus: tuple[float, ...]
    threshold: float = _DEFAULTS.threshold
    look_ahead_s: float = _DEFAULTS.look_ahead_s
    false_slope: float | None = None
    probability: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        fractions = tuple(float(x) for x in self.corpus)
        if not fractions or not all(0 < x < 1 for x in fractions):
            raise InvalidInput("corpus needs fractions between 0 and 1", key="corpus")
        if not (np.isfinite(self.threshold) and self.threshold > 0):
            raise InvalidInput(
                f"threshold of scores must be above 0, got {self.threshold}", key="threshold"
            )
        if not self.look_ahead_s >= 0:
            raise InvalidInput(
                f"look_ahead_s must be at least 0, got {self.look_ahead_s}", key="look_ahead_s"
            )
        if self.false_slope is not None and not self.false_slope > 0:
            raise InvalidInput(
                f"false_slope must be above 0, got {self.false_slope}", key="false_slope"
            )
        object.__setattr__(self, "corpus", fractions)
        if self.probability is not None:
            numbers = tuple(float(x) for x in self.probability)
            if len(numbers) != 2 or not np.isfinite(numbers).all():
                raise InvalidInput("probability needs two numbers", key="probability")
            object.__setattr__(self, "probability", numbers)

    def probability_of(self, margin: float) -> float | None:
        """That a label is right whose score lies so far above the least of its class."""
        if self.probability is None:
            return None
        at_least, growth = self.probability
        return float(1 / (1 + np.exp(-(at_least + growth * margin))))


def scoring_for(feature_set: FeatureSet, others: Sequence[FeatureSequence] = ()) -> Scoring | None:
    """Scoring with the corpus of other motion, or the one that comes with the package.

    None for a feature set that has no corpus.
    """
    if others:
        return Scoring(_round(measure_fractions(others, feature_set)))
    return Scoring(CORPUS_OF_CMU) if feature_set == FULL_BODY else None


def mix_prior(
    examples: Sequence[FeatureSequence], scoring: Scoring | None, *, mirror: bool
) -> tuple[float, ...]:
    """Prior of each feature; empty without a corpus, or without examples.

    Parameters
    ----------
    examples : of all classes
    mirror : whether templates are learned with their mirror images
    """
    if scoring is None or not examples:
        return ()
    feature_set = examples[0].feature_set
    prior = (measure_fractions(examples, feature_set) + np.array(scoring.corpus)) / 2
    if mirror:
        prior = (prior + prior[feature_set.mirror_order]) / 2
    return _round(prior)


def measure_fractions(sequences: Sequence[FeatureSequence], feature_set: FeatureSet) -> Floats:
    """Fraction of the known frames in which each feature holds."""
    packed, known = [s.packed for s in sequences], [s.known for s in sequences]
    corpus = concatenate(packed, known, full=full_mask(1, len(feature_set))[0])
    return feature_prior(corpus, len(feature_set))


def _round(fractions: Floats) -> tuple[float, ...]:
    least = 10.0**-_DIGITS
    return tuple(round(float(x), _DIGITS) for x in np.clip(fractions, least, 1 - least))


# ---- the table of a library's file


def describe_scoring(scoring: Scoring | None) -> dict[str, Any]:
    """The table of a library; empty without scores."""
    if scoring is None:
        return {}
    content = {key: value for key, value in asdict(scoring).items() if value is not None}
    lists = {key: list(content[key]) for key in ("corpus", "probability") if key in content}
    return content | lists


def read_scoring(path: Path, index: Mapping[str, Any]) -> Scoring | None:
    """What a library says of scores; None in one from before there were any.

    Raises
    ------
    UnreadableFile
        If the table is not what it should be.
    """
    if "scoring" not in index:
        return None
    content = index["scoring"]
    keys = dict(_KEYS)
    if isinstance(content, dict):
        keys |= {key: kind for key, kind in _OPTIONAL_KEYS.items() if key in content}
    check_keys(path, content, keys, place=("scoring",))
    for key in keys:
        if keys[key] is list and not all(map(is_number, content[key])):
            raise refuse(path, ("scoring", key), "must be a list of numbers")
    try:
        return Scoring(**{key: content[key] for key in keys})
    except InvalidInput as error:
        raise refuse_value(path, ("scoring",), error) from error
