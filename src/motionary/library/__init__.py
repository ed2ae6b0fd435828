"""Motion classes: what they are, how they are learned, how they lie on disk."""

from motionary.library.advice import Advice, advise
from motionary.library.classes import ClassLibrary, MotionClass, Subclass
from motionary.library.examples import Examples, ReadExamples, list_examples, read_examples
from motionary.library.learning import learn
from motionary.library.querying import QueriedLibrary, learn_queries
from motionary.library.storage import load_library, save_library
from motionary.library.teaching import Teaching, learn_classes
from motionary.library.thresholds import Suggestion, suggest_thresholds

__all__ = [
    "Advice",
    "ClassLibrary",
    "Examples",
    "MotionClass",
    "QueriedLibrary",
    "ReadExamples",
    "Subclass",
    "Suggestion",
    "Teaching",
    "advise",
    "learn",
    "learn_classes",
    "learn_queries",
    "list_examples",
    "load_library",
    "read_examples",
    "save_library",
    "suggest_thresholds",
]
