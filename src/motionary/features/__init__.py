"""Features of the body over time: the catalogue, and the packed features of a recording."""

from motionary.features.batches import FeatureBatch, MotionFeatures, compute_batch, match_names
from motionary.features.body import Body, describe_reference_lengths
from motionary.features.catalogue import FULL_BODY, FULL_BODY_2006, LEGS, THREE_LEVELS
from motionary.features.computing import (
    MEASURE_HZ,
    SEQUENCE_HZ,
    FeatureSequence,
    compute_features,
    feature_matrix,
    motion_from_array,
)
from motionary.features.everyday import known_sets, load_everyday_set
from motionary.features.feature_set import (
    Feature,
    FeatureSet,
    describe_set,
    find_feature,
    set_from_rows,
)
from motionary.features.files import NamedFile, read_features, write_features
from motionary.features.streaming import FeatureStream

__all__ = [
    "FULL_BODY", "FULL_BODY_2006", "LEGS", "MEASURE_HZ", "SEQUENCE_HZ", "THREE_LEVELS", "Body",
    "Feature", "FeatureBatch", "FeatureSequence", "FeatureSet", "FeatureStream", "MotionFeatures",
    "NamedFile", "compute_batch", "compute_features", "describe_reference_lengths", "describe_set",
    "feature_matrix", "find_feature", "known_sets", "load_everyday_set", "match_names",
    "motion_from_array", "read_features", "set_from_rows", "write_features",
]  # fmt: skip
