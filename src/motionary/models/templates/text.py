"""Motion templates as text that a person reads and writes.

What must hold and for how long, one segment a line, one after the other:

    # sweeping with a hand brush
    features: full-body-40
    for 1.5 s: right hand fast, spine horizontal, right hand low
    for 0.3 to 0.5 s: not right knee bent
    for 0.2 s: anything

or, where features come and go at times of their own, by the time from the beginning:

    lasts 1.57 s
    throughout: not body moves fast
    from 0.4 to 1.1 s: right knee bent, left knee bent

Features go by name or id, "not" in front of those that must not hold; what is not
mentioned is free. A line that ends in a comma goes on in the next one; the first line may
name the feature set.

A segment has one length, and matching takes from half to double of it: one of a range gets
the length whose half and double cover the range.

Conventions: columns at 30 Hz; seconds are rounded to columns, ends are half-open.
"""

import re
from dataclasses import replace

import numpy as np

from motionary.errors import InvalidInput
from motionary.features import FULL_BODY, FeatureSet, known_sets
from motionary.models.templates.parsing import ANYTHING, FREE, States, parse_states, show_seconds
from motionary.models.templates.template import MotionTemplate, quantise
from motionary.recording import split_runs

_BY_HAND = "by hand"
# By state; that of free is the last.
_VALUES = np.array([0.0, 1.0, 0.5])
_FEW_SEGMENTS = 4
_LINE_WIDTH = 96
# Would be read as something else.
_MISLEADING = re.compile(rf"[,:#]|^not |^{ANYTHING}$|^$")


def template_from_text(
    text: str, *, feature_set: FeatureSet = FULL_BODY, name: str = ""
) -> MotionTemplate:
    """Template that a text describes: cells are 0, 1 or free, columns weigh 1.

    Parameters
    ----------
    text : lines as above
    feature_set : what the features are called
    name : what is described, for the template's provenance

    Raises
    ------
    InvalidInput
        If a line is not understood, names an unknown feature or contradicts another one;
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

    Fractions between and the weights of columns are not written; `revise_template` keeps them.

    Parameters
    ----------
    template : MotionTemplate
    tolerance : in [0, 0.5); as in `quantise`
    feature_set : gives the features their phrases; sets that are known by their name
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
    lines += _write_states(_states(template, tolerance), features)
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
    fraction of the examples, and columns their weights; a text of another length replaces all.

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
    """The set of a template's features: the given one, or the known one of its name.

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


# -- writing ------------------------------------------------------------------------------


def _write_states(states: States, feature_set: FeatureSet) -> list[str]:
    """Lines that `parse_states` reads back to the same states."""
    phrases = _phrases(feature_set)
    if len(split_runs(states)) <= _FEW_SEGMENTS:
        return _write_in_turn(states, phrases)
    return _write_by_time(states, phrases)


def _phrases(feature_set: FeatureSet) -> list[str]:
    """What each feature is called: its name where that reads back, else its id."""
    names = [" ".join(name.split()).casefold() for name in feature_set.names]
    ids = [id_.casefold() for id_ in feature_set.ids]
    phrases = []
    for feature, name, id_ in zip(feature_set.features, names, ids, strict=True):
        readable = names.count(name) == 1 and name not in ids and not _MISLEADING.search(name)
        if not readable and (_MISLEADING.search(id_) or ids.count(id_) > 1):
            raise InvalidInput(
                f"feature {feature.id!r} of {feature_set.name!r} has no name that reads back; "
                "give it an id of letters and digits"
            )
        phrases.append(feature.name if readable else feature.id)
    return phrases


def _write_in_turn(states: States, phrases: list[str]) -> list[str]:
    lines = []
    for start, stop in split_runs(states):
        asked = [
            _with_sign(phrases[i], states[start, i]) for i in np.flatnonzero(states[start] != FREE)
        ]
        lines += _fold(f"for {show_seconds(stop - start)} s", asked or [ANYTHING])
    return lines


def _write_by_time(states: States, phrases: list[str]) -> list[str]:
    """Each run of each feature, those of the same time together, in the order of time."""
    runs: dict[tuple[int, int], list[str]] = {}
    for i, phrase in enumerate(phrases):
        for start, stop in split_runs(states[:, i]):
            if states[start, i] != FREE:
                runs.setdefault((start, stop), []).append(_with_sign(phrase, states[start, i]))
    lines = [f"lasts {show_seconds(len(states))} s"]
    lines += _fold("throughout", runs.pop((0, len(states)), []))
    for start, stop in sorted(runs):
        lines += _fold(f"from {show_seconds(start)} to {show_seconds(stop)} s", runs[start, stop])
    return lines


def _with_sign(phrase: str, state: np.int8) -> str:
    return phrase if state == 1 else f"not {phrase}"


def _fold(head: str, phrases: list[str]) -> list[str]:
    """A line of phrases, folded at its commas; nothing for none."""
    lines: list[str] = []
    for i, phrase in enumerate(phrases):
        comma = "," if i < len(phrases) - 1 else ""
        if i == 0:
            lines.append(f"{head}: {phrase}{comma}")
        elif len(lines[-1]) + len(phrase) + 2 > _LINE_WIDTH:
            lines.append(f"    {phrase}{comma}")
        else:
            lines[-1] += f" {phrase}{comma}"
    return lines
