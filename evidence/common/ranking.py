"""How do templates rank clips?

A clip's cost is the smallest value of the distance function within it; a clip too short
for a template costs infinity.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evidence.common.recordings import Clip
from motionary.evaluation import (
    compute_average_precision,
    compute_rates_at,
    score_classification,
    summarize_rankings,
)
from motionary.features import FeatureSequence
from motionary.matching import (
    SKIP_WEIGHT,
    Corpus,
    Pattern,
    concatenate,
    corpus_distance,
    feature_prior,
)
from motionary.models.templates import MotionTemplate, learn_template, pattern_of, quantise
from motionary.packing import full_mask

Floats = NDArray[np.float64]

#: Of the publication of 2006.
TAU = 0.06
TOLERANCE_2006 = 0.1


def corpus_of(sequences: Sequence[FeatureSequence]) -> Corpus:
    """Recordings as one padded stretch of words."""
    return concatenate(
        [s.packed for s in sequences],
        [s.known for s in sequences],
        full=full_mask(1, len(sequences[0].feature_set))[0],
    )


def templates_of(clips: Sequence[Clip]) -> dict[str, MotionTemplate]:
    """A template of each class, sorted by name."""
    by_class: dict[str, list[FeatureSequence]] = {}
    for clip in clips:
        by_class.setdefault(clip.motion_class, []).append(clip.packed)
    return {name: template_of(by_class[name]) for name in sorted(by_class)}


def template_of(sequences: Sequence[FeatureSequence]) -> MotionTemplate:
    """Template of some examples."""
    first = sequences[0].feature_set
    return learn_template(
        [s.features for s in sequences], feature_names=first.ids, feature_set=first.name
    )


def patterns_of(
    templates: Mapping[str, MotionTemplate],
    *,
    tolerance: float,
    ones: Floats | None = None,
) -> dict[str, Pattern]:
    """What is sought; with `ones`, weighed by surprise."""
    return {
        name: pattern_of(quantise(template, tolerance=tolerance), ones=ones)
        for name, template in templates.items()
    }


def background_of(clips: Sequence[Clip]) -> Floats:
    """Share of the clips' frames in which each relation holds."""
    ones = feature_prior(corpus_of([c.packed for c in clips]), len(clips[0].packed.feature_set))
    return np.clip(ones, 1e-6, 1 - 1e-6)


def clip_costs(
    patterns: Mapping[str, Pattern], corpus: Corpus, *, skip_weight: float = SKIP_WEIGHT
) -> Floats:
    """Smallest cost of each pattern in each document, shape (documents, patterns)."""
    columns = []
    for pattern in patterns.values():
        distance = corpus_distance(pattern, corpus, skip_weight=skip_weight)
        columns.append([float(part.min(initial=np.inf)) for part in corpus.split(distance)])
    return np.array(columns).T


def summarize(
    costs: Floats, truth: Sequence[str], names: Sequence[str], *, threshold: float = TAU
) -> dict[str, Any]:
    """Ranking, retrieval at a threshold, and choice of the cheapest class.

    Precision and recall are means over the classes.
    """
    relevant = [np.array([name == label for label in truth]) for name in names]
    rankings = [(costs[:, i], relevant[i]) for i in range(len(names))]
    retrieval = summarize_rankings(rankings)
    rates = [compute_rates_at(*ranking, threshold=threshold) for ranking in rankings]
    return {
        "mean_average_precision": retrieval.average_precision,
        "r_precision": retrieval.r_precision,
        "precision": float(np.mean([rate.precision for rate in rates])),
        "recall": float(np.mean([rate.recall for rate in rates])),
        "right_class": score_classification(costs, truth, names=names).accuracy,
    }


def mean_f(
    costs: Floats, truth: Sequence[str], names: Sequence[str], *, thresholds: Sequence[float]
) -> Floats:
    """Mean over the classes of F at each threshold, shape (thresholds,)."""
    relevant = [np.array([name == label for label in truth]) for name in names]
    return np.array(
        [
            np.mean(
                [
                    compute_rates_at(costs[:, i], relevant[i], threshold=threshold).f
                    for i in range(len(names))
                ]
            )
            for threshold in thresholds
        ]
    )


def by_class(
    costs: Floats, truth: Sequence[str], names: Sequence[str], *, threshold: float = TAU
) -> dict[str, dict[str, float]]:
    """Average precision, precision and recall of each class."""
    result = {}
    for i, name in enumerate(names):
        relevant = np.array([name == label for label in truth])
        rates = compute_rates_at(costs[:, i], relevant, threshold=threshold)
        result[name] = {
            "average_precision": compute_average_precision(costs[:, i], relevant),
            "precision": rates.precision,
            "recall": rates.recall,
        }
    return result
