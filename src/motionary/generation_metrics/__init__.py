"""Measures of generated motion on relational features: FID_g and diversity."""

from motionary.generation_metrics.features import Mode, motion_features
from motionary.generation_metrics.published import PUBLISHED_COLUMNS, published_features
from motionary.generation_metrics.sets import diversity, frechet_distance

__all__ = [
    "PUBLISHED_COLUMNS",
    "Mode",
    "diversity",
    "frechet_distance",
    "motion_features",
    "published_features",
]
