"""Find and name motions in any motion capture from a few examples, and say why.

This page is a table of contents: each public name and the module it comes from. A module
is imported when one of its names is first used, so that `import motionary` is quick.
"""

import importlib
import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from motionary.annotation import annotate
    from motionary.errors import MotionaryError
    from motionary.evaluation import evaluate
    from motionary.explanation import explain
    from motionary.features import FeatureSequence, FeatureSet, compute_features
    from motionary.index import Index
    from motionary.io import read, read_labels, write, write_labels
    from motionary.keyframes import KeyframeQuery
    from motionary.labels import Label, LabelTrack
    from motionary.library import ClassLibrary, MotionClass, learn
    from motionary.motion import Motion, Skeleton
    from motionary.search import Hit, search
    from motionary.templates import MotionTemplate

__version__ = "0.1.0"

__all__ = [
    "ClassLibrary",
    "FeatureSequence",
    "FeatureSet",
    "Hit",
    "Index",
    "KeyframeQuery",
    "Label",
    "LabelTrack",
    "Motion",
    "MotionClass",
    "MotionTemplate",
    "MotionaryError",
    "Skeleton",
    "annotate",
    "compute_features",
    "evaluate",
    "explain",
    "learn",
    "read",
    "read_labels",
    "search",
    "write",
    "write_labels",
]

_CONTENTS = {
    "annotation": ("annotate",),
    "errors": ("MotionaryError",),
    "evaluation": ("evaluate",),
    "explanation": ("explain",),
    "features": ("FeatureSequence", "FeatureSet", "compute_features"),
    "index": ("Index",),
    "io": ("read", "read_labels", "write", "write_labels"),
    "keyframes": ("KeyframeQuery",),
    "labels": ("Label", "LabelTrack"),
    "library": ("ClassLibrary", "MotionClass", "learn"),
    "motion": ("Motion", "Skeleton"),
    "search": ("Hit", "search"),
    "templates": ("MotionTemplate",),
}
_HOME = {name: module for module, names in _CONTENTS.items() for name in names}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'motionary' has no attribute {name!r}")
    value = getattr(importlib.import_module(f"motionary.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


class _Contents(ModuleType):
    def __setattr__(self, name: str, value: object) -> None:
        # Importing the module `search` would hide the function of that name.
        if not (name in _HOME and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Contents
