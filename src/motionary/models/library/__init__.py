"""Motion classes: what they are, how they are learned, how they lie on disk."""

from motionary.models.library.advice import Advice, advise
from motionary.models.library.classes import (
    THRESHOLD,
    TOLERANCE,
    ClassLibrary,
    MotionClass,
    Prototype,
)
from motionary.models.library.editing import (
    find_clashes,
    find_prototype,
    merge_libraries,
    remove_class,
    rename_class,
    replace_class,
    replace_template,
)
from motionary.models.library.examples import Examples, ReadExamples, list_examples, read_examples
from motionary.models.library.expansion import (
    add_examples,
    join_classes,
    keeps_examples,
    kept_examples,
)
from motionary.models.library.holding_out import N_FOLDS
from motionary.models.library.keyframe_classes import class_of_query
from motionary.models.library.learning import learn
from motionary.models.library.querying import QueriedLibrary, choose_queries, learn_queries
from motionary.models.library.storage import load_library, save_library
from motionary.models.library.thresholds import (
    Calibration,
    apply_calibrations,
    calibrate_thresholds,
)
from motionary.models.library.training import TrainingOptions, learn_classes

__all__ = [
    "N_FOLDS",
    "THRESHOLD",
    "TOLERANCE",
    "Advice",
    "Calibration",
    "ClassLibrary",
    "Examples",
    "MotionClass",
    "Prototype",
    "QueriedLibrary",
    "ReadExamples",
    "TrainingOptions",
    "add_examples",
    "advise",
    "apply_calibrations",
    "calibrate_thresholds",
    "choose_queries",
    "class_of_query",
    "find_clashes",
    "find_prototype",
    "join_classes",
    "keeps_examples",
    "kept_examples",
    "learn",
    "learn_classes",
    "learn_queries",
    "list_examples",
    "load_library",
    "merge_libraries",
    "read_examples",
    "remove_class",
    "rename_class",
    "replace_class",
    "replace_template",
    "save_library",
]
