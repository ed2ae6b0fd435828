"""Keyframe queries that are learned from examples and counter-examples.

After Baak (2012), chapter 4.
"""

from motionary.models.query_learning.accumulation import Accumulation, accumulate
from motionary.models.query_learning.copies import Augmentation
from motionary.models.query_learning.evolution import PUBLISHED, GeneticSettings, RunResult
from motionary.models.query_learning.individuals import Individual
from motionary.models.query_learning.learning import (
    RUNS,
    LearnedQueries,
    Problem,
    clip_evaluator,
    combine_runs,
    continue_learning,
    default_votes,
    learn_query,
    learn_runs,
    state_problem,
)

__all__ = [
    "PUBLISHED",
    "RUNS",
    "Accumulation",
    "Augmentation",
    "GeneticSettings",
    "Individual",
    "LearnedQueries",
    "Problem",
    "RunResult",
    "accumulate",
    "clip_evaluator",
    "combine_runs",
    "continue_learning",
    "default_votes",
    "learn_query",
    "learn_runs",
    "state_problem",
]
