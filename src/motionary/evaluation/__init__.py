"""Measures of labels, detections, rankings and choices; they know no motion.

Every measure takes what was predicted, then the truth. `evaluate` gives all measures of
labels at once; what is undefined (0/0) is told in `motionary.evaluation.counts`.
"""

from motionary.evaluation.boundaries import (
    BoundaryError,
    compute_boundary_error,
    compute_boundary_offsets,
    count_edits,
    pair_segments,
)
from motionary.evaluation.counts import Confusion, Counts, Rates, compute_rates, pool_counts
from motionary.evaluation.detection import (
    compute_average_precisions,
    compute_mean_average_precision,
)
from motionary.evaluation.frames import confuse_frames, count_frames
from motionary.evaluation.intervals import Interval, interval
from motionary.evaluation.ranking import (
    Classification,
    Retrieval,
    compute_average_precision,
    compute_r_precision,
    compute_rates_at,
    score_classification,
    summarize_rankings,
)
from motionary.evaluation.scores import Measures, Scores, evaluate
from motionary.evaluation.segments import (
    compute_edit_distance,
    compute_edit_score,
    count_false,
    count_matches,
    count_overlaps,
)
from motionary.evaluation.tables import LabelLike, Segment, rename_segments, to_segments

__all__ = [
    "BoundaryError",
    "Classification",
    "Confusion",
    "Counts",
    "Interval",
    "LabelLike",
    "Measures",
    "Rates",
    "Retrieval",
    "Scores",
    "Segment",
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
