"""Which known skeleton do these joint names belong to, or how else are they mapped?

The known skeletons are tables in `tables/*.toml`, one a file, for people to read and extend;
how they are written stands in `table_files`. Joints that no table knows are mapped by the
shape of their tree, by sides and by names, and the mapping says so.
"""

from collections.abc import Collection, Iterable
from functools import cache, lru_cache

import numpy as np
from numpy.typing import NDArray

from motionary.errors import UnknownSkeleton
from motionary.motion import GENERIC_JOINTS, JointMapping, Skeleton, Unmapped
from motionary.skeletons.bodies import count_people, find_people, is_four_legged
from motionary.skeletons.guessing import guess_from_names, guess_from_tree
from motionary.skeletons.table_files import SkeletonTable, parse_table
from motionary.skeletons.words import is_paw, is_tail

Floats = NDArray[np.float64]

#: Words of the reason why an animal has none.
AN_ANIMAL = "an animal on four legs"

# Poses that suffice to see how a body is built.
_LOOKED_AT = 50


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
    return named_table(name).resolve(tuple(names))


def find_mapping(
    names: Iterable[str],
    skeleton: Skeleton | None = None,
    positions: Floats | None = None,
    *,
    told: SkeletonTable | None = None,
    without: Collection[str] = (),
) -> JointMapping | None:
    """The mapping of the known skeleton that fits joint names best, else a guess.

    Parameters
    ----------
    names : the file's joint names
    skeleton, positions : the file's tree of joints and where they are, shape (frames,
        joints, 3), in any unit and axes; a guess needs them, unless names say enough
    told : the table that the caller names, whatever fits
    without : tables to pass over

    Returns
    -------
    JointMapping, or None if no table finds enough of its joints among the names (60 %) and
    nothing can be guessed, or several people or an animal are in the file
    """
    names = tuple(names)
    if told is not None:
        return told.resolve(names)
    if count_people(names, _fits) > 1 or (skeleton is not None and len(_bodies(skeleton)) > 1):
        return None
    some = None if positions is None else _some(positions)
    mapping = _fitting(names, frozenset(without))
    if mapping is None and skeleton is not None and some is not None:
        mapping = guess_from_tree(skeleton, some)
    if mapping is None:
        mapping = guess_from_names(names)
    if mapping is not None and some is not None and is_four_legged(mapping, names, some):
        return None
    return mapping


def explain_unmapped(
    names: Iterable[str], skeleton: Skeleton | None = None, positions: Floats | None = None
) -> Unmapped:
    """Why `find_mapping` finds none."""
    names = tuple(names)
    people = find_people(names, _fits)
    n_people = max(len(people), 0 if skeleton is None else len(_bodies(skeleton)))
    if n_people > 1:
        called = f" ({', '.join(filter(None, people))})" if any(people) else ""
        return Unmapped(
            f"{n_people} people in one file{called}: save one file for each, or take the first "
            "with --skeleton NAME (skeleton=...)"
        )
    some = None if positions is None else _some(positions)
    guess = _fitting(names)
    if guess is None and skeleton is not None and some is not None:
        guess = guess_from_tree(skeleton, some)
    guess = guess or guess_from_names(names)
    animal = any(is_paw(name) or is_tail(name) for name in names)
    if animal or guess is not None:
        return Unmapped(f"{AN_ANIMAL}: the relations are those of people", is_human=False)
    few = ", ".join(names[:6]) + (", ..." if len(names) > 6 else "")
    return Unmapped(
        f"no known skeleton has the joints {few}, and neither legs nor arms were found among them: "
        "a prop, or a rig whose joints you must map: --skeleton RIG.toml (skeleton=...)"
    )


def _some(positions: Floats) -> Floats:
    return positions[:: 1 + len(positions) // _LOOKED_AT]


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
def _fitting(names: tuple[str, ...], without: frozenset[str] = frozenset()) -> JointMapping | None:
    there = frozenset(names)
    best: tuple[bool, float, int] | None = None
    result = None
    for table in _tables().values():
        if table.name in without:
            continue
        mapping = table.resolve(names)
        fraction = _fraction(mapping, there)
        # Of tables that fit alike, the one whose own names are there, not their substitutes.
        marked = bool(table.marks) and there.issuperset(table.marks)
        fit = (marked, fraction, -_compromises(table, mapping))
        if fraction >= table.enough and (best is None or fit > best):
            best, result = fit, mapping
    return result


def _fraction(mapping: JointMapping, names: Collection[str]) -> float:
    found = sum(all(n in names for n in source) for source in mapping.weights.values())
    return found / len(GENERIC_JOINTS)


def _compromises(table: SkeletonTable, mapping: JointMapping) -> int:
    """How many alternatives are missing before those that were taken."""
    total = 0
    for joint, alternatives in table.joints.items():
        taken = {name.rpartition(":")[2] for name in mapping.weights[joint]}
        total += next((i for i, source in enumerate(alternatives) if set(source) == taken), 0)
    return total


@cache
def _tables() -> dict[str, SkeletonTable]:
    # Imported late: reading tables costs more than reading most of what they are for.
    from importlib import resources

    folder = resources.files("motionary.skeletons") / "tables"
    files = sorted((f for f in folder.iterdir() if f.name.endswith(".toml")), key=lambda f: f.name)
    return {f.name[:-5]: parse_table(f.name[:-5], f.read_text("utf-8")) for f in files}
