"""Guessed mappings of joints that no table knows to the 24 generic joints.

With a tree, by its shape first: two symmetric chains with two long bones each are legs or
arms, what leads from one pair to the other is the spine, what goes on is neck and head. Names
say which side is left, which pair are legs, and where a hand begins; without names, the places
of feet and head tell left from right. Points without a tree are told by their names alone.
"""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.motion import GENERIC_JOINTS, JointMapping, Skeleton
from motionary.skeletons import words
from motionary.skeletons.table_files import Source
from motionary.skeletons.trees import MOST_JOINTS, Limbs, Tree, find_limbs, grow_tree

Floats = NDArray[np.float64]

#: Name of a mapping that was guessed.
GUESSED = "guessed"
_CHEST = "chest is put halfway from belly to neck, and features 3 to 6 stand on it"

_LEGS = tuple(side + joint for side in "lr" for joint in ("hip", "knee", "ankle"))
# Fractions of a leg's length: nearer than this, two joints are one; of the spine's length:
# what is nearer to the root than this is still the pelvis.
_SAME = 0.02
_PELVIS = 0.1
# Of a leg's length: a trunk of one bone is longer; its arms begin nearer to each other than that.
_FAR = 0.15
_TOGETHER = 0.5
# Of a limb's two long bones the shorter is at least this fraction of the longer; by lengths
# alone, of the longest pair.
_ALIKE = 0.4
_AS_LONG = 0.75


def guess_from_names(names: tuple[str, ...]) -> JointMapping | None:
    """A mapping by what names say, or None if they do not say where the legs are."""
    partners = words.find_partners(names)
    stems = words.stems(names, partners)
    has_arm = any(words.names_upper_arm(stems[name]) for name in partners)
    clusters = words.find_clusters(partners, stems)
    found: dict[str, tuple[int, str]] = {}
    spine: list[str] = []
    for name in names:
        if words.is_a("twist", name) or name in clusters:
            continue
        if name in partners:
            part = words.limb_part(stems[name], has_arm=has_arm)
            joint = partners[name][0] + part if part else ""
            fit = words.rank(stems[name], part) if part else 0
        else:
            joint, fit = words.middle_part(stems[name]) or "", 0
        if joint == "spine":
            spine.append(name)
        elif joint and (joint not in found or fit < found[joint][0]):
            found[joint] = (fit, name)
    if not all(joint in found for joint in _LEGS):
        return None
    weights: dict[str, Source] = {joint: {name: 1.0} for joint, (_, name) in found.items()}
    if "root" not in weights:
        weights["root"] = {found["lhip"][1]: 0.5, found["rhip"][1]: 0.5}
    substituted = _add_spine(weights, spine, chest_is_neck=False)
    return _to_mapping(weights, substituted, "by their names")


def guess_from_tree(skeleton: Skeleton, positions: Floats) -> JointMapping | None:
    """A mapping by the shape of a tree, or None if it is no person's.

    Parameters
    ----------
    skeleton : the file's joints
    positions : array, shape (frames, joints, 3), of some poses, in any unit and axes
    """
    if len(skeleton.names) > MOST_JOINTS:
        return None
    tree = grow_tree(skeleton, positions)
    limbs = find_limbs(tree)
    if limbs is None:
        return None
    weights: dict[str, Source] = {}

    def put(joint: str, node: int | None) -> None:
        if node is not None:
            weights[joint] = {tree.sources[node]: 1.0}

    leg_m = 0.0
    for side, path in zip("lr", limbs.legs, strict=True):
        ends = _long_bones(tree, path, ("hip", "knee", "ankle"))
        if ends is None:
            return None
        hip, knee, ankle = (path[end] for end in ends)
        leg_m = tree.distance(hip, knee) + tree.distance(knee, ankle)
        for joint, node in (("hip", hip), ("knee", knee), ("ankle", ankle)):
            put(side + joint, node)
        put(f"{side}toes", path[-1] if len(path) > ends.low + 1 else None)
    root, top = _ends_of_spine(tree, limbs)
    put("root", root)
    neck = _add_head(tree, limbs, top, put)
    spine = _spine(tree, root, top)
    own_neck = _neck_of_arms(tree, limbs, neck, top, leg_m)
    weights |= own_neck
    if not own_neck and neck is not None and spine and neck == spine[-1]:
        spine = spine[:-1]
    # A rig may have no arms.
    for side, path in zip("lr", limbs.arms, strict=False):
        _add_arm(tree, side, path, top if neck is None else neck, put)
    close = neck is not None and bool(spine) and tree.distance(spine[-1], neck) < _SAME * leg_m
    substituted = _add_spine(weights, [tree.sources[n] for n in spine], chest_is_neck=close)
    return _to_mapping(weights, substituted, limbs.told_by)


