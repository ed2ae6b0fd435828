"""Keyframe queries learned from examples and counter-examples by a genetic algorithm.

After Baak (2012), chapter 4.
"""

from typing import TYPE_CHECKING

from motionary.lazy import lazy_names

if TYPE_CHECKING:
    from motionary.models.query_learning.generations import (
        PUBLISHED,
        Augmentation,
        Evaluator,
        GeneticSettings,
        RunResult,
        weighted_f,
    )
    from motionary.models.query_learning.individuals import (
        Accumulation,
        Individual,
        accumulate,
        to_query,
    )
    from motionary.models.query_learning.learning import (
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

#: So many learned queries vote by default.
RUNS = 5

__all__ = [
    "PUBLISHED",
    "RUNS",
    "Accumulation",
    "Augmentation",
    "Evaluator",
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
    "to_query",
    "weighted_f",
]

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "generations": "PUBLISHED Augmentation Evaluator GeneticSettings RunResult weighted_f",
        "individuals": "Accumulation Individual accumulate to_query",
        "learning": (
            "LearnedQueries Problem clip_evaluator combine_runs continue_learning "
            "default_votes learn_query learn_runs state_problem"
        ),
    },
)
