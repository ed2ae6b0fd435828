"""Motion templates: what the examples of one class of motion have in common.

Learned from examples, shaped by hand, or written down.
"""

from motionary.models.templates.alignment import PairCost, align_batched
from motionary.models.templates.editing import (
    Pause,
    concatenate,
    cut,
    describe_template,
    fix,
    free,
    restrict,
)
from motionary.models.templates.learning import Learning, join, learn_template, template_of
from motionary.models.templates.template import (
    RATE_HZ,
    ROUNDING_SLACK,
    MotionTemplate,
    QuantisedTemplate,
    mirror,
    pattern_of,
    quantise,
)
from motionary.models.templates.text import revise_template, template_from_text, template_to_text

__all__ = [
    "RATE_HZ",
    "ROUNDING_SLACK",
    "Learning",
    "MotionTemplate",
    "PairCost",
    "Pause",
    "QuantisedTemplate",
    "align_batched",
    "concatenate",
    "cut",
    "describe_template",
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
    "template_of",
    "template_to_text",
]
