"""Motion templates: what the examples of one class of motion have in common."""

from motionary.templates.learning import Learning, learn_template
from motionary.templates.seeking import pattern_of
from motionary.templates.template import (
    RATE_HZ,
    MotionTemplate,
    QuantisedTemplate,
    mirror,
    quantise,
)

__all__ = [
    "RATE_HZ",
    "Learning",
    "MotionTemplate",
    "QuantisedTemplate",
    "learn_template",
    "mirror",
    "pattern_of",
    "quantise",
]
