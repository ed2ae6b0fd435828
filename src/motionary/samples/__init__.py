"""Synthetic motions: where no recording is at hand, and said to be synthetic."""

from motionary.samples.figure import NamedSegment, synthetic_motion, synthetic_stream
from motionary.samples.phrases import PHRASES, SYNTHETIC_CLASSES, parse_phrases

__all__ = [
    "PHRASES",
    "SYNTHETIC_CLASSES",
    "NamedSegment",
    "parse_phrases",
    "synthetic_motion",
    "synthetic_stream",
]
