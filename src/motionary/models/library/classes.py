"""What is a motion class, and a library of them?

A class is one name for one or more templates (subclasses: left and right, ways of doing
it) with the threshold below which a match counts.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from motionary.errors import InvalidInput
from motionary.features import FULL_BODY, FeatureSequence, FeatureSet
from motionary.matching import Pattern
from motionary.models.keyframes import KeyframeQuery, check_features, check_votes
from motionary.models.templates import MotionTemplate, QuantisedTemplate, pattern_of, quantise

#: Müller and Röder (2006), section 5.4: a good trade-off between precision and recall.
THRESHOLD = 0.06
#: Müller, Baak and Seidel (2009), section 3.
TOLERANCE = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class Prototype:
    """One template of a class, under a name of its own.

    Attributes
    ----------
    name : unique within the class
    template : what its examples have in common
    queries : of keyframes; the template is matched only around their hits, if there are any
    votes : so many of the queries must agree
    examples : words of what it was learned from, if they are kept to learn further
    """

    name: str
    template: MotionTemplate
    queries: tuple[KeyframeQuery, ...] = ()
    votes: int = 1
    examples: tuple[FeatureSequence, ...] = ()

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
            check_votes(self.votes, n_queries=len(self.queries))


@dataclass(frozen=True, slots=True, eq=False)
class MotionClass:
    """A named class of motion.

    Attributes
    ----------
    name : what labels are called
    subclasses : its templates, at least one
    threshold : largest cost of a match
    tolerance : a cell of a template is fixed if at most this share of examples differs
    background : share of frames in which each relation holds, in the recordings that were
        known when the class was learned; what is rare there weighs more. Empty: all
        entries weigh the same, as published.
    promised_precision, promised_recall : what to expect at this threshold, as measured on
        examples held out when it was suggested; None if it was not
    """

    name: str
    prototypes: tuple[Prototype, ...]
    threshold: float = THRESHOLD
    tolerance: float = TOLERANCE
    background: tuple[float, ...] = ()
    estimated_precision: float | None = None
    estimated_recall: float | None = None

    def __post_init__(self) -> None:
        if not self.name:
            raise InvalidInput("a class needs a name, got an empty one")
        if not self.prototypes:
            raise InvalidInput(f"class {self.name!r} needs at least one template, got none")
        names = [s.name for s in self.prototypes]
        if len(set(names)) != len(names):
            raise InvalidInput(f"class {self.name!r}: names of subclasses must be unique")
        if not 0 <= self.threshold <= 1:
            raise InvalidInput(
                f"class {self.name!r}: threshold must lie in [0, 1], got {self.threshold}"
            )
        if not 0 <= self.tolerance < 0.5:
            raise InvalidInput(
                f"class {self.name!r}: tolerance must be at least 0 and below 0.5, "
                f"got {self.tolerance}"
            )
        estimates = {
            "promised_precision": self.estimated_precision,
            "promised_recall": self.estimated_recall,
        }
        for key, fraction in estimates.items():
            if fraction is not None and not 0 <= fraction <= 1:
                raise InvalidInput(f"class {self.name!r}: {key} must lie in [0, 1], got {fraction}")
        n_features = self.prototypes[0].template.n_features
        fractions = tuple(float(fraction) for fraction in self.background)
        if fractions and (len(fractions) != n_features or not all(0 < s < 1 for s in fractions)):
            raise InvalidInput(
                f"class {self.name!r}: background needs {n_features} shares between 0 and 1"
            )
        object.__setattr__(self, "threshold", float(self.threshold))
        object.__setattr__(self, "tolerance", float(self.tolerance))
        object.__setattr__(self, "background", fractions)

    def quantised(self) -> tuple[QuantisedTemplate, ...]:
        """Templates of the subclasses with fixed and free cells.

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

    def sought(self) -> tuple[tuple[QuantisedTemplate, Pattern], ...]:
        """Quantised templates with the patterns that the matcher looks for."""
        ones = np.array(self.background) if self.background else None
        return tuple((template, pattern_of(template, ones=ones)) for template in self.quantised())


@dataclass(frozen=True, slots=True, eq=False)
class ClassLibrary:
    """Classes over one feature set; the order of the classes breaks ties.

    Attributes
    ----------
    classes : with unique names
    feature_set : what the templates' features are
    provenance, licence : where the classes come from and how they may be used
    """

    classes: tuple[MotionClass, ...]
    feature_set: FeatureSet = FULL_BODY
    provenance: str = ""
    licence: str = ""

    def __post_init__(self) -> None:
        if len(set(self.names)) != len(self.names):
            raise InvalidInput("a library needs unique class names")
        for motion_class in self.classes:
            for prototype in motion_class.prototypes:
                if prototype.template.feature_names != self.feature_set.ids:
                    raise InvalidInput(
                        f"template {prototype.name!r} has the features of "
                        f"{prototype.template.feature_set!r}, the library those of "
                        f"{self.feature_set.name!r}; learn it again with the library's"
                    )

    def __iter__(self) -> Iterator[MotionClass]:
        return iter(self.classes)

    def __len__(self) -> int:
        return len(self.classes)

    def __getitem__(self, name: str) -> MotionClass:
        for motion_class in self.classes:
            if motion_class.name == name:
                return motion_class
        known = ", ".join(self.names) or "none"
        raise InvalidInput(f"the library has no class {name!r}; its classes are: {known}")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the classes, in order."""
        return tuple(c.name for c in self.classes)

    def save(self, folder: str | Path) -> None:
        """Write the library to a folder of readable files; see `storage`.

        Raises
        ------
        UnwritableFile
            If the folder cannot be written, or holds something that is no library.
        """
        from motionary.models.library.storage import save_library

        save_library(self, folder)

    @staticmethod
    def load(folder: str | Path, *, feature_sets: Sequence[FeatureSet] = ()) -> "ClassLibrary":
        """Read a library from its folder; see `load_library`.

        Raises
        ------
        UnreadableFile
            If the folder holds no library, a newer one, or one that does not fit together.
        """
        from motionary.models.library.storage import load_library

        return load_library(folder, feature_sets=feature_sets)
