"""Skeletons: how the names of a file, and the shape of its tree, give the 24 generic joints.

The known skeletons are tables in `tables/*.toml`, one a file, for people to read and extend;
how they are written stands in `table_files`. Joints that no table knows are mapped by the
shape of their tree, by sides and by names, and the mapping says so. Also whether a file holds one
person: not several, and no animal.
"""

from collections.abc import Callable, Collection, Iterable
from dataclasses import replace
from functools import cache, lru_cache

import numpy as np
from numpy.typing import NDArray

from motionary.errors import UnknownSkeleton
from motionary.motion import GENERIC_JOINTS, JointMapping, Motion, Skeleton, Unmapped
from motionary.recording import Recording
from motionary.skeletons.guessing import guess_from_names, guess_from_tree, without_guess
from motionary.skeletons.table_files import SkeletonTable, format_table, parse_table, spell
from motionary.skeletons.words import is_a

__all__ = [
    "SkeletonTable", "find_mapping", "format_table", "known_mappings", "map_joints",
    "named_mapping", "named_table", "parse_table", "without_guess",
]  # fmt: skip

Floats = NDArray[np.float64]

# Poses that suffice to see how a body is built.
_LOOKED_AT = 50
# Where the last bones of a body end: a rig that does not say so has no tip there.
_ENDS = frozenset({"headtop", "ltoes", "rtoes", "lfingers", "rfingers"})
# A tree is understood if this fraction of the joints that a table knows is found in it.
_AGREE = 0.6


def known_mappings() -> tuple[str, ...]:
    """Names of the known skeletons, sorted."""
    return tuple(sorted(_tables()))


def named_table(name: str) -> SkeletonTable:
    """The table of a known skeleton.

    Raises
    ------
    UnknownSkeleton
        If there is none of this name.
    """
    tables = _tables()
    if name not in tables:
        raise UnknownSkeleton(
            f"skeleton must be one of {', '.join(sorted(tables))}, got {name!r}; "
            "choose one of these or leave it out to let the names decide"
        )
    return tables[name]


def named_mapping(name: str, names: Iterable[str] = ()) -> JointMapping:
    """The mapping of a known skeleton.

    Parameters
    ----------
    name : one of `known_mappings()`
    names : the file's joint names; they decide between alternatives and may carry a
        prefix that ends in a colon

    Raises
    ------
    UnknownSkeleton
        If no table has this name.
    """
    return _resolve(name, tuple(names))


# Batches hold thousands of recordings without names.
@lru_cache(maxsize=64)
def _resolve(name: str, names: tuple[str, ...]) -> JointMapping:
    return named_table(name).resolve(names)


def find_mapping(
    names: Iterable[str],
    skeleton: Skeleton | None = None,
    positions: Floats | None = None,
    *,
    given: SkeletonTable | None = None,
    without: Collection[str] = (),
) -> JointMapping | None:
    """The mapping of the known skeleton that fits joint names best, else a guess.

    Parameters
    ----------
    names : the file's joint names
    skeleton, positions : the file's tree of joints and where they are, shape (frames,
        joints, 3), in any unit and axes; a guess needs them, unless names say enough
    given : the table that the caller names, whatever fits
    without : tables to pass over

    Returns
    -------
    JointMapping, or None if no table finds enough of its joints among the names (60 %) and
    nothing can be guessed, or several people or an animal are in the file
    """
    found = map_joints(names, skeleton, positions, given=given, without=without)
    return found if isinstance(found, JointMapping) else None


