"""Measures of labels, detections, rankings and choices; they know no motion.

Every measure takes what was predicted, then the truth. `evaluate` gives all measures of
labels at once; what is undefined (0/0) is told in `motionary.evaluation.counts`.
"""

from motionary.evaluation.counts import (
    Confusion,
    Counts,
    LabelledSegment,
    LabelLike,
    Rates,
    compute_rates,
    confuse_frames,
    count_frames,
    pool_counts,
    rename_segments,
    to_segments,
)
from motionary.evaluation.ranking import (
    Classification,
    Interval,
    Retrieval,
    compute_average_precision,
    compute_average_precisions,
    compute_mean_average_precision,
    compute_r_precision,
    compute_rates_at,
    interval,
    score_classification,
    summarize_rankings,
)
from motionary.evaluation.scores import Measures, Scores, evaluate
from motionary.evaluation.segments import (
    BoundaryError,
    compute_boundary_error,
    compute_boundary_offsets,
    compute_edit_distance,
    compute_edit_score,
    count_edits,
    count_false,
    count_matches,
    count_overlaps,
    pair_segments,
)

__all__ = [
    "BoundaryError",
    "Classification",
    "Confusion",
    "Counts",
    "Interval",
    "LabelLike",
    "LabelledSegment",
    "Measures",
    "Rates",
    "Retrieval",
    "Scores",
    "compute_average_precision",
    "compute_average_precisions",
    "compute_boundary_error",
    "compute_boundary_offsets",
    "compute_edit_distance",
    "compute_edit_score",
    "compute_mean_average_precision",
    "compute_r_precision",
    "compute_rates",
    "compute_rates_at",
    "confuse_frames",
    "count_edits",
    "count_false",
    "count_frames",
    "count_matches",
    "count_overlaps",
    "evaluate",
    "interval",
    "pair_segments",
    "pool_counts",
    "rename_segments",
    "score_classification",
    "summarize_rankings",
    "to_segments",
]
