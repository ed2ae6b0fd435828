"""Motion templates: what the examples of one class of motion have in common.

Learned from examples, shaped by hand, or written down from nothing.
"""

from motionary.models.templates.crafting import Pause, concatenate, cut, fix, free, join, restrict
from motionary.models.templates.learning import Learning, learn_template
from motionary.models.templates.seeking import pattern_of
from motionary.models.templates.template import (
    RATE_HZ,
    MotionTemplate,
    QuantisedTemplate,
    mirror,
    quantise,
)
from motionary.models.templates.text import revise_template, template_from_text, template_to_text

__all__ = [
    "RATE_HZ",
    "Learning",
    "MotionTemplate",
    "Pause",
    "QuantisedTemplate",
    "concatenate",
    "cut",
    "fix",
    "free",
    "join",
    "learn_template",
    "mirror",
    "pattern_of",
    "quantise",
    "restrict",
    "revise_template",
    "template_from_text",
    "template_to_text",
]
