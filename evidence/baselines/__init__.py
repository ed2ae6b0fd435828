"""What motion templates are compared with: one example by DTW, and frames one by one.

Random search, beside the genetic algorithm and with as many evaluations, is
`motionary.models.query_learning.learn_runs(..., random_search=True)`.
"""

from evidence.baselines.dtw import Matches, match_costs
from evidence.baselines.examples import BASELINES, Baseline, find_example
from evidence.baselines.frame_classifier import (
    FrameClassifier,
    FrameTraining,
    train_frame_classifier,
)
from evidence.baselines.frames import feature_frames, position_frames, rotation_frames
from evidence.baselines.windows import Window, position_windows

__all__ = [
    "BASELINES",
    "Baseline",
    "FrameClassifier",
    "FrameTraining",
    "Matches",
    "Window",
    "feature_frames",
    "find_example",
    "match_costs",
    "position_frames",
    "position_windows",
    "rotation_frames",
    "train_frame_classifier",
]
