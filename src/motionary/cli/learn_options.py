"""Which options has `motionary learn`?"""

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated

import typer

from motionary.cli.options import FeatureSetName, LibraryDefault

if TYPE_CHECKING:
    from motionary.models.library import TrainingOptions

_TRAINING = "motionary.models.library:TrainingOptions"


class Queries(StrEnum):
    """Where the keyframe queries of a class come from."""

    NONE = "none"
    LEARNED = "learned"
    CHOSEN = "chosen"


@dataclass(frozen=True, kw_only=True)
class TrainingFlags:
    """How classes are learned."""

    mirror: Annotated[
        bool,
        typer.Option("--mirror", help="Learn the mirror image of each class, too."),
    ] = False
    features: FeatureSetName = None
    keep_examples: Annotated[
        bool,
        typer.Option(
            "--keep-examples",
            help="Keep the examples' relations in the library, so that `library add` learns from "
            "more as if from all at once.",
        ),
    ] = False
    tolerance: Annotated[
        float,
        typer.Option(
            min=0.0,
            max=0.5,
            metavar="SHARE",
            default_factory=LibraryDefault(_TRAINING, "tolerance"),
            help="A relation may differ in this share of the examples and still be asked for.",
        ),
    ]
    queries: Annotated[
        Queries,
        typer.Option(
            help="Keyframe queries from the examples, so that a class is looked for around their "
            "hits only: several that vote are bred (learned), or one of two to five keyframes is "
            "chosen (chosen).",
        ),
    ] = Queries.NONE
    query_runs: Annotated[
        int,
        typer.Option(
            min=1,
            default_factory=LibraryDefault("motionary.models.query_learning:learn_query", "runs"),
            help="With --queries learned: so many are bred for each class; most of them must "
            "agree on a hit.",
        ),
    ]

    def training(self, threshold: float | None) -> "TrainingOptions":
        """The same for the library."""
        from motionary.models.library import TrainingOptions

        trained = TrainingOptions(
            tolerance=self.tolerance, mirror=self.mirror, keep_examples=self.keep_examples
        )
        return trained if threshold is None else replace(trained, threshold=threshold)


@dataclass(frozen=True, kw_only=True)
class ThresholdOptions:
    """Below which cost a match of a class is believed."""

    threshold: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            max=1.0,
            metavar="COST",
            help="Largest cost of a match of these classes.",
        ),
    ] = None
    calibrate: Annotated[
        bool,
        typer.Option(
            "--suggest",
            help="Choose thresholds on examples that are held out, and say what they promise for "
            "motion that is done as the examples are.",
        ),
    ] = False
    groups: Annotated[
        str | None,
        typer.Option(
            metavar="REGEX",
            help="With --suggest: hold examples out together whose names match the same, such as "
            "'HDM_(..)_' for actors: what is promised then holds for actors never seen.",
        ),
    ] = None
    negatives: Annotated[
        list[str] | None,
        typer.Option(
            metavar="PATH",
            help="With --suggest: other recordings, without any of these classes, to choose "
            "thresholds against.",
        ),
    ] = None

    def check(self) -> None:
        """Refuse options that do not go together.

        Raises
        ------
        BadParameter
        """
        if self.calibrate and self.threshold is not None:
            raise typer.BadParameter(
                "thresholds are given or chosen, not both", param_hint="--threshold, --suggest"
            )
        told = {"--groups": self.groups, "--negatives": self.negatives}
        for option, value in told.items():
            if value and not self.calibrate:
                raise typer.BadParameter("goes with --suggest", param_hint=option)
