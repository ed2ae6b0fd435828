"""How does a person read and write a motion template?

What must hold and for how long, one stretch a line, one after the other:

    # sweeping with a hand brush
    features: full-body-40
    for 1.5 s: right hand fast, spine horizontal, right hand low
    for 0.3 to 0.5 s: not right knee bent
    for 0.2 s: anything

or, where relations come and go at times of their own, by the time from the beginning:

    lasts 1.57 s
    throughout: not body moves fast
    from 0.4 to 1.1 s: right knee bent, left knee bent

Relations go by name or id, "not" in front of those that must not hold; what is not
mentioned is free. A line that ends in a comma goes on in the next one; the first line may
name the feature set.

A stretch has one length, and matching takes from half to double of it: one of a range gets
the length whose half and double cover the range.

Conventions: columns at 30 Hz; seconds are rounded to columns, ends are half-open.
"""

from dataclasses import replace

import numpy as np

from motionary.errors import InvalidInput
from motionary.features import FULL_BODY, FeatureSet, known_sets
from motionary.models.templates.parsing import FREE, States, parse_states
from motionary.models.templates.template import MotionTemplate, quantise
from motionary.models.templates.writing import write_states

_BY_HAND = "by hand"
# By state; that of free is the last.
_VALUES = np.array([0.0, 1.0, 0.5])


def template_from_text(
    text: str, *, feature_set: FeatureSet = FULL_BODY, name: str = ""
) -> MotionTemplate:
    """Template that a text describes: cells are 0, 1 or free, columns weigh 1.

    Parameters
    ----------
    text : lines as above
    feature_set : what the relations are called
    name : what is described, for the template's provenance

    Raises
    ------
    InvalidInput
        If a line is not understood, names an unknown relation or contradicts another one;
        names the line.
    """
    states = parse_states(text, feature_set)
    return MotionTemplate(
        values=_VALUES[states],
        weights=np.ones(len(states)),
        feature_names=feature_set.ids,
        feature_set=feature_set.name,
        provenance=f"{name}, designed {_BY_HAND}" if name else f"designed {_BY_HAND}",
    )


def template_to_text(
    template: MotionTemplate, *, tolerance: float, feature_set: FeatureSet | None = None
) -> str:
    """Text of a template's fixed cells, which `template_from_text` reads back to the same.

    Shares between and the weights of columns are not told; `revise_template` keeps them.

    Parameters
    ----------
    template : MotionTemplate
    tolerance : in [0, 0.5); as in `quantise`
    feature_set : gives the relations their phrases; sets that are known by their name
        need not be given

    Raises
    ------
    InvalidInput
        If the tolerance is out of range, or the set unknown or another one.
    """
    features = find_set(template, feature_set=feature_set)
    lines = [f"# {' '.join(template.provenance.split())}"] if template.provenance else []
    if template.unmeasured:
        names = dict(zip(features.ids, features.names, strict=True))
        unmeasured = ", ".join(names[id_] for id_ in template.unmeasured)
        lines.append(f"# measured in no example: {unmeasured}")
    lines.append(f"features: {features.name}")
    lines += write_states(_states(template, tolerance), features)
    return "\n".join(lines) + "\n"


def revise_template(
    template: MotionTemplate,
    text: str,
    *,
    tolerance: float,
    feature_set: FeatureSet | None = None,
) -> MotionTemplate:
    """Template that fixes what its edited text asks for.

    Where the text is as long as the template, cells whose state did not change keep their
    share of the examples, and columns their weights; a text of another length replaces all.

    Parameters
    ----------
    template : MotionTemplate
    text : `template_to_text` of the template, edited
    tolerance : what the text was made with
    feature_set : as in `template_to_text`

    Raises
    ------
    InvalidInput
        As in `template_from_text`.
    """
    features = find_set(template, feature_set=feature_set)
    provenance = template.provenance or "a template"
    if not provenance.endswith(_BY_HAND):
        provenance += f", edited {_BY_HAND}"
    states = parse_states(text, features)
    if len(states) != template.n_columns:
        new = template_from_text(text, feature_set=features)
        return replace(new, provenance=provenance)
    changed = states != _states(template, tolerance)
    if not changed.any():
        return template
    values = np.where(changed, _VALUES[states], template.values)
    return replace(template, values=values, provenance=provenance)


def find_set(template: MotionTemplate, *, feature_set: FeatureSet | None = None) -> FeatureSet:
    """The set of a template's relations: the given one, or the known one of its name.

    Raises
    ------
    InvalidInput
        If it is not known, or not the template's.
    """
    features = feature_set or known_sets().get(template.feature_set)
    if features is None:
        raise InvalidInput(
            f"the feature set {template.feature_set!r} is not known; pass feature_set=..."
        )
    if features.ids != template.feature_names:
        raise InvalidInput(
            f"the template has the features of {template.feature_set!r}, not those of "
            f"{features.name!r}; pass feature_set=... of the template"
        )
    return features


def _states(template: MotionTemplate, tolerance: float) -> States:
    quantised = quantise(template, tolerance=tolerance)
    return np.where(quantised.fixed, quantised.values, FREE).astype(np.int8)
