"""Priors that templates of recognised motion tell by name: a foot rests, an elbow is bent.

After Baak (2012), sections 6.3 and 6.4.1: rectangles of a template in which a feature is the same
for all examples are marked, and go to the frames that the template is aligned with. Here they are
marked by the template itself; a TOML file beside the library replaces them where people edit it.

Conventions: columns are those of a template, half-open, of 1/30 s.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.features import FeatureSequence
from motionary.models.library import ClassLibrary
from motionary.models.library.toml_tables import check_keys, read_toml, refuse, write_document
from motionary.models.templates import QuantisedTemplate
from motionary.multiview.poses import SEEN, BodyFrame, Track, columns_of
from motionary.multiview.solving import Pull
from motionary.packing import unpack
from motionary.recording import find_runs
from motionary.retrieval.explanation import Evidence

#: File of a library's folder that holds edited priors.
PRIORS_FILE = "priors.toml"

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

# What is marked, the feature that tells it, and its value there. Features are named, not numbered:
# the numbers of both feet differ in print.
_KINDS = {
    "{side} foot rests": ("{side} foot fast", False),
    "{side} foot ahead": ("{other} foot behind {side} leg", True),
    "{side} hand moves ahead": ("{side} hand moves forward", True),
    "{side} elbow bent": ("{side} elbow bent", True),
    "{side} elbow straight": ("{side} elbow bent", False),
    "{side} knee bent": ("{side} knee bent", True),
}
#: Feature and value of each named prior.
MARKED = {
    name.format(side=side): (feature.format(side=side, other=other), value)
    for name, (feature, value) in _KINDS.items()
    for side, other in (("left", "right"), ("right", "left"))
}
# Shorter rectangles are chance.
_LEAST_COLUMNS = 3
_HOLD_WEIGHT, _HOLD_SCALE_M, _FLOOR_SCALE_M = 2.0, 0.05, 0.15
_RESTING_SPEED = 0.6
_LEAST_REST_S = 0.1
# What a match marks must hold in so much of what is seen of it.
_HOLDS = 0.8
# Limbs by what a prior's name says: from the trunk to the end that it moves.
_LIMBS = {
    "hand": ("Shoulder", "Elbow", "Wrist"),
    "elbow": ("Shoulder", "Elbow", "Wrist"),
    "foot": ("Hip", "Knee", "Ankle"),
    "knee": ("Hip", "Knee", "Ankle"),
}
#: Points of a foot by which it stands.
SOLE = ("BigToe", "SmallToe", "Heel", "Ankle")
# Thresholds of the features: an angle, and a hand's speed in lengths of the leg a second.
_BENT, _AHEAD = np.radians(120.0), 0.45


class NamedPrior(NamedTuple):
    """What holds in columns of a template: one of `MARKED`, and from where up to where."""

    name: str
    spans: tuple[tuple[int, int], ...]

    def columns(self, n_columns: int) -> NDArray[np.bool_]:
        """Where it holds, of so many columns."""
        mask = np.zeros(n_columns, dtype=bool)
        for first, stop in self.spans:
            mask[first:stop] = True
        return mask


#: Priors by class and prototype.
PriorTable = Mapping[tuple[str, str], Sequence[NamedPrior]]


def named_priors(template: QuantisedTemplate, names: Sequence[str]) -> list[NamedPrior]:
    """Priors that a template marks by itself: rectangles of one row with the value that tells.

    `names` are of its features, in the sequence of its cells.
    """
    found = []
    for name, (feature, value) in MARKED.items():
        if feature not in names:
            continue
        row = names.index(feature)
        holds = template.fixed[:, row] & (template.values[:, row] == value)
        runs = find_runs(np.asarray(holds)).tolist()
        # The first and the last column may be a step's end.
        spans = tuple((a + 1, b - 1) for a, b in runs if b - a >= _LEAST_COLUMNS)
        if spans:
            found.append(NamedPrior(name, spans))
    return found


def derive_priors(library: ClassLibrary) -> dict[tuple[str, str], list[NamedPrior]]:
    """Priors of all templates of a library, by class and prototype."""
    names = library.feature_set.names
    return {
        (one.name, prototype.name): named_priors(template, names)
        for one in library
        for prototype, (template, _) in zip(one.prototypes, one.patterns, strict=True)
    }


def find_rows(
    priors: Sequence[NamedPrior], names: Sequence[str]
) -> dict[int, list[tuple[int, int]]]:
    """Where priors stand in a template whose features have these names: columns by row."""
    rows: dict[int, list[tuple[int, int]]] = {}
    for prior in priors:
        feature = MARKED[prior.name][0]
        if feature in names:
            rows.setdefault(names.index(feature), []).extend(prior.spans)
    return rows


def write_priors(priors: PriorTable, path: str | Path) -> None:
    """Write priors as TOML, to be edited: a table for each, with its columns."""
    import tomlkit

    document = tomlkit.document()
    document.add(tomlkit.comment("What templates tell a track, in columns of 1/30 s, half-open."))
    document.add(tomlkit.comment(f"Names: {', '.join(MARKED)}"))
    tables = tomlkit.aot()
    for (name, prototype), every in priors.items():
        for one in every:
            table = tomlkit.table()
            spans = [list(span) for span in one.spans]
            table.update({"class": name, "template": prototype, "prior": one.name,
                          "columns": spans})  # fmt: skip
            tables.append(table)
    document["priors"] = tables
    write_document(Path(path), document)


def read_priors(path: str | Path, library: ClassLibrary) -> dict[tuple[str, str], list[NamedPrior]]:
    """Priors of a file, checked against the library that it lies beside.

    Raises
    ------
    UnreadableFile
        If it is no such file, or names what the library does not have.
    """
    path = Path(path)
    columns = _count_columns(library)
    result: dict[tuple[str, str], list[NamedPrior]] = {key: [] for key in columns}
    for number, table in enumerate(read_toml(path, {"priors": list})["priors"]):
        place = ("priors", number)
        check_keys(
            path, table, {"class": str, "template": str, "prior": str, "columns": list}, place=place
        )
        key = (table["class"], table["template"])
        if key not in result:
            raise refuse(path, (*place, "template"), f"must be one of the library's, got {key}")
        if table["prior"] not in MARKED:
            one = f"must be one of {', '.join(MARKED)}, got {table['prior']!r}"
            raise refuse(path, (*place, "prior"), one)
        if not all(_is_span(span, columns[key]) for span in table["columns"]):
            most = f"must be pairs of columns from 0 to {columns[key]}, got {table['columns']}"
            raise refuse(path, (*place, "columns"), most)
        spans = tuple((int(first), int(stop)) for first, stop in table["columns"])
        result[key].append(NamedPrior(table["prior"], spans))
    return result


def _count_columns(library: ClassLibrary) -> dict[tuple[str, str], int]:
    return {
        (one.name, prototype.name): prototype.template.n_columns
        for one in library
        for prototype in one.prototypes
    }


def _is_span(span: object, n_columns: int) -> bool:
    return (
        isinstance(span, list)
        and len(span) == 2
        and all(isinstance(one, int) for one in span)
        and 0 <= span[0] < span[1] <= n_columns
    )


def check_priors(priors: PriorTable, library: ClassLibrary) -> None:
    """Raise InvalidInput unless priors are of the library's templates."""
    known = _count_columns(library)
    for key, every in priors.items():
        for one in every:
            if key not in known or any(stop > known[key] for _, stop in one.spans):
                raise InvalidInput(
                    f"priors of {key} are not of the library's templates; derive them anew with "
                    "derive_priors"
                )


