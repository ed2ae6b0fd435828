"""Tables of skeletons, as text that people write and read.

TOML, for people to read and change. `[joints]` gives for a generic joint the name in the file,
a weighted sum of names (`{ Spine = 0.4, Neck = 0.6 }`), or a list of alternatives of which the
first one that is there counts. A table may call joints `substituted` and say why in `note`, and
give the usual `order` of the points for formats that have them without names. `[normals]` adds
a step away from the plane of three points: `lhip = { points = ["A", "B", "C"], share = 0.4 }`,
or a list of such, of which that counts whose points are those of the chosen alternative; see
`Normal`. `enough` is the fraction of its joints that must be there, where partial bodies are
usual, and `needs` are generic joints that must be; `marks` are names by which a skeleton is told
from others with nearly its names.
"""

import json
import re
import textwrap
import unicodedata
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from motionary.errors import InvalidInput, describe_cause
from motionary.motion import GENERIC_JOINTS, JointMapping, Normal

# A table fits if this fraction of its joints is there: hands and toes are often cut off.
ENOUGH = 0.6

Source = dict[str, float]

# What stands between the parts of a name, and a part at its start or end. A side is no
# subject: few files have one side alone.
_BETWEEN = re.compile(r"[\s._-]+")
_PREFIX = re.compile(r"^[^\s._-]+[\s._|-]+(?=.)")
# What stands before the last colon is a person or rig; glTF of three.js drops Mixamo's colon.
_BEFORE = re.compile(r"^(?:.*:|mixamorig\d*(?=[A-Z]))")
_SUFFIX = re.compile(r"(?<=.)[._-][^\s._-]+$")
_FEWEST = 7
_TO_FILL_IN = (
    "No joint is mapped yet: write the rig's names behind the joints that it has, such as "
    'lknee = "left_calf", and take away the # before them. Joints that it lacks stay as they are.'
)
_SHARED = 0.6
_MOST_AFFIXES = 3

