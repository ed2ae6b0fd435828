"""Motion classes: what they are, how they are learned, how they lie on disk."""

from motionary.library.classes import ClassLibrary, MotionClass, Subclass
from motionary.library.examples import Examples, ReadExamples, list_examples, read_examples
from motionary.library.learning import learn
from motionary.library.storage import load_library, save_library
from motionary.library.teaching import Teaching, learn_classes

__all__ = [
    "ClassLibrary",
    "Examples",
    "MotionClass",
    "ReadExamples",
    "Subclass",
    "Teaching",
    "learn",
    "learn_classes",
    "list_examples",
    "load_library",
    "read_examples",
    "save_library",
]
