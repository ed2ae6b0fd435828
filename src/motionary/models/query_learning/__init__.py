"""Keyframe queries that are learned from examples and counter-examples.

After Baak (2012), chapter 4.
"""

from motionary.models.query_learning.accumulation import Accumulation, accumulate
from motionary.models.query_learning.copies import Copying
from motionary.models.query_learning.evolution import PUBLISHED, Breeding, Evolved
from motionary.models.query_learning.individuals import Individual
from motionary.models.query_learning.learning import (
    RUNS,
    LearnedQueries,
    Problem,
    breed_runs,
    combine_runs,
    continue_learning,
    default_votes,
    judge_clips,
    learn_query,
    state_problem,
)

__all__ = [
    "PUBLISHED",
    "RUNS",
    "Accumulation",
    "Breeding",
    "Copying",
    "Evolved",
    "Individual",
    "LearnedQueries",
    "Problem",
    "accumulate",
    "breed_runs",
    "combine_runs",
    "continue_learning",
    "default_votes",
    "judge_clips",
    "learn_query",
    "state_problem",
]
