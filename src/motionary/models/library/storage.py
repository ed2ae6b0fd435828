"""Libraries of motion classes, and how they lie on disk.

A folder: `library.toml` says what the library is and how it was trained, and each class has a
TOML file with its settings, which names the NPZ file that holds the values of its templates.
Values are named after their content and written first, and a class keeps its file, so that each
class is the old one or the new one whenever writing ends. Files of others are left alone.

Class files are named after their classes, with `_` for what file systems dislike. The features of
a feature set that does not come with the package are listed in `library.toml`.
"""

import re
import tomllib
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from motionary.errors import InvalidInput, UnreadableFile, UnwritableFile, check_path
from motionary.features import FULL_BODY, FeatureSet, describe_set, known_sets, set_from_rows
from motionary.files import holds_others, read_bytes, remove_leftovers
from motionary.models.library.class_files import (
    CLASS_KEYS,
    choose_stems,
    read_class,
    to_stem,
    write_class,
)
from motionary.models.library.classes import (
    MotionClass,
    Prototype,
    TrainingOptions,
    fractions_fixed,
)
from motionary.models.library.scoring import Scoring
from motionary.models.library.toml_tables import (
    Keys,
    check_keys,
    format_line,
    is_number,
    read_document,
    read_toml,
    refuse,
    refuse_value,
    update_table,
    write_document,
)
from motionary.tables import Table, Tabular, near_names

#: Raised when a reader of the version before could misunderstand the files.
VERSION = 1
INDEX = "library.toml"

_INDEX_KEYS: Keys = {
    "version": int, "feature_set": str, "features": list, "provenance": str, "licence": str,
    "classes": dict,
}  # fmt: skip
_TRAINING_KEYS: Keys = {
    "threshold": float, "tolerance": float, "mirror": bool, "by_self_information": bool,
    "keep_examples": bool, "calibrate": bool, "groups": str, "fold_sides": bool, "queries": str,
    "query_runs": int, "per_group": bool,
}  # fmt: skip
_SCORING_KEYS: Keys = {"corpus": list, "threshold": float, "look_ahead_s": float}
_OPTIONAL_KEYS: Keys = {"false_slope": float, "probability": list}
_COLUMNS = (
    "class", "template", "examples", "columns", "seconds", "fixed", "threshold",
    "promised_precision", "promised_recall", "queries", "kept_examples", "made", "feature_set",
    "provenance", "licence",
)  # fmt: skip
_VALUES = re.compile(r"(.+)\.[0-9a-f]{8}\.npz")


