"""Features of many motions: computed in parallel, split by person, as one table.

`MotionFeatures` is a transformer by the conventions of scikit-learn, which is not imported:
its settings are arguments kept unchanged, and what `fit` learns ends in an underscore.

Conventions: batches are (motions, frames, joints, 3); motions that end earlier are filled up
with NaN, which means not seen.
"""

import hashlib
import inspect
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motionary.batch import Failure, map_ordered
from motionary.errors import InvalidInput, check_kind
from motionary.features.body import Floats
from motionary.features.catalogue import FULL_BODY
from motionary.features.computing import (
    SEQUENCE_HZ,
    FeatureSequence,
    compute_together,
    motion_from_array,
    resample_motion,
)
from motionary.features.feature_set import FeatureSet
from motionary.motion import Motion
from motionary.packing import PackedFeatures
from motionary.recording import Recording
from motionary.tables import Table, Tabular, build_frame

#: What motions are: one array, or arrays, motions and sequences of features.
Motions = ArrayLike | Sequence[Motion | FeatureSequence | ArrayLike]

#: Name of a skeleton, or of the joints in the order of an array.
Skeleton = str | Sequence[str] | None

#: Parts of a split by person, and how much of the recordings each should hold.
SPLITS = {"train": 0.8, "validation": 0.1, "test": 0.1}

# Motions that a process takes at once: sending costs little beside computing.
_CHUNK = 32
_FEWEST_DIGITS = 3


