"""Motion classes, their prototypes, and the options that they are trained with.

A class is one name for one or more templates, its prototypes (left and right, ways of doing
the same), with the threshold below which a match counts.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple, get_args

import numpy as np

from motionary.errors import InvalidInput
from motionary.features import FeatureSequence
from motionary.matching import WHOLE_BODY, CellRatios, Pattern, cell_ratios
from motionary.models.keyframes import KeyframeQuery, check_features
from motionary.models.query_learning import RUNS
from motionary.models.templates import MotionTemplate, QuantisedTemplate, pattern_of, quantise

#: Müller and Röder (2006), section 5.4: a good trade-off between precision and recall.
THRESHOLD = 0.06
#: Müller, Baak and Seidel (2009), section 3.
TOLERANCE = 0.05

#: Where the keyframe queries of classes come from: the genetic algorithm, or a choice of
#: keyframes.
QuerySource = Literal["none", "learned", "chosen"]
#: Labels of events are counted one by one; those of a state that follow each other are one.
ClassKind = Literal["event", "state"]
#: Parts of the body that classes may need; labels that need different ones may overlap.
BODY_PARTS = ("arms", "legs", "trunk")


@dataclass(frozen=True, slots=True)
class TrainingOptions:
    """Settings of training, which a library remembers.

    Attributes
    ----------
    threshold, tolerance : of the classes; defaults of the publications of 2006 and 2009
    mirror : also learn the mirror image of every template, as a prototype
    by_self_information : whether features that rarely hold among the examples weigh more;
        False weighs all alike, as published
    keep_examples : keep the examples' packed features in the library, so that its classes
        can learn from more later as if from all at once
    calibrate : choose each class's threshold by cross-validation, and keep the estimates
    groups : regular expression on the names of examples, such as "HDM_(..)_" for actors;
        those with the same match are held out together; without it, those of a person, where
        all examples say whose they are
    fold_sides : take each example as it is or mirrored, as it fits the others of its
        prototype best: for motions that people do on either side
    queries : where keyframe queries come from; "none" matches templates everywhere
    query_runs : so many learned queries vote
    per_group : beside the template of all examples of a prototype learn one of each of the
        `groups`: people differ in ways that a mean does not hold
    provenance, licence : written into the library
    """

    threshold: float = THRESHOLD
    tolerance: float = TOLERANCE
    mirror: bool = False
    by_self_information: bool = True
    keep_examples: bool = False
    calibrate: bool = False
    groups: str | None = None
    fold_sides: bool = False
    queries: QuerySource = "none"
    query_runs: int = RUNS
    per_group: bool = False
    provenance: str = ""
    licence: str = ""

    def __post_init__(self) -> None:
        if self.queries not in get_args(QuerySource):
            raise InvalidInput(
                f"queries must be one of {', '.join(get_args(QuerySource))}, got {self.queries!r}"
            )
        if self.query_runs < 1:
            raise InvalidInput(f"query_runs must be at least 1, got {self.query_runs}")
        if self.per_group and self.groups is None:
            raise InvalidInput("per_group needs groups, an expression that tells people apart")
        if self.per_group and (self.keep_examples or self.queries != "none"):
            raise InvalidInput("per_group goes neither with keep_examples nor with queries")


@dataclass(frozen=True, slots=True, eq=False)
class Prototype:
    """One template of a class, under a name of its own.

    Attributes
    ----------
    name : unique within the class
    template : what its examples have in common
    queries : of keyframes; the template is matched only around their hits, if there are any
    votes : so many of the queries must agree
    examples : packed features of what it was learned from, if they are kept to learn further
    mirror_of : name of the prototype whose mirror image it is; empty if it is of its own
    """

    name: str
    template: MotionTemplate
    queries: tuple[KeyframeQuery, ...] = ()
    votes: int = 1
    examples: tuple[FeatureSequence, ...] = ()
    mirror_of: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "queries", tuple(self.queries))
        object.__setattr__(self, "examples", tuple(self.examples))
        for example in self.examples:
            if example.feature_set.ids != self.template.feature_names:
                raise InvalidInput(
                    f"template {self.name!r} is over {self.template.feature_set!r}, an example "
                    f"of it over {example.feature_set.name!r}"
                )
        for query in self.queries:
            check_features(query, self.template.feature_set, self.template.feature_names)
        if self.queries:
            # Late: whoever has no queries does not wait for what finds them.
            from motionary.models.keyframes import check_votes

            check_votes(self.votes, n_queries=len(self.queries))

    @property
    def keeps_examples(self) -> bool:
        """Whether every example that it was learned from is kept."""
        return len(self.examples) == self.template.n_examples


class PrototypePattern(NamedTuple):
    """A prototype's template with fixed and free cells, and what the matcher looks for."""

    template: QuantisedTemplate
    pattern: Pattern


