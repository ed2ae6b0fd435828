"""Masked DTW on words: how well, where, and along which path a pattern occurs."""

from motionary.matching.alignment import Alignment, align
from motionary.matching.corpus import PADDING, Corpus, concatenate
from motionary.matching.deciding import ClassSegment, annotate_distances, modify
from motionary.matching.distance import (
    SKIP_WEIGHT,
    MatchState,
    corpus_distance,
    distance_function,
)
from motionary.matching.hits import Hit, find_hits, local_minima
from motionary.matching.pattern import Pattern, cell_costs
from motionary.matching.self_information import feature_prior, prior_of_counts, self_information

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
