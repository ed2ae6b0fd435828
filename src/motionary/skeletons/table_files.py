"""How is a table of a skeleton written and read?

TOML, for people to read and change. `[joints]` gives for a generic joint the name in the file,
a weighted sum of names (`{ Spine = 0.4, Neck = 0.6 }`), or a list of alternatives of which the
first one that is there counts. A table may call joints `substituted` and say why in `note`, and
give the usual `order` of the points for formats that have them without names. `[normals]` adds
a step away from the plane of three points: `lhip = { points = ["A", "B", "C"], share = 0.4 }`,
see `Normal`. `enough` is the share of its joints that must be there, where partial bodies are
usual; `marks` are names by which a skeleton is told from others with nearly its names.
"""

import json
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from motionary.errors import InvalidInput
from motionary.motion import GENERIC_JOINTS, JointMapping, Normal

# A table fits if this share of its joints is there: hands and toes are often cut off.
ENOUGH = 0.6

Source = dict[str, float]

_KEYS = ("about", "note", "substituted", "order", "enough", "marks", "joints", "normals")


@dataclass(frozen=True, slots=True)
class SkeletonTable:
    """A table as written: per generic joint its alternatives, best first."""

    name: str
    joints: dict[str, tuple[Source, ...]]
    substituted: tuple[str, ...] = ()
    note: str = ""
    order: tuple[str, ...] = ()
    normals: Mapping[str, Normal] = field(default_factory=dict)
    enough: float = ENOUGH
    marks: tuple[str, ...] = ()

    def resolve(self, names: tuple[str, ...]) -> JointMapping:
        """The mapping for a file with these names.

        They decide between alternatives, and may carry a prefix that ends in a colon.
        """
        # `Daniel:LSHO`, `mixamorig:Hips`: what stands before the last colon is a person or rig.
        full = {name.rpartition(":")[2]: name for name in reversed(names)}
        full |= {name: name for name in names}
        weights = {}
        for joint, alternatives in self.joints.items():
            there = (source for source in alternatives if all(n in full for n in source))
            chosen = next(there, alternatives[0])
            weights[joint] = {full.get(n, n): w for n, w in chosen.items()}
        normals = {
            # A joint centre that the file gives itself needs no step.
            joint: normal.renamed(full)
            for joint, normal in self.normals.items()
            if set(weights[joint]) == {full.get(n, n) for n in self.joints[joint][-1]}
        }
        return JointMapping(self.name, weights, self.substituted, self.note, self.order, normals)


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
    except tomllib.TOMLDecodeError as error:
        raise InvalidInput(f"{source}: is no TOML: {error}") from error
    unknown = sorted(set(content) - set(_KEYS))
    if unknown or not isinstance(content.get("joints"), dict):
        got = f"got {unknown[0]!r}" if unknown else "[joints] is not there"
        raise InvalidInput(f"{source}: a skeleton has {', '.join(_KEYS)}; {got}")
    try:
        return SkeletonTable(
            name,
            {joint: _parse_source(source) for joint, source in _checked(content["joints"])},
            tuple(content.get("substituted", ())),
            str(content.get("note", "")),
            tuple(content.get("order", ())),
            {
                joint: _parse_normal(normal)
                for joint, normal in _checked(content.get("normals", {}))
            },
            float(content.get("enough", ENOUGH)),
            tuple(content.get("marks", ())),
        )
    except (TypeError, ValueError, KeyError) as error:
        raise InvalidInput(f"{source}: {error}") from error


def format_table(mapping: JointMapping, *, about: str, names: tuple[str, ...] = ()) -> str:
    """A mapping as such a text, which `parse_table` reads.

    Parameters
    ----------
    mapping : what to write
    about : whose joints these are
    names : all names that there are, written as a remark for who corrects the mapping
    """
    remark = _one_line(f"joints: {', '.join(names)}") if names else ""
    lines = [f"# {line}" for line in textwrap.wrap(remark, 96, break_on_hyphens=False)]
    lines.append(f"about = {_quoted(about)}")
    if mapping.note:
        lines.append(f"note = {_quoted(mapping.note)}")
    for key, values in (("substituted", mapping.substituted), ("order", mapping.order)):
        if values:
            lines.append(f"{key} = [{', '.join(map(_quoted, values))}]")
    lines += ["", "[joints]"]
    for joint in GENERIC_JOINTS:
        if joint in mapping.weights:
            lines.append(f"{joint} = {_format_source(mapping.weights[joint])}")
        else:
            lines.append(f"# {joint} =")
    if mapping.normals:
        lines += ["", "[normals]"]
        for joint, normal in mapping.normals.items():
            points = ", ".join(map(_quoted, normal[:3]))
            lines.append(f"{joint} = {{ points = [{points}], share = {normal.fraction!r} }}")
    return "\n".join(lines) + "\n"


def _one_line(text: str) -> str:
    return "".join(letter if letter.isprintable() else "?" for letter in text)


def _checked(joints: dict[str, Any]) -> list[tuple[str, Any]]:
    wrong = sorted(set(joints) - set(GENERIC_JOINTS))
    if wrong:
        raise ValueError(
            f"{wrong[0]!r} is none of the joints that relations need: {', '.join(GENERIC_JOINTS)}"
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


def _parse_normal(content: dict[str, Any]) -> Normal:
    a, b, c = content["points"]
    return Normal(a, b, c, content["share"])


def _format_source(source: Source) -> str:
    if list(source.values()) == [1.0]:
        return _quoted(next(iter(source)))
    return f"{{ {', '.join(f'{_quoted(n)} = {w!r}' for n, w in source.items())} }}"


def _quoted(text: str) -> str:
    # Of JSON's strings, all are TOML's but for DEL.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
