"""Relations of the body over time: the catalogue, and the words of a recording."""

from motionary.features.body import Body
from motionary.features.catalogue import FULL_BODY, FULL_BODY_2006
from motionary.features.computing import MEASURE_HZ, compute_features, relation_matrix
from motionary.features.files import NamedFile, Reading, read_features
from motionary.features.relations import FeatureSet, Relation
from motionary.features.sequence import WORD_HZ, FeatureSequence

__all__ = [
    "FULL_BODY",
    "FULL_BODY_2006",
    "MEASURE_HZ",
    "WORD_HZ",
    "Body",
    "FeatureSequence",
    "FeatureSet",
    "NamedFile",
    "Reading",
    "Relation",
    "compute_features",
    "read_features",
    "relation_matrix",
]