_KEYS = (
    "about", "note", "substituted", "order", "enough", "needs", "marks", "joints", "normals",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class SpelledNames:
    """Names of a file by what a table may call them.

    Attributes
    ----------
    exact : the file's names, also by what stands behind their last colon: `Daniel:LSHO`
    loose : by folded spelling, see `fold`, and without what most names begin or end with:
        `S1_LSHO`, `r_knee_study`; names that differ by spelling alone are not among them
    """

    exact: Mapping[str, str]
    loose: Mapping[str, str]

    def find(self, name: str) -> str | None:
        """The file's name of what a table calls so."""
        return self.exact.get(name) or self.loose.get(fold(name))


def fold(name: str) -> str:
    """A name without what spellings differ in: case, dots, dashes, forms of Unicode."""
    return _BETWEEN.sub("", unicodedata.normalize("NFC", name).casefold())


# Folders hold many files of few rigs.
@lru_cache(maxsize=64)
def spell(names: tuple[str, ...]) -> SpelledNames:
    """Names of a file as tables look for them."""
    exact = {_BEFORE.sub("", name): name for name in reversed(names)}
    exact |= {name: name for name in names}
    loose: dict[str, set[str]] = {}
    bare = _without_affixes([name.rpartition(":")[2] for name in names])
    for name, short in zip(names, bare, strict=True):
        for spelling in {fold(name), fold(name.rpartition(":")[2]), fold(short)}:
            loose.setdefault(spelling, set()).add(name)
    return SpelledNames(
        exact, {spelling: full.pop() for spelling, full in loose.items() if len(full) == 1}
    )


def _without_affixes(names: list[str]) -> list[str]:
    """Names without what most of them begin or end with, up to a separator."""
    for pattern in (_PREFIX, _SUFFIX):
        for _ in range(_MOST_AFFIXES):
            found = [pattern.search(name) for name in names]
            counts = Counter(m.group().casefold() for m in found if m)
            common, n = max(counts.items(), key=lambda item: item[1], default=("", 0))
            if n < max(_FEWEST, _SHARED * len(names)):
                break
            names = [
                pattern.sub("", name) if m and m.group().casefold() == common else name
                for name, m in zip(names, found, strict=True)
            ]
    return names


@dataclass(frozen=True, slots=True)
class SkeletonTable:
    """A table as written: per generic joint its alternatives, best first."""

    name: str
    joints: dict[str, tuple[Source, ...]]
    substituted: tuple[str, ...] = ()
    note: str = ""
    order: tuple[str, ...] = ()
    normals: Mapping[str, tuple[Normal, ...]] = field(default_factory=dict)
    enough: float = ENOUGH
    marks: tuple[str, ...] = ()
    needs: tuple[str, ...] = ()

    def resolve(self, names: tuple[str, ...]) -> JointMapping:
        """The mapping for a file with these names.

        They decide between alternatives. What is not there as the table writes it may be there
        in other letters or behind a prefix, see `SpelledNames`.
        """
        spelled = spell(names)
        weights, normals = {}, {}
        for joint in self.joints:
            source = self.joints[joint][max(self.choice(joint, spelled), 0)]
            full = {name: spelled.find(name) or name for name in source}
            weights[joint] = {full[name]: weight for name, weight in source.items()}
            normal = self._normal(joint, source)
            if normal is not None:
                points = {name: spelled.find(name) or name for name in normal[:3]}
                normals[joint] = normal.renamed(points)
        return JointMapping(self.name, weights, self.substituted, self.note, self.order, normals)

    def choice(self, joint: str, spelled: SpelledNames, *, exactly: bool = False) -> int:
        """Number of the first alternative of a joint that is there; -1 if none is."""
        for i, source in enumerate(self.joints[joint]):
            if all(name in spelled.exact for name in source):
                return i
        for i, source in enumerate(() if exactly else self.joints[joint]):
            if all(spelled.find(name) is not None for name in source):
                return i
        return -1

    def _normal(self, joint: str, source: Source) -> Normal | None:
        """The step that an alternative needs; a joint centre that is in the file needs none."""
        normals = self.normals.get(joint, ())
        for normal in normals:
            if set(source) <= set(normal[:3]):
                return normal
        return normals[-1] if normals and source == self.joints[joint][-1] else None


def parse_table(name: str, text: str, *, source: str = "") -> SkeletonTable:
    """The table that a text holds.

    Parameters
    ----------
    name : what the skeleton is called
    text : TOML
    source : what the errors call it; its name by default

    Raises
    ------
    InvalidInput
        If it is no TOML, or no such table; says what is wrong where.
    """
    import tomllib

    source = source or f"skeleton {name}"
    try:
        content = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise InvalidInput(f"is no TOML: {describe_cause(error)}", file=source) from error
    unknown = sorted(set(content) - set(_KEYS))
    if unknown or not isinstance(content.get("joints"), dict):
        got = f"got {unknown[0]!r}" if unknown else "[joints] is not there"
        raise InvalidInput(f"a skeleton has {', '.join(_KEYS)}; {got}", file=source)
    try:
        return SkeletonTable(
            name,
            {joint: _parse_source(source) for joint, source in _checked(content["joints"])},
            tuple(content.get("substituted", ())),
            str(content.get("note", "")),
            tuple(content.get("order", ())),
            {
                joint: _parse_normals(normals)
                for joint, normals in _checked(content.get("normals", {}))
            },
            float(content.get("enough", ENOUGH)),
            tuple(content.get("marks", ())),
            tuple(content.get("needs", ())),
        )
    except (TypeError, ValueError, KeyError) as error:
        raise InvalidInput(str(error), file=source) from error


def format_table(mapping: JointMapping, *, about: str, names: tuple[str, ...] = ()) -> str:
    """A mapping as such a text, which `parse_table` reads.

    Parameters
    ----------
    mapping : what to write
    about : whose joints these are
    names : all names that there are, written as a remark for who corrects the mapping
    """
    joints = "".join(letter if letter.isprintable() else "?" for letter in ", ".join(names))
    remarks = [
        *([] if mapping.weights else [_TO_FILL_IN]),
        *([f"joints: {joints}"] if names else []),
    ]
    lines = [
        f"# {line}" for text in remarks for line in textwrap.wrap(text, 96, break_on_hyphens=False)
    ]
    lines.append(f"about = {_quoted(about)}")
    if mapping.note:
        lines.append(f"note = {_quoted(mapping.note)}")
    for key, values in (("substituted", mapping.substituted), ("order", mapping.order)):
        if values:
            lines.append(f"{key} = [{', '.join(map(_quoted, values))}]")
    lines += ["", "[joints]"]
    for joint in GENERIC_JOINTS:
        source = mapping.weights.get(joint)
        lines.append(
            f"{joint} = {_format_source(source)}" if source is not None else f"# {joint} ="
        )
    if mapping.normals:
        lines += ["", "[normals]"]
        for joint, normal in mapping.normals.items():
            points = ", ".join(map(_quoted, normal[:3]))
            lines.append(f"{joint} = {{ points = [{points}], share = {normal.fraction!r} }}")
    return "\n".join(lines) + "\n"


def _checked(joints: dict[str, Any]) -> list[tuple[str, Any]]:
    wrong = sorted(set(joints) - set(GENERIC_JOINTS))
    if wrong:
        raise ValueError(
            f"{wrong[0]!r} is none of the joints that features need: {', '.join(GENERIC_JOINTS)}"
        )
    return list(joints.items())


def _parse_source(source: Any) -> tuple[Source, ...]:
    alternatives = source if isinstance(source, list) else [source]
    if not alternatives:
        raise ValueError("a list of alternatives needs at least one name")
    return tuple(_parse_alternative(one) for one in alternatives)


def _parse_alternative(source: Any) -> Source:
    if isinstance(source, str):
        return {source: 1.0}
    if not isinstance(source, dict) or not source:
        raise ValueError(f"a joint is a name or a sum of names with weights, got {source!r}")
    return {str(name): float(weight) for name, weight in source.items()}


def _parse_normals(content: Any) -> tuple[Normal, ...]:
    normals = []
    for one in content if isinstance(content, list) else [content]:
        a, b, c = one["points"]
        normals.append(Normal(a, b, c, one["share"]))
    return tuple(normals)


def _format_source(source: Source) -> str:
    if list(source.values()) == [1.0]:
        return _quoted(next(iter(source)))
    return f"{{ {', '.join(f'{_quoted(n)} = {w!r}' for n, w in source.items())} }}"


def _quoted(text: str) -> str:
    # Of JSON's strings, all are TOML's but for DEL.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