def map_joints(
    names: Iterable[str],
    skeleton: Skeleton | None = None,
    positions: Floats | None = None,
    *,
    given: SkeletonTable | None = None,
    without: Collection[str] = (),
) -> JointMapping | Unmapped:
    """The mapping as `find_mapping` has it, or why there is none."""
    names = tuple(names)
    some = None if positions is None else positions[:: 1 + len(positions) // _LOOKED_AT]
    seen = names if positions is None else _seen(names, positions)
    if given is not None:
        return given.resolve(seen)
    people = find_people(names, _fits)
    n_people = max(len(people), 0 if skeleton is None else len(_bodies(skeleton)))
    if n_people > 1:
        called = f" ({', '.join(filter(None, people))})" if any(people) else ""
        return Unmapped(
            f"{n_people} people in one file{called}: save one file for each, or take the first "
            "with --skeleton NAME (skeleton=...)"
        )
    mapping = _map_one(seen, skeleton, some, frozenset(without))
    if mapping is None and len(seen) < len(names):
        mapping = _map_one(names, skeleton, some, frozenset(without))
    is_animal = any(is_a("paw", name) or is_a("tail", name) for name in names)
    if mapping is None and not is_animal:
        few = ", ".join(names[:6]) + (", ..." if len(names) > 6 else "")
        return Unmapped(
            f"no known skeleton has the joints {few}, and neither legs nor arms were found among "
            "them: a prop, or a rig whose joints you must map: motionary info FILE --save-mapping "
            "RIG.toml writes what to fill in, --skeleton RIG.toml (skeleton=...) reads it"
        )
    if mapping is None or (some is not None and is_four_legged(mapping, names, some)):
        return Unmapped("an animal on four legs: the features are those of people", is_human=False)
    return mapping


def _map_one(
    names: tuple[str, ...], skeleton: Skeleton | None, some: Floats | None, without: frozenset[str]
) -> JointMapping | None:
    """The mapping of one person: by a table, by the tree, by a table in other letters, by names."""
    mapping = _fitting(names, without)
    has_tree = skeleton is not None and some is not None
    if mapping is not None and not (has_tree and _lacks(mapping, names)):
        return mapping
    guess = guess_from_tree(skeleton, some) if skeleton is not None and some is not None else None
    if mapping is not None:
        return mapping if guess is None else _complete(mapping, guess, names)
    if guess is not None:
        return guess
    guess, loose = guess_from_names(names), _fitting(names, without, exactly=False)
    if guess is None or loose is None:
        return guess or loose
    # A guess takes what is there; a table knows what stands for what is not.
    n_loose = len(loose.weights) - len(_lacks(loose, names))
    return loose if n_loose > len(guess.weights) else guess


def _lacks(mapping: JointMapping, names: Collection[str]) -> list[str]:
    """Joints that a table has and a file does not."""
    there = set(names)
    return [joint for joint, source in mapping.weights.items() if not there.issuperset(source)]


def _complete(mapping: JointMapping, guess: JointMapping, names: tuple[str, ...]) -> JointMapping:
    """A table's mapping, with what the file lacks of it taken from its tree.

    Where tree and table disagree about the rest, the tree is not understood.
    """
    lacking = _lacks(mapping, names)
    both = [j for j in guess.weights if j in mapping.weights and j not in lacking]
    alike = sum(guess.weights[joint] == mapping.weights[joint] for joint in both)
    added = {
        joint: guess.weights[joint]
        for joint in lacking
        if joint in guess.weights
        and joint not in _ENDS
        and guess.weights[joint] not in mapping.weights.values()
    }
    if not added or alike < _AGREE * len(both):
        return mapping
    said = ", ".join(f"{joint} {' + '.join(source)}" for joint, source in added.items())
    note = f"by the shape of the tree: {said}"
    in_place_of = set(mapping.substituted) - set(added) | set(guess.substituted)
    return replace(
        mapping,
        weights=mapping.weights | added,
        substituted=tuple(joint for joint in GENERIC_JOINTS if joint in in_place_of),
        note=f"{mapping.note}; {note}" if mapping.note else note,
    )


def _seen(names: tuple[str, ...], positions: Floats) -> tuple[str, ...]:
    """Names of the joints that are seen in some frame; all if none is."""
    unseen = np.isnan(positions[0, :, 0])
    for joint in np.flatnonzero(unseen).tolist():
        unseen[joint] = np.isnan(positions[:, joint, 0]).all()
    return tuple(n for n, gone in zip(names, unseen.tolist(), strict=True) if not gone) or names


def _fits(names: tuple[str, ...]) -> bool:
    """Whether joints of these names are a body."""
    return (_fitting(names) or guess_from_names(names)) is not None


def _bodies(skeleton: Skeleton) -> list[tuple[str, ...]]:
    """Names of each tree that is a body, of a file with several trees."""
    roots = np.flatnonzero(skeleton.parents < 0)
    if len(roots) < 2:
        return [skeleton.names]
    tree = np.arange(len(skeleton.names))
    for joint, parent in enumerate(skeleton.parents.tolist()):
        if parent >= 0:
            tree[joint] = tree[parent]
    trees = [
        tuple(skeleton.names[joint].partition(" (")[0] for joint in np.flatnonzero(tree == root))
        for root in roots.tolist()
    ]
    return [names for names in trees if _fits(names)]


# Folders hold many files of few rigs.
@lru_cache(maxsize=64)
def _fitting(
    names: tuple[str, ...], without: frozenset[str] = frozenset(), *, exactly: bool = True
) -> JointMapping | None:
    """The mapping of the table that fits best, by names as the table writes them or loosely."""
    spelled = spell(names)
    best: tuple[bool, float, int] | None = None
    result = None
    for table in _tables().values():
        if table.name in without:
            continue
        choices = {joint: table.choice(joint, spelled, exactly=exactly) for joint in table.joints}
        fraction = sum(choice >= 0 for choice in choices.values()) / len(GENERIC_JOINTS)
        if any(choices.get(joint, -1) < 0 for joint in table.needs):
            continue
        # Of tables that fit alike, the one whose own names are there, not their substitutes.
        marked = bool(table.marks) and set(names).issuperset(table.marks)
        fit = (marked, fraction, -sum(max(choice, 0) for choice in choices.values()))
        if fraction >= table.enough and (best is None or fit > best):
            best, result = fit, table
    return None if result is None else result.resolve(names)


@cache
def _tables() -> dict[str, SkeletonTable]:
    # Imported late: reading tables costs more than reading most of what they are for.
    from importlib import resources

    folder = resources.files("motionary.skeletons") / "tables"
    files = sorted((f for f in folder.iterdir() if f.name.endswith(".toml")), key=lambda f: f.name)
    return {f.name[:-5]: parse_table(f.name[:-5], f.read_text("utf-8")) for f in files}


# -- people and animals -------------------------------------------------------------------


# Hips, knees, ankles and a root: with fewer points nothing is a body.
_FEWEST = 7
# An animal's trunk lies across its legs, and its fore legs go down beside them, in nearly
# every frame.
_ACROSS = 0.5
_ALONG = 0.7
_NEARLY_ALL = 0.95
# Trunk by leg: at most .56 in people of all recordings at hand, about 1 or more in dogs and horses.
_LONG_TRUNK = 0.8


def find_people(
    names: tuple[str, ...], is_body: Callable[[tuple[str, ...]], bool]
) -> tuple[str, ...]:
    """What stands before the colon in the names of each person, or the number after them.

    Parameters
    ----------
    names : of all joints
    is_body : whether joints of these names are a body
    """
    groups: dict[str, list[str]] = {}
    for name in names:
        person, _, own = name.rpartition(":")
        number = ""
        if own.endswith(")") and " (" in own:
            own, _, number = own.rpartition(" (")
        groups.setdefault(person or number.rstrip(")"), []).append(own)
    if len(groups) < 2:
        return ()
    return tuple(
        person for person, own in groups.items() if len(own) >= _FEWEST and is_body(tuple(own))
    )


def is_four_legged(mapping: JointMapping, names: tuple[str, ...], positions: Floats) -> bool:
    """Whether a body stands on four legs: an animal under the names of a person.

    Parameters
    ----------
    mapping, names : as in a `Motion`
    positions : array, shape (frames, joints, 3), in any unit and axes
    """
    if sum(is_a("paw", name) for name in names) > 1:
        return True
    body = Motion(names, positions, Recording(rate_hz=1.0), mapping).generic_positions()
    where = {joint: body[:, i] for i, joint in enumerate(GENERIC_JOINTS)}
    trunk = where["neck"] - where["root"]
    legs = _mean(where, "ankle") - _mean(where, "hip")
    arms = _mean(where, "wrist") - _mean(where, "shoulder")
    across = np.abs(_cosine(trunk, legs)) < _ACROSS
    down = _cosine(arms, legs) > _ALONG
    seen = ~np.isnan(_cosine(trunk, legs) + _cosine(arms, legs))
    if not seen.any() or (across & down)[seen].mean() < _NEARLY_ALL:
        return False
    # Along the bones: a person who bends the knees has no shorter legs.
    leg = sum(
        _length(*(where[side + end] - where[side + start] for side in "lr"))
        for start, end in (("hip", "knee"), ("knee", "ankle"))
    )
    is_long = _length(trunk) > _LONG_TRUNK * leg
    return is_long or any(is_a("tail", name) for name in names)


def _mean(where: dict[str, Floats], joint: str) -> Floats:
    mean: Floats = (where[f"l{joint}"] + where[f"r{joint}"]) / 2
    return mean


def _length(*ways: Floats) -> float:
    """Median over frames; NaN where nothing is seen."""
    lengths = np.linalg.norm(np.concatenate(ways), axis=1)
    seen = lengths[np.isfinite(lengths)]
    return float(np.median(seen)) if len(seen) else float("nan")


def _cosine(a: Floats, b: Floats) -> Floats:
    lengths = np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1)
    cosine: Floats = (a * b).sum(axis=1) / np.maximum(lengths, 1e-12)
    return cosine