# ---- what they ask of points


def sole_points(names: tuple[str, ...], side: str) -> list[int]:
    """Numbers of the points of a foot, without the ankle if there are others."""
    own = [names.index(side + part) for part in SOLE if side + part in names]
    ankle = [k for k in own if names[k].endswith("Ankle")]
    return [k for k in own if k not in ankle] or ankle


def hold(pull: Pull, track: Track, feet: Sequence[int], span: slice, floor: float | None) -> None:
    """Pull each point of a resting foot towards its median place: eqs. (6.7) and (6.8), robust."""
    part = track.points[span][:, feet]
    for k, point in enumerate(feet):
        known = track.confidence[span, point] > SEEN
        target = np.median(part[known, k] if known.any() else part[:, k], axis=0)
        if floor is not None:
            # Points of a sole lie above the floor by what they do when the foot stands.
            target[1] = max(target[1], floor)
        off = part[:, k] - target
        flat = np.linalg.norm(off[:, (0, 2)], axis=1)
        weights = np.zeros((len(part), 3))
        scale = _HOLD_SCALE_M**2
        weights[:, 0] = weights[:, 2] = _HOLD_WEIGHT * (scale / (scale + flat**2)) ** 2
        if floor is not None:
            scale = _FLOOR_SCALE_M**2
            weights[:, 1] = _HOLD_WEIGHT * (scale / (scale + off[:, 1] ** 2)) ** 2
        pull.matrices[span, point][:, np.arange(3), np.arange(3)] = weights
        pull.places[span, point] = target


def shape_limb(name: str, track: Track, span: slice, pull: Pull, frame: BodyFrame) -> bool:
    """Change where points that no view tells are pulled to, so that a prior holds there.

    `name` is one of `MARKED` but for resting feet; `pull` is changed in the frames of `span`, and
    has places for all points that no view tells. Returns whether a point took it.
    """
    side, part = name[0].upper(), name.split()[1]
    limb = [f"{side}{one}" for one in _LIMBS[part]]
    if not {*limb, _other(limb[2])} <= set(track.names):
        return False
    end = track.names.index(limb[2])
    wanted = np.zeros(len(track.points), dtype=bool)
    wanted[span] = track.confidence[span, end] < SEEN
    pulled = np.asarray(pull.matrices.any(axis=(2, 3)))
    wanted &= pulled[:, end]
    if not wanted.any():
        return False
    places = np.where(pulled[..., None], pull.places, track.points)
    if name.endswith("ahead"):
        moved = _move_ahead(track, places, limb[2], wanted, frame)
    else:
        moved = _bend(track, [places[:, track.names.index(one)] for one in limb], limb,
                      straight=name.endswith("straight"))  # fmt: skip
    pull.places[wanted, end] = moved[wanted]
    return True