@dataclass(frozen=True, slots=True, eq=False)
class ClassLibrary(Tabular):
    """Classes over one feature set; the order of the classes breaks ties.

    Attributes
    ----------
    classes : with unique names
    feature_set : what the templates' features are
    provenance, licence : where the classes come from and how they may be used
    training : how the classes were trained; None if they were not, not all alike, or before
        libraries remembered it
    scoring : how labels are assigned by scores; None if only by costs
    """

    classes: tuple[MotionClass, ...]
    feature_set: FeatureSet = FULL_BODY
    provenance: str = ""
    licence: str = ""
    training: TrainingOptions | None = None
    scoring: Scoring | None = None

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

    def __repr__(self) -> str:
        return f"ClassLibrary({len(self)} classes: {', '.join(self.names)[:200]})"

    def list_rows(self) -> Table:
        """A row for each template, by class."""
        rows = [
            (
                one.name, prototype.name, prototype.template.n_examples,
                prototype.template.n_columns, prototype.template.duration_s, fraction,
                one.threshold, one.estimated_precision, one.estimated_recall,
                len(prototype.queries), len(prototype.examples), prototype.template.provenance,
                self.feature_set.name, one.provenance or self.provenance,
                one.licence or self.licence,
            )
            for one in self
            for prototype, fraction in zip(one.prototypes, fractions_fixed(one), strict=True)
        ]  # fmt: skip
        return Table(_COLUMNS if rows else (), rows)

    def __iter__(self) -> Iterator[MotionClass]:
        return iter(self.classes)

    def __len__(self) -> int:
        return len(self.classes)

    def __getitem__(self, name: str) -> MotionClass:
        if name in self.names:
            return self.classes[self.names.index(name)]
        rest = f"its classes are: {', '.join(self.names) or 'none'}"
        if near := near_names(name, self.names):
            rest = f"did you mean {' or '.join(map(repr, near))}? motionary library list shows all"
        raise InvalidInput(f"the library has no class {name!r}; {rest}")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the classes, in order."""
        return tuple(c.name for c in self.classes)

    @property
    def has_scores(self) -> bool:
        """Whether labels can be assigned by scores: every class has its prior."""
        return self.scoring is not None and all(one.prior for one in self.classes)

    def save(self, folder: str | Path) -> None:
        """Write the library to a folder; classes that it had before are replaced.

        Raises
        ------
        UnwritableFile
            If the folder cannot be written, or holds something that is no library.
        InvalidInput
            If the feature set has the name of another one that comes with the package.
        """
        _save(self, Path(folder))

    @staticmethod
    def load(folder: str | Path, *, feature_sets: Sequence[FeatureSet] = ()) -> "ClassLibrary":
        """Read a library from its folder; see `load_library`."""
        return load_library(folder, feature_sets=feature_sets)


# -- writing ----------------------------------------------------------------------------


def _save(library: ClassLibrary, folder: Path) -> None:
    feature_set = library.feature_set
    if known_sets().get(feature_set.name, feature_set) != feature_set:
        raise InvalidInput(
            f"the feature set {feature_set.name!r} is not the one of that name that comes with "
            "motionary; give yours another name"
        )
    _check_target(folder)
    before = _read_stems(folder, feature_set)
    stems = choose_stems(
        library.names,
        kept={name: before[name] for name in library.names if name in before},
        taken={Path(INDEX).stem, *before.values(), *_stems_of_others(folder)},
    )
    if not (folder / INDEX).exists():
        # So that a first save that ends early leaves a library, and can be done again.
        _write_index(library, {}, folder)
    written = {folder / INDEX}
    for motion_class in library:
        written |= write_class(motion_class, folder, stems[motion_class.name], feature_set)
    _write_index(library, stems, folder)
    _remove_stale(folder, {*before.values(), *stems.values()}, kept=written)
    remove_leftovers(folder, written)


def _check_target(folder: Path) -> None:
    if folder.exists() and not folder.is_dir():
        raise UnwritableFile("is a file; a library needs a folder", file=folder)
    if not (folder / INDEX).exists() and holds_others(folder, INDEX):
        raise UnwritableFile("holds files but no library; give a new or empty folder", file=folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UnwritableFile(f"cannot be made ({error.strerror})", file=folder) from error


def _read_stems(folder: Path, feature_set: FeatureSet) -> dict[str, str]:
    """Files of the classes that a folder has; under no class's name if they are not kept."""
    try:
        index = read_toml(folder / INDEX, _INDEX_KEYS)
    except UnreadableFile:
        return {}
    stems = {n: s for n, s in index["classes"].items() if isinstance(s, str) and s == to_stem(s)}
    if index["feature_set"] == feature_set.name:
        return stems
    # Until the index is replaced these are classes of the other feature set.
    return {f"{feature_set.name}/{number}": stem for number, stem in enumerate(stems.values())}


def _stems_of_others(folder: Path) -> set[str]:
    """Tables beside the classes' that a class must not replace."""
    stems = set()
    for path in folder.glob("*.toml"):
        try:
            keys = tomllib.loads(read_bytes(path).decode("utf-8")).keys()
        except (OSError, ValueError, RecursionError):
            keys = {}.keys()
        if not keys >= CLASS_KEYS.keys():
            stems.add(path.stem)
    return stems


def _write_index(library: ClassLibrary, stems: Mapping[str, str], folder: Path) -> None:
    import tomlkit

    document = read_document(folder / INDEX)
    if not document:
        document.add(tomlkit.comment("A motionary library: classes of motion, their origin."))
    features = library.feature_set
    content = {
        "version": VERSION, "feature_set": features.name, "features": list(features.ids),
        "provenance": library.provenance, "licence": library.licence,
    }  # fmt: skip
    update_table(document, content)
    rows = () if features.name in known_sets() else describe_set(features)
    tables: dict[str, Any] = {
        "training": _to_table(library.training, _TRAINING_KEYS),
        "scoring": _to_table(library.scoring, {**_SCORING_KEYS, **_OPTIONAL_KEYS}),
        "classes": stems, "relations": rows,
    }  # fmt: skip
    for key, table in tables.items():
        before = document.get(key)
        # One that is the same stays as it is written; the order of classes counts, which
        # equality of tables passes over.
        if before != table or list(before or ()) != list(table or ()):
            document.pop(key, None)
            if table or key == "classes":
                document[key] = table
    write_document(folder / INDEX, document)


def _to_table(settings: TrainingOptions | Scoring | None, keys: Keys) -> dict[str, Any]:
    """What the library remembers of its training or scores, by the keys of the file."""
    values = {key: getattr(settings, key, None) for key in keys}
    return {
        key: list(value) if isinstance(value, tuple) else value
        for key, value in values.items()
        if value is not None
    }


def _remove_stale(folder: Path, stems: Collection[str], *, kept: Collection[Path]) -> None:
    """Remove what classes of these files had before."""
    for path in set(folder.glob("*.toml")) | set(folder.glob("*.npz")):
        values = _VALUES.fullmatch(path.name)
        stem = path.stem if path.suffix == ".toml" else values and values[1]
        if stem in stems and path not in kept:
            # The library is complete without them: no reason to call it a failure.
            with suppress(OSError):
                path.unlink()


