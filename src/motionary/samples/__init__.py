"""Synthetic motions: where no recording is at hand, and said to be synthetic."""

from motionary.samples.classes import PHRASES, SYNTHETIC_CLASSES
from motionary.samples.making import Stretch, synthetic_motion, synthetic_stream
from motionary.samples.phrases import parse_phrases

__all__ = [
    "PHRASES",
    "SYNTHETIC_CLASSES",
    "Stretch",
    "parse_phrases",
    "synthetic_motion",
    "synthetic_stream",
]