class _Ends(NamedTuple):
    """Places on the way down a limb: where its upper bone begins, its lower one, and that ends."""

    top: int
    middle: int
    low: int


def _long_bones(tree: Tree, path: list[int], parts: tuple[str, str, str]) -> _Ends | None:
    """Ends of the two long bones of a limb: by names that say all three, else by lengths.

    Parameters
    ----------
    path : nodes from the trunk to the tip
    parts : what the three ends are called
    """
    named = _named_ends(tree, path, parts)
    if named is not None:
        return named
    shorter = [
        min(tree.lengths[path[i + 1]], tree.lengths[path[i + 2]]) for i in range(len(path) - 2)
    ]
    if not shorter or max(shorter) <= 0:
        return None
    # A long way from the trunk to the shoulder is no upper arm: the last two that are long.
    top = max(i for i, length in enumerate(shorter) if length >= _AS_LONG * max(shorter))
    return _Ends(top, top + 1, top + 2)


def _named_ends(tree: Tree, path: list[int], parts: tuple[str, str, str]) -> _Ends | None:
    """The ends where names say all three, one below the other, and the bones are alike long."""
    has_arm = any(words.names_upper_arm(tree.stems[tree.names[node]]) for node in path)
    said = [words.limb_part(tree.stems[tree.names[node]], has_arm=has_arm) for node in path]
    if parts[1] not in said:
        return None
    middle = said.index(parts[1])
    tops = [i for i in range(middle) if said[i] == parts[0]]
    lows = [i for i in range(middle + 1, len(path)) if said[i] == parts[2]]
    if not tops or not lows:
        return None
    # Of a bone in several parts (`upperleg01`, `upperleg02`) the first is its start.
    stem = tree.stems[tree.names[path[tops[-1]]]]
    top = next(i for i in tops if tree.stems[tree.names[path[i]]] == stem)
    ends = _Ends(top, middle, lows[0])
    upper, lower = (tree.distance(path[a], path[b]) for a, b in pairwise(ends))
    return ends if min(upper, lower) > _ALIKE * max(upper, lower) else None


def _ends_of_spine(tree: Tree, limbs: Limbs) -> tuple[int | None, int | None]:
    """The node of the pelvis, and the one that the arms leave from."""
    low = tree.meeting(limbs.legs[0][0], limbs.legs[1][0])
    low = _above(tree, low, limbs.legs)
    if low is None:
        return None, None
    if not limbs.arms:
        return low, _below_neck(tree, low)
    top = _above(tree, tree.meeting(limbs.arms[0][0], limbs.arms[1][0]), limbs.arms)
    if top is None:
        return low, None
    root = tree.meeting(low, top)
    return (low if root == top else root), top


def _below_neck(tree: Tree, low: int) -> int | None:
    """Of a body without arms: what is called neck, or head, leaves the trunk from here."""
    for part in ("neck", "head"):
        for node in tree.below(low):
            if words.middle_part(tree.stems[tree.names[node]]) == part and node != low:
                return tree.parents[node]
    return None


def _above(tree: Tree, node: int | None, limbs: tuple[list[int], ...]) -> int | None:
    """The node itself, or what is above it if it belongs to a limb."""
    while node is not None and any(node in path for path in limbs):
        node = tree.parents[node] if tree.parents[node] >= 0 else None
    return node


def _spine(tree: Tree, root: int | None, top: int | None) -> list[int]:
    """Nodes from above the pelvis to where the arms leave."""
    if root is None or top is None or root == top:
        return []
    if root in tree.ancestors(top):
        way = tree.ancestors(top)[: tree.ancestors(top).index(root)][::-1]
    else:
        way = tree.ancestors(root)[1 : tree.ancestors(root).index(top) + 1]
    whole = tree.distance(root, way[-1])
    return [node for node in way if tree.distance(root, node) > _PELVIS * whole] if whole else []


