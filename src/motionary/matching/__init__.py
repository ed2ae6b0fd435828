"""Masked subsequence DTW on packed features, hits and label assignment."""

from motionary.matching.alignment import Alignment, align
from motionary.matching.corpus import (
    PADDING,
    Corpus,
    concatenate,
    feature_prior,
    prior_of_counts,
    self_information,
)
from motionary.matching.distance import (
    SKIP_WEIGHT,
    MatchState,
    corpus_distance,
    distance_function,
)
from motionary.matching.hits import (
    ClassSegment,
    Hit,
    annotate_distances,
    find_hits,
    local_minima,
    modify,
)
from motionary.matching.pattern import Pattern, cell_costs

__all__ = [
    "PADDING",
    "SKIP_WEIGHT",
    "Alignment",
    "ClassSegment",
    "Corpus",
    "Hit",
    "MatchState",
    "Pattern",
    "align",
    "annotate_distances",
    "cell_costs",
    "concatenate",
    "corpus_distance",
    "distance_function",
    "feature_prior",
    "find_hits",
    "local_minima",
    "modify",
    "prior_of_counts",
    "self_information",
]
