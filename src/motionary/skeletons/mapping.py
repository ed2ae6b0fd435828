"""Which known skeleton do these joint names belong to?

The skeletons are tables in `tables/*.toml`, one a file, for people to read and extend:
`[joints]` gives for a generic joint the name in the file, a weighted sum of names
(`{ Spine = 0.4, Neck = 0.6 }`), or a list of alternatives of which the first one that
is there counts. A table may call joints `substituted` and say why in `note`, and give
the usual `order` of the points for formats that have them without names. `[normals]` adds
a step away from the plane of three points: `lhip = { points = ["A", "B", "C"], share = 0.4 }`,
see `Normal`. `enough` is the share of its joints that must be there, where partial bodies
are usual.
"""

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from functools import cache
from typing import Any

from motionary.errors import InvalidInput
from motionary.motion import GENERIC_JOINTS, JointMapping, Normal

# A table fits if this share of its joints is there: hands and toes are often cut off.
ENOUGH = 0.6

Source = dict[str, float]


@dataclass(frozen=True, slots=True)
class _Table:
    """A table as written: per generic joint its alternatives, best first."""

    name: str
    joints: dict[str, tuple[Source, ...]]
    substituted: tuple[str, ...]
    note: str
    order: tuple[str, ...]
    normals: dict[str, Normal]
    enough: float


def known_mappings() -> tuple[str, ...]:
    """Names of the known skeletons, sorted."""
    return tuple(sorted(_tables()))


def named_mapping(name: str, names: Iterable[str] = ()) -> JointMapping:
    """The mapping of a known skeleton.

    Parameters
    ----------
    name : one of `known_mappings()`
    names : the file's joint names; they decide between alternatives and may carry a
        prefix that ends in a colon

    Raises
    ------
    InvalidInput
        If no table has this name.
    """
    tables = _tables()
    if name not in tables:
        raise InvalidInput(
            f"skeleton must be one of {', '.join(sorted(tables))}, got {name!r}; "
            "choose one of these or leave it out to let the names decide"
        )
    return _resolve(tables[name], tuple(names))


def find_mapping(names: Iterable[str]) -> JointMapping | None:
    """The mapping of the known skeleton that fits joint names best.

    Returns
    -------
    JointMapping, or None if no table finds enough of its joints among the names (60 %)
    """
    names = tuple(names)
    there = frozenset(names)
    fitting = []
    for table in _tables().values():
        mapping = _resolve(table, names)
        share = _share(mapping, there)
        if share >= table.enough:
            fitting.append((share, mapping))
    return max(fitting, key=lambda pair: pair[0])[1] if fitting else None


def _share(mapping: JointMapping, names: Collection[str]) -> float:
    found = sum(all(n in names for n in source) for source in mapping.weights.values())
    return found / len(GENERIC_JOINTS)


def _resolve(table: _Table, names: tuple[str, ...]) -> JointMapping:
    # `Daniel:LSHO`, `mixamorig:Hips`: what stands before the last colon is a person or rig.
    full = {name.rpartition(":")[2]: name for name in reversed(names)}
    full |= {name: name for name in names}
    weights = {}
    for joint, alternatives in table.joints.items():
        there = (source for source in alternatives if all(n in full for n in source))
        chosen = next(there, alternatives[0])
        weights[joint] = {full.get(n, n): w for n, w in chosen.items()}
    normals = {
        # A joint centre that the file gives itself needs no step.
        joint: normal.renamed(full)
        for joint, normal in table.normals.items()
        if set(weights[joint]) == {full.get(n, n) for n in table.joints[joint][-1]}
    }
    return JointMapping(table.name, weights, table.substituted, table.note, table.order, normals)


@cache
def _tables() -> dict[str, _Table]:
    # Imported late: reading tables costs more than reading most of what they are for.
    from importlib import resources

    folder = resources.files("motionary.skeletons") / "tables"
    files = sorted((f for f in folder.iterdir() if f.name.endswith(".toml")), key=lambda f: f.name)
    return {f.name[:-5]: _parse(f.name[:-5], f.read_text("utf-8")) for f in files}


def _parse(name: str, text: str) -> _Table:
    import tomllib

    content = tomllib.loads(text)
    joints = {}
    for joint, source in content["joints"].items():
        alternatives = source if isinstance(source, list) else [source]
        joints[joint] = tuple({s: 1.0} if isinstance(s, str) else dict(s) for s in alternatives)
    unknown = set(joints) - set(GENERIC_JOINTS)
    if unknown:
        raise InvalidInput(f"table {name}: {sorted(unknown)} are no generic joints")
    return _Table(
        name,
        joints,
        tuple(content.get("substituted", ())),
        content.get("note", ""),
        tuple(content.get("order", ())),
        {joint: _parse_normal(normal) for joint, normal in content.get("normals", {}).items()},
        content.get("enough", ENOUGH),
    )


def _parse_normal(content: dict[str, Any]) -> Normal:
    a, b, c = content["points"]
    return Normal(a, b, c, content["share"])
