"""Find and name motions in any motion capture from a few examples, and say why.

The public names and the modules they come from. A module is imported when one of its names
is first used (PEP 562), so that `import motionary` is quick.
"""

from typing import TYPE_CHECKING

from motionary.lazy import lazy_names

if TYPE_CHECKING:
    from motionary.errors import MotionaryError
    from motionary.evaluation import evaluate
    from motionary.features import FeatureSequence, FeatureSet, compute_features
    from motionary.inertial import check_tracking
    from motionary.io import read, read_labels, write, write_labels
    from motionary.labels import Label, LabelTrack, count
    from motionary.live import LiveAnnotator
    from motionary.models.keyframes import KeyframeQuery
    from motionary.models.library import ClassLibrary, MotionClass, learn
    from motionary.models.templates import MotionTemplate
    from motionary.motion import Motion, Skeleton
    from motionary.multiview import track, untangle
    from motionary.recording import Recording
    from motionary.reporting import report, report_comparison, report_hits, report_library
    from motionary.retrieval.annotation import annotate
    from motionary.retrieval.explanation import explain
    from motionary.retrieval.index import Index
    from motionary.retrieval.search import Hit, search

__version__ = "0.1.0"

__all__ = [
    "ClassLibrary", "FeatureSequence", "FeatureSet", "Hit", "Index", "KeyframeQuery", "Label",
    "LabelTrack", "LiveAnnotator", "Motion", "MotionClass", "MotionTemplate", "MotionaryError",
    "Recording", "Skeleton", "annotate", "check_tracking", "compute_features", "count", "evaluate",
    "explain", "learn", "read", "read_labels", "report", "report_comparison", "report_hits",
    "report_library", "search", "track", "untangle", "write", "write_labels",
]  # fmt: skip

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "retrieval.annotation": "annotate",
        "errors": "MotionaryError",
        "evaluation": "evaluate",
        "retrieval.explanation": "explain",
        "features": "FeatureSequence FeatureSet compute_features",
        "retrieval.index": "Index",
        "inertial": "check_tracking",
        "io": "read read_labels write write_labels",
        "models.keyframes": "KeyframeQuery",
        "labels": "Label LabelTrack count",
        "live": "LiveAnnotator",
        "models.library": "ClassLibrary MotionClass learn",
        "motion": "Motion Skeleton",
        "multiview": "track untangle",
        "recording": "Recording",
        "reporting": "report report_comparison report_hits report_library",
        "retrieval.search": "Hit search",
        "models.templates": "MotionTemplate",
    },
)
