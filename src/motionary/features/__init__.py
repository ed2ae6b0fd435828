"""Relations of the body over time: the catalogue, and the words of a recording."""

from motionary.features.body import Body
from motionary.features.catalogue import FULL_BODY, FULL_BODY_2006
from motionary.features.computing import (
    MEASURE_HZ,
    compute_features,
    describe_reference_lengths,
    feature_matrix,
)
from motionary.features.definitions import describe_set, set_from_rows
from motionary.features.feature_set import Feature, FeatureSet
from motionary.features.files import NamedFile, read_features
from motionary.features.naming import find_feature
from motionary.features.sequence import SEQUENCE_HZ, FeatureSequence
from motionary.features.sets import LEGS, THREE_LEVELS, known_sets

__all__ = [
    "FULL_BODY",
    "FULL_BODY_2006",
    "LEGS",
    "MEASURE_HZ",
    "SEQUENCE_HZ",
    "THREE_LEVELS",
    "Body",
    "Feature",
    "FeatureSequence",
    "FeatureSet",
    "NamedFile",
    "compute_features",
    "describe_reference_lengths",
    "describe_set",
    "feature_matrix",
    "find_feature",
    "known_sets",
    "read_features",
    "set_from_rows",
]
