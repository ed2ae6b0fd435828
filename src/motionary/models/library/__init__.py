"""Motion classes: what they are, how they are learned, how they lie on disk.

Training and what belongs to it is imported when it is first used (PEP 562).
"""

from typing import TYPE_CHECKING

from motionary.lazy import lazy_names
from motionary.models.library.assignment import (
    Candidates,
    JudgedLabel,
    PrototypePlace,
    calibrate_scores,
    check_has_scores,
    choose_candidates,
    false_rates_of,
    find_candidates,
    format_thresholds,
    join_matches,
    lowest_scores,
    measure_false_rates,
    thresholds_for,
)
from motionary.models.library.classes import (
    BODY_PARTS,
    THRESHOLD,
    TOLERANCE,
    MotionClass,
    Prototype,
    PrototypePattern,
    TrainingOptions,
    fractions_fixed,
)
from motionary.models.library.editing import (
    EVERYDAY,
    NO_LIBRARY,
    find_clashes,
    find_prototype,
    load_everyday,
    merge_libraries,
    open_library,
    remove_class,
    rename_class,
    replace_class,
    replace_template,
)
from motionary.models.library.scoring import (
    FalseRates,
    Scoring,
    fit_false_rates,
    fit_probability,
    measure_fractions,
    mix_prior,
    scoring_for,
)
from motionary.models.library.storage import ClassLibrary, load_library

if TYPE_CHECKING:
    from motionary.models.library.advice import Advice, advise
    from motionary.models.library.calibration import (
        Calibration,
        apply_calibrations,
        calibrate_thresholds,
    )
    from motionary.models.library.examples import (
        ReadExamples,
        cut_example,
        find_sequences,
        fold_sides,
        list_examples,
        list_tracks,
        mirror_sequence,
        read_examples,
        read_labelled,
    )
    from motionary.models.library.learning import Monitor, Notice, StrictMonitor, learn
    from motionary.models.library.relearning import (
        ClassEdit,
        EditedLibrary,
        add_examples,
        edit_class,
        join_classes,
        kept_examples,
        learn_beside,
        training_of,
    )
    from motionary.models.library.training import (
        N_FOLDS,
        Examples,
        QueriedLibrary,
        choose_queries,
        learn_classes,
        learn_queries,
        measure_background,
    )

__all__ = [
    "BODY_PARTS",
    "EVERYDAY",
    "NO_LIBRARY",
    "N_FOLDS",
    "THRESHOLD",
    "TOLERANCE",
    "Advice",
    "Calibration",
    "Candidates",
    "ClassEdit",
    "ClassLibrary",
    "EditedLibrary",
    "Examples",
    "FalseRates",
    "JudgedLabel",
    "Monitor",
    "MotionClass",
    "Notice",
    "Prototype",
    "PrototypePattern",
    "PrototypePlace",
    "QueriedLibrary",
    "ReadExamples",
    "Scoring",
    "StrictMonitor",
    "TrainingOptions",
    "add_examples",
    "advise",
    "apply_calibrations",
    "calibrate_scores",
    "calibrate_thresholds",
    "check_has_scores",
    "choose_candidates",
    "choose_queries",
    "cut_example",
    "edit_class",
    "false_rates_of",
    "find_candidates",
    "find_clashes",
    "find_prototype",
    "find_sequences",
    "fit_false_rates",
    "fit_probability",
    "fold_sides",
    "format_thresholds",
    "fractions_fixed",
    "join_classes",
    "join_matches",
    "kept_examples",
    "learn",
    "learn_beside",
    "learn_classes",
    "learn_queries",
    "list_examples",
    "list_tracks",
    "load_everyday",
    "load_library",
    "lowest_scores",
    "measure_background",
    "measure_false_rates",
    "measure_fractions",
    "merge_libraries",
    "mirror_sequence",
    "mix_prior",
    "open_library",
    "read_examples",
    "read_labelled",
    "remove_class",
    "rename_class",
    "replace_class",
    "replace_template",
    "scoring_for",
    "thresholds_for",
    "training_of",
]

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "advice": "Advice advise",
        "calibration": "Calibration apply_calibrations calibrate_thresholds",
        "examples": (
            "ReadExamples cut_example find_sequences fold_sides list_examples list_tracks "
            "mirror_sequence read_examples read_labelled"
        ),
        "learning": "Monitor Notice StrictMonitor learn",
        "relearning": (
            "ClassEdit EditedLibrary add_examples edit_class join_classes kept_examples "
            "learn_beside training_of"
        ),
        "training": (
            "Examples N_FOLDS QueriedLibrary choose_queries learn_classes learn_queries "
            "measure_background"
        ),
    },
)