def _add_head(
    tree: Tree, limbs: Limbs, top: int | None, put: Callable[[str, int | None], None]
) -> int | None:
    """Neck, head and top of the head; returns the neck."""
    if top is None:
        return None
    part = {node: words.middle_part(tree.stems[tree.names[node]]) for node in tree.below(top)}
    limb = {node for path in (*limbs.legs, *limbs.arms) for node in path}
    limb |= {tree.parents[path[0]] for path in limbs.arms if tree.parents[path[0]] != top}
    path: list[int] = []
    node = top
    while True:
        below = [n for n in tree.branches[node] if not limb & set(tree.below(n))]
        to_head = [n for n in below if any(part[m] == "head" for m in tree.below(n))]
        free = [n for n in below if tree.names[n] not in tree.partners]
        if not (to_head or free):
            break
        node = max(to_head or free, key=lambda n: tree.reach[n])
        path.append(node)
    if not path:
        return None
    heads = [i for i, n in enumerate(path) if part[n] == "head"]
    named = [i for i in heads if not words.is_a("end", tree.names[path[i]])]
    ends = words.is_a("end", tree.names[path[-1]]) or (not named and len(path) > 2)
    at = named[0] if named else len(path) - 2 if ends and len(path) > 1 else len(path) - 1
    put("head", path[at])
    put("headtop", path[at + 1] if at + 1 < len(path) else None)
    neck = path[0] if at > 0 else top
    put("neck", neck)
    return neck


def _neck_of_arms(
    tree: Tree, limbs: Limbs, neck: int | None, top: int | None, leg: float
) -> dict[str, Source]:
    """The neck where both arms begin together, far above the joint that they hang on.

    Of a trunk of one bone, with arms and head at its end, the joint of the spine is no neck.
    """
    if neck is None or neck != top or len(limbs.arms) != 2:
        return {}
    left, right = (path[0] for path in limbs.arms)
    apart, above = tree.distance(left, right), tree.distance(neck, left)
    if apart > _TOGETHER * above or above < _FAR * leg:
        return {}
    return {"neck": {tree.sources[left]: 0.5, tree.sources[right]: 0.5}}


def _add_arm(
    tree: Tree, side: str, path: list[int], neck: int | None, put: Callable[[str, int | None], None]
) -> None:
    ends = _long_bones(tree, path, ("shoulder", "elbow", "wrist"))
    if ends is None:
        return
    said = [tree.stems[tree.names[node]] for node in path]
    hands = [
        i for i in range(ends.low, len(path)) if words.limb_part(said[i], has_arm=True) == "wrist"
    ]
    # Where names are those of joints, the hand comes after the wrist; where they are those of
    # bones, what is called wrist is a bone before the hand.
    wrist = ends.low
    if hands:
        wrist = hands[0] if words.names_joint(said[ends.middle]) else hands[-1]
    put(f"{side}clavicle", path[ends.top - 1] if ends.top > 0 else neck)
    put(f"{side}shoulder", path[ends.top])
    put(f"{side}elbow", path[ends.middle])
    put(f"{side}wrist", path[wrist])
    put(f"{side}fingers", path[-1] if len(path) > wrist + 1 else None)


def _add_spine(
    weights: dict[str, Source], spine: list[str], *, chest_is_neck: bool
) -> tuple[str, ...]:
    """Belly and chest from the spine's joints; returns what had to be put in between."""
    if not spine:
        return ()
    weights["belly"] = {spine[0]: 1.0}
    if len(spine) > 1 and not chest_is_neck:
        weights["chest"] = {spine[-1]: 1.0}
        return ()
    neck = weights.get("neck")
    if neck is None or neck == weights["belly"]:
        return ()
    weights["chest"] = {spine[0]: 0.5} | {name: w / 2 for name, w in neck.items()}
    return ("chest",)


def _to_mapping(
    weights: dict[str, Source], substituted: tuple[str, ...], told_by: str
) -> JointMapping:
    ordered = {joint: weights[joint] for joint in GENERIC_JOINTS if joint in weights}
    said = ", ".join(f"{joint} {' + '.join(source)}" for joint, source in ordered.items())
    note = (
        f"no known skeleton: joints were mapped {told_by}: {said}; --save-mapping writes this "
        "down to be corrected"
    )
    if substituted:
        note += f"; {_CHEST}"
    return JointMapping(GUESSED, ordered, substituted, note)


def without_guess(mapping: JointMapping) -> JointMapping:
    """A mapping without the words that it was guessed: for who takes it over."""
    if mapping.name != GUESSED:
        return mapping
    return replace(mapping, note=_CHEST if mapping.substituted else "")