# Without slots, which leave no room for what is computed once.
@dataclass(frozen=True, eq=False)
class MotionClass:
    """A named class of motion.

    Attributes
    ----------
    name : what labels are called
    prototypes : its templates, at least one
    threshold : largest cost of a match
    tolerance : a cell of a template is fixed if at most this fraction of examples differs
    background : fraction of frames in which each feature holds, in the recordings that were
        known when the class was learned; what is rare there weighs more. Empty: all
        entries weigh the same, as published.
    estimated_precision, estimated_recall : what to expect at this threshold, as measured by
        cross-validation when it was calibrated; None if it was not
    prior : fraction of frames of motion in general in which each feature holds; labels are
        assigned by scores against it. Empty: by costs alone.
    kind : "event", whose labels are counted one by one, or "state", whose neighbours are one
    parts : parts of the body that it needs; empty: all
    score_threshold : least score of its labels; None: the library's
    false_level : logarithm of its false labels a minute, of scores from `scoring.TAIL`
        on; None if unknown
    provenance, licence : of this class, where they differ from the library's; they go with
        it into other libraries
    """

    name: str
    prototypes: tuple[Prototype, ...]
    threshold: float = THRESHOLD
    tolerance: float = TOLERANCE
    background: tuple[float, ...] = ()
    estimated_precision: float | None = None
    estimated_recall: float | None = None
    prior: tuple[float, ...] = ()
    kind: ClassKind = "event"
    parts: tuple[str, ...] = ()
    score_threshold: float | None = None
    false_level: float | None = None
    provenance: str = ""
    licence: str = ""

    def __post_init__(self) -> None:
        if not self.name:
            raise InvalidInput("a class needs a name, got an empty one")
        if not self.prototypes:
            raise InvalidInput(f"class {self.name!r} needs at least one template, got none")
        self._check_prototypes()
        for key in ("background", "prior"):
            object.__setattr__(self, key, tuple(map(float, getattr(self, key))))
        self._check_settings()
        object.__setattr__(self, "threshold", float(self.threshold))
        object.__setattr__(self, "tolerance", float(self.tolerance))
        object.__setattr__(self, "parts", tuple(self.parts))

    def __repr__(self) -> str:
        names = ", ".join(one.name for one in self.prototypes)
        return f"MotionClass({self.name!r}, {len(self.prototypes)} templates: {names[:200]})"

    def _check_prototypes(self) -> None:
        originals = {one.name for one in self.originals}
        if len({one.name for one in self.prototypes}) != len(self.prototypes):
            raise InvalidInput(f"class {self.name!r}: names of prototypes must be unique")
        for one in self.prototypes:
            if one.mirror_of and one.mirror_of not in originals:
                raise InvalidInput(
                    f"class {self.name!r}: mirror_of of {one.name!r} must name a prototype that "
                    f"is no mirror image, got {one.mirror_of!r}"
                )

    def _check_settings(self) -> None:
        n, least = self.prototypes[0].template.n_features, self.score_threshold
        estimates = {key: getattr(self, key) for key in ("estimated_precision", "estimated_recall")}
        fractions = {key: getattr(self, key) for key in ("background", "prior")}
        for key, fits, problem in (
            ("threshold", 0 <= self.threshold <= 1, f"must lie in [0, 1], got {self.threshold}"),
            ("tolerance", 0 <= self.tolerance < 0.5,
             f"must be at least 0 and below 0.5, got {self.tolerance}"),
            ("score_threshold", least is None or least > 0, f"must be above 0, got {least}"),
            *((key, x is None or 0 <= x <= 1, f"must lie in [0, 1], got {x}")
              for key, x in estimates.items()),
            ("kind", self.kind in get_args(ClassKind),
             f"must be event or state, got {self.kind!r}"),
            ("parts", set(self.parts) <= set(BODY_PARTS),
             f"must be of {', '.join(BODY_PARTS)}, got {', '.join(map(str, self.parts))}"),
            *((key, not xs or (len(xs) == n and all(0 < x < 1 for x in xs)),
               f"needs {n} fractions between 0 and 1") for key, xs in fractions.items()),
        ):  # fmt: skip
            if not fits:
                raise InvalidInput(f"class {self.name!r}: {key} {problem}", key=key)

    @property
    def originals(self) -> tuple[Prototype, ...]:
        """Its prototypes but for mirror images."""
        return tuple(one for one in self.prototypes if not one.mirror_of)

    @property
    def has_queries(self) -> bool:
        """Whether a prototype has keyframe queries."""
        return any(one.queries for one in self.prototypes)

    @property
    def parts_mask(self) -> int:
        """Bits of the parts of the body that it needs, as `Intervals` takes them."""
        bits = (1 << i for i, part in enumerate(BODY_PARTS) if part in self.parts)
        return sum(bits) or WHOLE_BODY

    @cached_property
    def quantised(self) -> tuple[QuantisedTemplate, ...]:
        """Templates of the prototypes with fixed and free cells; computed once.

        Raises
        ------
        InvalidInput
            If one of them is free everywhere: it would match anything at no cost.
        """
        result = tuple(quantise(s.template, tolerance=self.tolerance) for s in self.prototypes)
        for prototype, template in zip(self.prototypes, result, strict=True):
            if template.n_fixed == 0:
                raise InvalidInput(
                    f"template {prototype.name!r} has no fixed cell at tolerance "
                    f"{self.tolerance}, so it would match everything; its examples have "
                    "nothing in common: split the class or raise the tolerance"
                )
        return result

    @cached_property
    def patterns(self) -> tuple[PrototypePattern, ...]:
        """Quantised template and pattern of each prototype; computed once."""
        ones = np.array(self.background) if self.background else None
        return tuple(PrototypePattern(one, pattern_of(one, ones=ones)) for one in self.quantised)

    @cached_property
    def ratios(self) -> tuple[CellRatios, ...]:
        """Log-likelihood ratios of the cells of each prototype; computed once.

        Raises
        ------
        InvalidInput
            If the class has no prior.
        """
        if not self.prior:
            raise InvalidInput(
                f"class {self.name!r} has no prior of its features, which scores need; learn it "
                "again, or assign labels by costs (assignment published)"
            )
        prior = np.array(self.prior)
        return tuple(
            cell_ratios(one.template.values, prior, n_examples=one.template.n_examples)
            for one in self.prototypes
        )


def fractions_fixed(motion_class: MotionClass) -> list[float]:
    """Fraction of the cells that are fixed, of each prototype."""
    templates = (one.template for one in motion_class.prototypes)
    return [quantise(one, tolerance=motion_class.tolerance).fraction_fixed for one in templates]
