"""Relations of the body over time: the catalogue, and the words of a recording."""

from motionary.features.body import Body
from motionary.features.catalogue import FULL_BODY, FULL_BODY_2006
from motionary.features.computing import (
    MEASURE_HZ,
    compute_features,
    relation_matrix,
    say_yardsticks,
)
from motionary.features.definitions import describe_set, set_from_rows
from motionary.features.files import NamedFile, Reading, read_features
from motionary.features.naming import find_relation
from motionary.features.relations import FeatureSet, Relation
from motionary.features.sequence import WORD_HZ, FeatureSequence
from motionary.features.sets import LEGS, THREE_LEVELS, known_sets

__all__ = [
    "FULL_BODY",
    "FULL_BODY_2006",
    "LEGS",
    "MEASURE_HZ",
    "THREE_LEVELS",
    "WORD_HZ",
    "Body",
    "FeatureSequence",
    "FeatureSet",
    "NamedFile",
    "Reading",
    "Relation",
    "compute_features",
    "describe_set",
    "find_relation",
    "known_sets",
    "read_features",
    "relation_matrix",
    "say_yardsticks",
    "set_from_rows",
]