def _other(name: str) -> str:
    """The same point of the other side."""
    return ("R" if name[0] == "L" else "L") + name[1:]


def _move_ahead(track: Track, places: Floats, name: str, wanted: Bools, frame: BodyFrame) -> Floats:
    """Places of a foot not behind the other one, or of a hand that goes ahead in time."""
    other = track.names.index(_other(name))
    own = frame.to_own(places[:, [track.names.index(name), other]])
    if name.endswith("Ankle"):
        own[:, 0, 2] = np.maximum(own[:, 0, 2], own[:, 1, 2])
    else:
        step = _AHEAD / track.rate_hz
        for first, stop in find_runs(wanted).tolist():
            least = own[max(first - 1, 0), 0, 2] + step * np.arange(1, stop - first + 1)
            own[first:stop, 0, 2] = np.maximum(own[first:stop, 0, 2], least)
    return frame.to_world(own)[:, 0]


def _bend(track: Track, limb: Sequence[Floats], names: Sequence[str], *, straight: bool) -> Floats:
    """Places of a limb's end where the angle in its middle is beyond that of the feature."""
    at = [track.points[:, track.names.index(name)] for name in names]
    a, b = (float(np.nanmedian(np.linalg.norm(at[k] - at[k + 1], axis=1))) for k in (0, 1))
    limit = np.sqrt(a * a + b * b - 2 * a * b * np.cos(_BENT))
    away = limb[2] - limb[0]
    far = np.maximum(np.linalg.norm(away, axis=1), 1e-6)
    wrong = far < limit if straight else far > limit
    return np.where(wrong[:, None], limb[0] + away * (limit / far)[:, None], limb[2])


# ---- given to frames


class AllocatedPrior(NamedTuple):
    """A prior in the track.

    `name` such as "left foot rests" or "left leg moves as in walk"; frames `first` up to `stop`;
    `cost` of its match; `kept` whether it proved itself; `reason` in a few words.
    """

    name: str
    motion_class: str
    first: int
    stop: int
    cost: float
    kept: bool
    reason: str


class Claims(NamedTuple):
    """What a match marks: priors, the column of each frame, and how much of it is seen to hold."""

    match: Evidence
    named: Sequence[NamedPrior]
    columns: NDArray[np.intp]
    held: float


def find_claims(
    match: Evidence, named: Sequence[NamedPrior], sequence: FeatureSequence, track: Track
) -> Claims:
    """What a match marks, held against the features of the track where they are known."""
    names = sequence.feature_set.names
    values, known = (unpack(one, len(names)) for one in (sequence.packed, sequence.known))
    column, frame = match.alignment.path.T
    right = total = 0
    for prior in named:
        feature, value = MARKED[prior.name]
        if feature not in names:
            continue
        row = names.index(feature)
        told = prior.columns(len(match.template.values))[column] & known[frame, row]
        right += int((told & (values[frame, row] == value)).sum())
        total += int(told.sum())
    return Claims(match, named, columns_of(match, track), right / total if total else 0.0)


def mark(
    claims: Claims, track: Track, pull: Pull, frame: BodyFrame, floor: float | None
) -> list[AllocatedPrior]:
    """Give what a template marks to its frames."""
    told = []
    match, columns = claims.match, claims.columns
    for prior in claims.named:
        marked = prior.columns(len(match.template.values))
        mask = (columns >= 0) & marked[np.maximum(columns, 0)]
        for first, stop in find_runs(mask).tolist():
            # One frame, as at 10 Hz, has no speed.
            if stop - first < max(2.0, _LEAST_REST_S * track.rate_hz):
                continue
            span = slice(first, stop)
            kept = claims.held >= _HOLDS
            reason = f"{100 * claims.held:.0f} % of what its match marks is seen to hold"
            if prior.name.endswith("rests"):
                feet = sole_points(track.names, prior.name[0].upper())
                if not feet:
                    continue
                kept, reason = _rests(track, feet, span, kept, reason)
                if kept:
                    hold(pull, track, feet, span, floor)
            elif kept and not shape_limb(prior.name, track, span, pull, frame):
                continue
            cost = match.alignment.cost
            told.append(AllocatedPrior(prior.name, match.name, first, stop, cost, kept, reason))
    return told


def _rests(
    track: Track, feet: Sequence[int], span: slice, kept: bool, reason: str
) -> tuple[bool, str]:
    """Whether a foot does not plainly move where it is seen; unseen, whether its match holds."""
    seen = (track.confidence[span][:, feet] > SEEN).any(axis=1)
    if not seen.any():
        return kept, f"not seen; {reason}"
    part = track.points[span][:, feet]
    speed = np.linalg.norm(np.gradient(part, axis=0), axis=-1).min(axis=1) * track.rate_hz
    fast = float(np.median(speed[seen]))
    return fast < _RESTING_SPEED, f"moves at {fast:.1f} m/s"