# -- reading ----------------------------------------------------------------------------


def load_library(folder: str | Path, *, feature_sets: Sequence[FeatureSet] = ()) -> ClassLibrary:
    """Read a library from its folder.

    Parameters
    ----------
    folder : folder of the library
    feature_sets : sets with quantities of one's own, which no file can tell

    Raises
    ------
    UnreadableFile
        If the folder is no library, was written by a newer version, or was edited into
        something that does not fit; the message names file, key and line.
    """
    folder = check_path(folder, remedy="give the name of a folder")
    path = folder / INDEX
    if not path.is_file():
        raise UnreadableFile(
            f"no library there ({INDEX} is missing); motionary learn makes one, and everyday ships",
            file=folder,
        )
    index = read_toml(path, _INDEX_KEYS)
    if not 1 <= index["version"] <= VERSION:
        raise UnreadableFile(
            f"written by a newer motionary (version {index['version']}, "
            f"this one reads up to {VERSION}){format_line(path, ('version',))}; update motionary",
            file=path,
        )
    feature_set = _find_feature_set(path, index, feature_sets)
    training = _read_training(path, index)
    scoring = _read_scoring(path, index)
    classes = []
    for name, stem in index["classes"].items():
        if not isinstance(stem, str) or Path(stem).name != stem:
            raise refuse(path, ("classes", name), f"must be a file name, got {stem!r}")
        if not (folder / f"{stem}.toml").is_file():
            raise refuse(path, ("classes", name), f"means {stem}.toml, which is missing")
        motion_class = read_class(folder, stem, name, feature_set)
        # Libraries of before do not say which template is the mirror image of which.
        classes.append(motion_class if training else _pair_mirrors(motion_class, feature_set))
    try:
        return ClassLibrary(
            tuple(classes), feature_set, index["provenance"], index["licence"], training, scoring
        )
    except InvalidInput as error:
        raise UnreadableFile(str(error), file=folder) from error


def _read_training(path: Path, index: dict[str, Any]) -> TrainingOptions | None:
    """The options that the library was trained with, if it remembers them."""
    if "training" not in index:
        return None
    content = {"groups": "", "fold_sides": False, "per_group": False, **index["training"]}
    check_keys(path, content, _TRAINING_KEYS, place=("training",))
    options = {key: content[key] for key in _TRAINING_KEYS} | {"groups": content["groups"] or None}
    about = {key: index[key] for key in ("provenance", "licence")}
    try:
        return TrainingOptions(**options, **about)
    except InvalidInput as error:
        raise refuse_value(path, ("training",), error) from error


def _read_scoring(path: Path, index: dict[str, Any]) -> Scoring | None:
    """What a library says of scores; None in one from before there were any."""
    if "scoring" not in index:
        return None
    content, place = index["scoring"], ("scoring",)
    check_keys(path, content, _SCORING_KEYS, optional=_OPTIONAL_KEYS, place=place)
    for key in ("corpus", "probability"):
        if not all(map(is_number, content.get(key, ()))):
            raise refuse(path, (*place, key), "must be a list of numbers")
    present = content.keys() & {*_SCORING_KEYS, *_OPTIONAL_KEYS}
    try:
        return Scoring(**{key: content[key] for key in present})
    except InvalidInput as error:
        raise refuse_value(path, place, error) from error


def _pair_mirrors(motion_class: MotionClass, feature_set: FeatureSet) -> MotionClass:
    """The class, with the templates named that are to the bit mirror images of others."""
    paired: list[Prototype] = []
    for one in motion_class.prototypes:
        for original in paired:
            same = np.array_equal(one.template.weights, original.template.weights)
            image = original.template.values[:, feature_set.mirror_order]
            if same and not original.mirror_of and np.array_equal(one.template.values, image):
                one = replace(one, mirror_of=original.name)
                break
        paired.append(one)
    return replace(motion_class, prototypes=tuple(paired))


def _find_feature_set(path: Path, index: dict[str, Any], given: Sequence[FeatureSet]) -> FeatureSet:
    name, rows = index["feature_set"], index.get("relations")
    sets = {**known_sets(), **{one.name: one for one in given}}
    if rows is not None and name not in sets:
        if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
            raise refuse(path, ("relations",), "must be tables of features")
        try:
            sets[name] = set_from_rows(name, rows)
        except InvalidInput as error:
            raise UnreadableFile(f"relations: {error}", file=path) from error
    found = sets.get(name)
    if found is None:
        raise refuse(
            path,
            ("feature_set",),
            f"{name!r} is not known; known are {', '.join(sets)}; "
            "sets of one's own are passed as feature_sets=",
        )
    if tuple(index["features"]) != found.ids:
        raise refuse(path, ("features",), f"are not those of {name!r}; learn it again")
    return found