@dataclass(frozen=True, slots=True, eq=False)
class FeatureBatch(Tabular):
    """Features of many recordings, over one feature set.

    Attributes
    ----------
    sequences : of each recording
    splits : the part of each recording, such as "train"; empty where nothing is split
    """

    sequences: tuple[FeatureSequence, ...]
    splits: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not self.sequences:
            raise InvalidInput("a batch needs at least one recording, got none")
        sets = {item.feature_set.name for item in self.sequences}
        if len(sets) > 1:
            raise InvalidInput(f"a batch needs one feature set, got {', '.join(sorted(sets))}")
        if self.splits and len(self.splits) != len(self.sequences):
            raise InvalidInput(
                f"{len(self.sequences)} recordings need as many splits, got {len(self.splits)}"
            )

    def __len__(self) -> int:
        return len(self.sequences)

    def __iter__(self) -> Iterator[FeatureSequence]:
        return iter(self.sequences)

    @property
    def feature_set(self) -> FeatureSet:
        """What the features are."""
        return self.sequences[0].feature_set

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each recording."""
        return tuple(item.source for item in self.sequences)

    @property
    def persons(self) -> tuple[str, ...]:
        """Who moves in each recording; empty where it is unknown."""
        return tuple(item.recording.person for item in self.sequences)

    def fractions(self) -> Floats:
        """In which fraction of its known frames each feature holds, a row a recording.

        Returns
        -------
        array, shape (recordings, features); NaN where a feature is never known
        """
        return np.stack([item.fractions() for item in self.sequences])

    def list_rows(self) -> Table:
        """The recordings: whose, of which part, how long, and how much of it is known."""
        known = [item.known_features.mean() if len(item) else None for item in self.sequences]
        splits = self.splits or ("",) * len(self)
        rows = zip(
            self.names, self.persons, splits, (s.duration_s for s in self.sequences), known,
            strict=True,
        )  # fmt: skip
        return Table(("recording", "person", "split", "seconds", "known"), list(rows))

    def to_dataframe(self) -> Any:
        """A row for each frame and a column for each feature: 0, 1, or NA where unknown.

        Returns
        -------
        pandas.DataFrame, by `recording` and `time_s`; `person` and `split` where they are known

        Raises
        ------
        InvalidInput
            If pandas is not installed.
        """
        lengths = [len(item) for item in self.sequences]
        columns = {"recording": np.repeat(np.array(self.names, dtype=object), lengths)}
        columns["time_s"] = np.concatenate([np.arange(n) for n in lengths]) / SEQUENCE_HZ
        for name, values in (("person", self.persons), ("split", self.splits)):
            if any(values):
                columns[name] = np.repeat(np.array(values, dtype=object), lengths)
        features = np.concatenate([item.features for item in self.sequences])
        known = np.concatenate([item.known_features for item in self.sequences])
        names = self.feature_set.names
        cells = np.where(known, features.astype(np.float32), np.float32(np.nan))
        frame = build_frame(columns | dict(zip(names, cells.T, strict=True)))
        return frame.astype(dict.fromkeys(names, "UInt8")).set_index(["recording", "time_s"])

    def with_persons(self, persons: Sequence[str]) -> Self:
        """The batch with who moves in each recording."""
        sequences = (
            replace(item, recording=replace(item.recording, person=person))
            for item, person in zip(self.sequences, persons, strict=True)
        )
        return replace(self, sequences=tuple(sequences))

    def split_by_person(self, *, parts: Mapping[str, float] | None = None, seed: int = 0) -> Self:
        """The batch with each person in one part, all of its recordings with it.

        Who goes where depends on the people, how many recordings each has, the parts and the seed
        only. People are dealt one after the other to the part that lacks most of its own size.

        Parameters
        ----------
        parts : fraction of the recordings that each part should hold; `SPLITS` if left out

        Raises
        ------
        InvalidInput
            If somebody is unknown, or there are fewer people than parts.
        """
        parts = SPLITS if parts is None else parts
        unknown = [
            name for name, person in zip(self.names, self.persons, strict=True) if not person
        ]
        if unknown:
            raise InvalidInput(
                f"splits by person need a person for each recording, got none for {unknown[0]!r} "
                f"({len(unknown)} in all); give persons="
            )
        if not parts or any(not fraction > 0 for fraction in parts.values()):
            raise InvalidInput(f"each part needs a fraction above 0, got {parts}")
        people = {person: self.persons.count(person) for person in set(self.persons)}
        if len(people) < len(parts):
            raise InvalidInput(
                f"{len(parts)} parts need as many people, got {len(people)}: "
                f"{', '.join(sorted(people))}"
            )
        part_of = _deal_people(people, parts, seed)
        return replace(self, splits=tuple(part_of[person] for person in self.persons))


def _deal_people(people: dict[str, int], parts: Mapping[str, float], seed: int) -> dict[str, str]:
    """The part of each person, of how many recordings each has."""
    total = sum(people.values()) / sum(parts.values())
    wanted = {part: fraction * total for part, fraction in parts.items()}
    held = dict.fromkeys(parts, 0)
    part_of = {}
    # Names of files may hold bytes that are no text.
    seeded = {person: f"{seed} {person}".encode("utf-8", "surrogateescape") for person in people}
    for person in sorted(people, key=lambda person: hashlib.blake2b(seeded[person]).digest()):
        part = max(parts, key=lambda part: (wanted[part] - held[part]) / wanted[part])
        part_of[person] = part
        held[part] += people[person]
    return part_of


def match_names(names: Iterable[str], pattern: str, *, each: str, has: str) -> list[str]:
    """What a regular expression finds in names: in its first parentheses, if it has any.

    Parameters
    ----------
    each, has : what errors call what is named, and what is found of it

    Raises
    ------
    InvalidInput
        If the expression is none, or matches nothing in a name.
    """
    try:
        compiled = re.compile(pattern)
    except re.error as error:
        raise InvalidInput(f"{has}s {pattern!r} is no regular expression: {error}") from error
    keys = []
    for name in names:
        found = compiled.search(name)
        # Parentheses that are optional may have no part in a match.
        key = found[1 if compiled.groups else 0] if found else None
        if not key:
            raise InvalidInput(
                f"{has}s {pattern!r} matches nothing in {name!r}; each {each} needs a {has}"
            )
        keys.append(str(key))
    return keys


def compute_batch(
    motions: Motions,
    *,
    rate_hz: float | None = None,
    skeleton: Skeleton = None,
    names: Sequence[str] | None = None,
    persons: Sequence[str] | None = None,
    feature_set: FeatureSet = FULL_BODY,
    jobs: int = 1,
) -> FeatureBatch:
    """Features of many motions.

    Parameters
    ----------
    motions : array, shape (motions, frames, joints, 3), metres, y up, NaN = not seen; or
        arrays (frames, joints, 3), motions, and sequences of features over `feature_set`
    rate_hz, skeleton : of arrays, as in `compute_features`
    names, persons : of each motion; its own, or its number, if left out
    jobs : processes; the result does not depend on it

    Raises
    ------
    InvalidInput
        If names or persons are of another number, or as of `compute_features`.
    """
    if hasattr(motions, "__array__"):
        # Tensors of other packages.
        motions = np.asarray(motions)
    count = _count(motions)
    for what, given in (("names", names), ("persons", persons)):
        if given is not None and len(given) != count:
            raise InvalidInput(f"{count} motions need as many {what}, got {len(given)}")
    work = partial(_compute_some, rate_hz=rate_hz, skeleton=skeleton, feature_set=feature_set)
    chunks = (motions[at : at + _CHUNK] for at in range(0, count, _CHUNK))  # type: ignore[index]
    sequences: list[FeatureSequence] = []
    digits = max(_FEWEST_DIGITS, len(str(count)))
    for done in map_ordered(work, chunks, jobs=jobs):
        if isinstance(done, Failure):
            for number, motion in enumerate(done.item, start=len(sequences)):
                alone = next(map_ordered(work, [[motion]]))
                if isinstance(alone, Failure):
                    alone.error.file = names[number] if names else f"motion {number + 1}"
                    raise alone.error
            raise done.error
        for number, (packed, known, own) in enumerate(done, start=len(sequences)):
            name = own.name or f"{number + 1:0{digits}}" if names is None else names[number]
            person = own.person if persons is None else persons[number]
            recording = replace(own, name=name, person=person)
            sequences.append(FeatureSequence(packed, known, feature_set, recording))
    return FeatureBatch(tuple(sequences))


def _count(motions: Motions) -> int:
    if isinstance(motions, np.ndarray) and motions.ndim != 4:
        raise InvalidInput(
            f"a batch needs shape (motions, frames, joints, 3), got {motions.shape}; of "
            "one motion, pass a list with it"
        )
    remedy = "an array (motions, frames, joints, 3), or a list of motions"
    check_kind(motions, (np.ndarray, Sequence), name="motions", remedy=remedy)
    return len(motions)  # type: ignore[arg-type]


class Computed(NamedTuple):
    """What processes send back of a sequence, whose feature set is known there."""

    packed: PackedFeatures
    known: PackedFeatures
    recording: Recording

    @classmethod
    def of(cls, sequence: FeatureSequence) -> Self:
        """The same of a sequence."""
        return cls(sequence.packed, sequence.known, sequence.recording)


def _compute_some(
    motions: Sequence[Any], *, rate_hz: float | None, skeleton: Skeleton, feature_set: FeatureSet
) -> list[Computed]:
    arrays = (
        motion if isinstance(motion, Motion) else motion_from_array(motion, rate_hz, skeleton)
        for motion in motions
        if not isinstance(motion, FeatureSequence)
    )
    computed = compute_together(map(resample_motion, arrays), feature_set)
    return [
        Computed.of(
            motion.leading(feature_set) if isinstance(motion, FeatureSequence) else next(computed)
        )
        for motion in motions
    ]


class MotionFeatures:
    """Motions to fractions of time in which features hold, as a step of scikit-learn.

    Parameters
    ----------
    rate_hz, skeleton : of arrays, as in `compute_features`
    feature_set : features to compute; the published 40 if left out
    jobs : processes; the result does not depend on it

    Attributes
    ----------
    feature_set_ : what the columns of the result are, after `fit`
    """

    def __init__(
        self,
        *,
        rate_hz: float | None = None,
        skeleton: Skeleton = None,
        feature_set: FeatureSet | None = None,
        jobs: int = 1,
    ) -> None:
        self.rate_hz = rate_hz
        self.skeleton = skeleton
        self.feature_set = feature_set
        self.jobs = jobs

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """The settings by name; there are none within others."""
        return {name: getattr(self, name) for name in inspect.signature(type(self)).parameters}

    def set_params(self, **params: Any) -> Self:
        """Change settings by name.

        Raises
        ------
        InvalidInput
            If there is none of this name.
        """
        known = self.get_params()
        for name, value in params.items():
            if name not in known:
                raise InvalidInput(f"settings are {', '.join(known)}, got {name!r}")
            setattr(self, name, value)
        return self

    def fit(self, X: Motions, y: object = None) -> Self:
        """Nothing is learned of motions; says what columns `transform` gives."""
        self.feature_set_ = FULL_BODY if self.feature_set is None else self.feature_set
        return self

    def transform(self, X: Motions) -> NDArray[np.float64]:
        """Fractions of the frames, shape (motions, features); NaN where never known.

        Parameters
        ----------
        X : as `compute_batch` takes motions
        """
        return compute_batch(
            X,
            rate_hz=self.rate_hz,
            skeleton=self.skeleton,
            feature_set=FULL_BODY if self.feature_set is None else self.feature_set,
            jobs=self.jobs,
        ).fractions()

    def fit_transform(self, X: Motions, y: object = None) -> NDArray[np.float64]:
        """The same as `fit` and `transform`."""
        return self.fit(X, y).transform(X)

    def get_feature_names_out(self, input_features: object = None) -> NDArray[np.object_]:
        """Names of the columns of the result."""
        names = (FULL_BODY if self.feature_set is None else self.feature_set).names
        return np.array(names, dtype=object)

    def __repr__(self) -> str:
        settings = self.get_params().items()
        given = ", ".join(f"{name}={value!r}" for name, value in settings if value is not None)
        return f"{type(self).__name__}({given})"
