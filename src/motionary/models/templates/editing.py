"""Templates edited by hand.

Class templates can be restricted to some features, loosened where they ask too much, and
put together, without further examples: Müller and Röder (2006), section 5.4; two classes
joined into one, figure 5 (c).

Conventions: times in seconds from the template's beginning, by its columns at 30 Hz;
features by name or id; a free cell is 0.5. Templates come back new, never changed.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.features import FeatureSet, find_feature
from motionary.models.templates.alignment import align_batched
from motionary.models.templates.learning import Learning, Stack, repeat_passes
from motionary.models.templates.parsing import count_columns, fit_columns, show_seconds
from motionary.models.templates.template import MotionTemplate
from motionary.models.templates.text import find_set

_FREE = 0.5
#: Two templates are averaged as up to so many copies, in the ratio of their examples.
_MOST_COPIES = 20


class Pause(NamedTuple):
    """A segment between templates in which anything may happen.

    Attributes
    ----------
    least_s, most_s : seconds; the longest at most four times the shortest
    """

    least_s: float
    most_s: float


def restrict(
    template: MotionTemplate, features: Collection[str], *, feature_set: FeatureSet | None = None
) -> MotionTemplate:
    """Template that asks for some features only; all others are free.

    Raises
    ------
    InvalidInput
        If a feature is unknown, or none is given.
    """
    kept = _numbers(template, features, feature_set)
    if not kept:
        raise InvalidInput("restricting needs at least one feature to keep, got none")
    values = np.full(template.values.shape, _FREE)
    values[:, kept] = template.values[:, kept]
    return _changed(template, values, f"restricted to {len(kept)} features")


def free(
    template: MotionTemplate,
    features: Collection[str] | None = None,
    *,
    start_s: float = 0.0,
    end_s: float | None = None,
    feature_set: FeatureSet | None = None,
) -> MotionTemplate:
    """Template that leaves features open in a segment; all of them if none are given.

    Raises
    ------
    InvalidInput
        If a feature is unknown, or the segment not in the template.
    """
    values = template.values.copy()
    part = _part(template, start_s, end_s)
    chosen = (
        range(template.n_features)
        if features is None
        else _numbers(template, features, feature_set)
    )
    values[part, list(chosen)] = _FREE
    return _changed(template, values, "loosened by hand")


def fix(
    template: MotionTemplate,
    features: Mapping[str, bool],
    *,
    start_s: float = 0.0,
    end_s: float | None = None,
    feature_set: FeatureSet | None = None,
) -> MotionTemplate:
    """Template that asks for features to hold, or not to hold, in a segment.

    Raises
    ------
    InvalidInput
        If a feature is unknown, or the segment not in the template.
    """
    values = template.values.copy()
    part = _part(template, start_s, end_s)
    for name, holds in features.items():
        values[part, _numbers(template, [name], feature_set)] = float(holds)
    return _changed(template, values, "fixed by hand")


def cut(
    template: MotionTemplate, *, start_s: float = 0.0, end_s: float | None = None
) -> MotionTemplate:
    """Part of a template.

    Raises
    ------
    InvalidInput
        If the segment is empty or not in the template.
    """
    part = _part(template, start_s, end_s)
    shorter = replace(template, values=template.values[part], weights=template.weights[part].copy())
    return _changed(shorter, shorter.values, "cut by hand")


def join(
    first: MotionTemplate, second: MotionTemplate, *, learning: Learning | None = None
) -> MotionTemplate:
    """One template for two classes: what separates them becomes free.

    Learned from the two templates as if they were examples, each with the weight of the
    examples that it stands for, rounded to twentieths. Where the examples are at hand,
    learn from all of them instead: `learn_template`.

    Raises
    ------
    InvalidInput
        If the templates are over different features.
    """
    _check_same_features([first, second])
    n_examples = first.n_examples + second.n_examples
    fraction = Fraction(first.n_examples, n_examples).limit_denominator(_MOST_COPIES)
    fraction = min(max(fraction, Fraction(1, _MOST_COPIES)), 1 - Fraction(1, _MOST_COPIES))
    copies = [first] * fraction.numerator + [second] * (fraction.denominator - fraction.numerator)
    offsets = np.cumsum([0] + [t.n_columns for t in copies]).astype(np.intp)
    stack = Stack(
        np.concatenate([t.values for t in copies]),
        np.concatenate([t.weights for t in copies]),
        offsets,
    )
    stack = repeat_passes(stack, first.n_features, learning or Learning(), align_batched)
    end = stack.offsets[1]
    names = [t.provenance or "a template" for t in (first, second)]
    return replace(
        first,
        values=stack.columns[:end],
        weights=stack.weights[:end],
        provenance=f"joined from: {names[0]}; {names[1]}",
        n_examples=n_examples,
        unmeasured=tuple(name for name in first.unmeasured if name in second.unmeasured),
    )


def concatenate(parts: Sequence[MotionTemplate | Pause]) -> MotionTemplate:
    """One template after the other, with pauses in which anything may happen.

    A pause matches every length of its range, and somewhat beyond: from half to double of
    its geometric mean. It costs nothing, so the cost of the whole, a mean over all
    columns, is smaller than that of its parts; thresholds shrink with it.

    Raises
    ------
    InvalidInput
        If there is no template, templates are over different features, or a pause is empty
        or too wide.
    """
    templates = [part for part in parts if isinstance(part, MotionTemplate)]
    if not templates:
        raise InvalidInput("concatenating needs at least one template, got none")
    _check_same_features(templates)
    values, weights = [], []
    for part in parts:
        if isinstance(part, Pause):
            n_columns = fit_columns(part.least_s, part.most_s)
            values.append(np.full((n_columns, templates[0].n_features), _FREE))
            weights.append(np.ones(n_columns))
        else:
            values.append(part.values)
            weights.append(part.weights)
    names = [t.provenance or "a template" for t in templates]
    return replace(
        templates[0],
        values=np.concatenate(values),
        weights=np.concatenate(weights),
        provenance=f"one after the other: {'; '.join(names)}",
        n_examples=min(t.n_examples for t in templates),
    )


def _numbers(
    template: MotionTemplate, features: Collection[str], feature_set: FeatureSet | None
) -> list[int]:
    known = find_set(template, feature_set=feature_set)
    # A string is a collection of letters, and would be taken for as many features.
    names = [features] if isinstance(features, str) else features
    return [find_feature(name, known) for name in names]


def _part(template: MotionTemplate, start_s: float, end_s: float | None) -> slice:
    start = count_columns(start_s, least=0)
    stop = template.n_columns if end_s is None else count_columns(end_s)
    if not start < stop <= template.n_columns:
        ends = f"{start_s:g} s to the end" if end_s is None else f"{start_s:g} to {end_s:g} s"
        raise InvalidInput(
            f"a segment needs to lie in the template, 0 to {show_seconds(template.n_columns)} s, "
            f"got {ends}"
        )
    return slice(start, stop)


def _changed(template: MotionTemplate, values: NDArray[np.float64], how: str) -> MotionTemplate:
    origin = template.provenance or "a template"
    provenance = origin if origin.endswith(how) else f"{origin}, {how}"
    return replace(template, values=values, provenance=provenance)


def _check_same_features(templates: Sequence[MotionTemplate]) -> None:
    first = templates[0]
    for other in templates[1:]:
        if (other.feature_set, other.feature_names) != (first.feature_set, first.feature_names):
            raise InvalidInput(
                f"templates need the same features to be put together, got "
                f"{first.feature_set!r} ({first.n_features}) and {other.feature_set!r} "
                f"({other.n_features}); learn both with one feature set"
            )
