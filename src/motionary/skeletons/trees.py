"""Legs and arms in a tree of joints, and which side they are on.

A limb is one of a pair of chains of like length that leave the trunk together. What hangs on
a body (props, hair, eyes, twist bones, handles of the rig) is left out before one looks.
"""

from dataclasses import dataclass
from heapq import nlargest
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.motion import Skeleton
from motionary.skeletons import words

Floats = NDArray[np.float64]

#: Nodes of a left and a right limb.
Pair = tuple[int, int]

# A limb is at least this fraction as long as the longest; a pair differs by less than the other.
_LONG = 0.35
_ALIKE = 0.05
# More chains than leave any joint of a trunk.
_MOST_CHAINS = 16
# No rig of a person has more joints, faces and all.
MOST_JOINTS = 3000
_GONE = -2
_THUMBS = frozenset({"thumb", "big", "daumen", "pouce", "pulgar", "pollice"})


@dataclass(frozen=True, slots=True)
class Tree:
    """Joints as starts of bones, without what hangs on the body.

    Attributes
    ----------
    names : of the bones; `sources` are the file's joints at their starts
    parents : -1 for a root
    places : array, shape (frames, nodes, 3)
    branches : nodes right below each
    partners : sides of the names, see `words.find_partners`
    stems : what the names say besides, see `words.stems`
    lengths : from the parent, median over frames
    reach : of the longest way down from the parent
    """

    names: tuple[str, ...]
    sources: tuple[str, ...]
    parents: tuple[int, ...]
    branches: tuple[list[int], ...]
    places: Floats
    partners: dict[str, tuple[str, str]]
    stems: dict[str, str]
    lengths: tuple[float, ...]
    reach: tuple[float, ...]

    def ancestors(self, node: int) -> list[int]:
        """The node and all above it, up to the root."""
        result = []
        while node >= 0:
            result.append(node)
            node = self.parents[node]
        return result

    def meeting(self, a: int, b: int) -> int | None:
        """The lowest node above both, or one of them; None in different trees."""
        above = set(self.ancestors(b))
        return next((node for node in self.ancestors(a) if node in above), None)

    def below(self, node: int) -> list[int]:
        """The node and all below it."""
        result = [node]
        for one in result:
            result += self.branches[one]
        return result

    def distance(self, a: int, b: int) -> float:
        """Distance of two nodes, median over frames."""
        return _median(self.places[:, a] - self.places[:, b])


class Limbs(NamedTuple):
    """Chains of nodes from the trunk to the tip, left and right; no arms: empty."""

    legs: tuple[list[int], ...]
    arms: tuple[list[int], ...]
    told_by: str


def grow_tree(skeleton: Skeleton, positions: Floats) -> Tree:
    """The tree of a skeleton.

    Parameters
    ----------
    skeleton : the file's joints
    positions : array, shape (frames, joints, 3), of some poses
    """
    names, sources, parents = _starts(skeleton)
    partners = words.find_partners(names)
    kept: list[int] = []
    place = {-1: -1}
    for node, parent in enumerate(parents):
        gone = parent >= 0 and place[parent] == _GONE
        if gone or words.is_a("extra", names[node]):
            place[node] = _GONE
        elif words.is_a("twist", names[node]) and names[node] in partners:
            place[node] = place[parent]
        else:
            place[node] = len(kept)
            kept.append(node)
    index = {name: i for i, name in enumerate(skeleton.names)}
    places = positions[:, [index[sources[node]] for node in kept]]
    above = tuple(place[parents[node]] for node in kept)
    lengths = [
        _median(places[:, i] - places[:, parent]) if parent >= 0 else 0.0
        for i, parent in enumerate(above)
    ]
    branches: tuple[list[int], ...] = tuple([] for _ in kept)
    for i, parent in enumerate(above):
        if parent >= 0:
            branches[parent].append(i)
    reach = list(lengths)
    for i, parent in reversed(list(enumerate(above))):
        if parent >= 0:
            reach[parent] = max(reach[parent], lengths[parent] + reach[i])
    kept_names = tuple(names[node] for node in kept)
    own = words.find_partners(kept_names)
    starts, stems = tuple(sources[node] for node in kept), words.stems(kept_names, own)
    return Tree(
        kept_names, starts, above, branches, places, own, stems, tuple(lengths), tuple(reach)
    )


def find_limbs(tree: Tree) -> Limbs | None:
    """Legs and arms, or None if there are no legs or left and right cannot be told."""
    pairs = _named_pairs(tree)
    told_by = "by the shape of their tree and their names"
    if not pairs:
        pairs, told_by = _alike_pairs(tree), "by the shape of their tree alone"
    if not pairs:
        return None
    longest = max(tree.reach[left] for left, _ in pairs)
    pairs = [pair for pair in pairs if min(tree.reach[n] for n in pair) >= _LONG * longest]
    legs, arms = _tell_apart(tree, pairs)
    if legs is None:
        return None
    paths = [tuple(_main_path(tree, start) for start in pair) for pair in (legs, arms) if pair]
    if legs[0] not in _starts_of(tree):
        sign = _side_by_place(tree, paths)
        if sign == 0:
            return None
        paths = [path if sign > 0 else path[::-1] for path in paths]
    return Limbs(paths[0], paths[1] if len(paths) > 1 else (), told_by)


def _starts(skeleton: Skeleton) -> tuple[list[str], list[str], list[int]]:
    """Bones by the joints at their starts: names, those joints, parents."""
    names, parents = list(skeleton.names), skeleton.parents.tolist()
    if not skeleton.ends:
        return names, list(names), parents
    # There a joint is the end of its bone: the bone starts at the joint above.
    sources = [
        names[max(parent, 0)] if parent >= 0 else names[i] for i, parent in enumerate(parents)
    ]
    leaves = sorted(set(range(len(names))) - set(parents))
    sources += [names[leaf] for leaf in leaves]
    return [*names, *(f"End of {names[leaf]}" for leaf in leaves)], sources, [*parents, *leaves]


def _starts_of(tree: Tree) -> set[int]:
    """Nodes with a side below a node without it."""
    return {
        node
        for node, (name, parent) in enumerate(zip(tree.names, tree.parents, strict=True))
        if name in tree.partners and (parent < 0 or tree.names[parent] not in tree.partners)
    }


def _named_pairs(tree: Tree) -> list[Pair]:
    """Starts of limbs by their names, left and right."""
    index = {name: i for i, name in enumerate(tree.names)}
    sided = [(node, tree.partners[tree.names[node]]) for node in sorted(_starts_of(tree))]
    return [(node, index[other]) for node, (side, other) in sided if side == "l"]


def _alike_pairs(tree: Tree) -> list[Pair]:
    """Starts of chains of like length below one node, among its longest chains."""
    sizes = _sizes(tree)
    pairs = []
    for node in range(len(tree.parents)):
        children = tree.branches[node]
        if len(children) > _MOST_CHAINS:
            # Of a face or a wide tree, all pairs are far too many, and none is a limb.
            longest = set(nlargest(_MOST_CHAINS, children, key=lambda child: tree.reach[child]))
            children = [child for child in children if child in longest]
        for a, b in combinations(children, 2):
            longer = max(tree.reach[a], tree.reach[b])
            alike = abs(tree.reach[a] - tree.reach[b]) < _ALIKE * longer
            if alike and sizes[a] == sizes[b]:
                pairs.append((a, b))
    return pairs


def _sizes(tree: Tree) -> list[int]:
    """Nodes below each, itself among them."""
    sizes = [1] * len(tree.parents)
    for node in range(len(sizes) - 1, -1, -1):
        if tree.parents[node] >= 0:
            sizes[tree.parents[node]] += sizes[node]
    return sizes


def _tell_apart(tree: Tree, pairs: list[Pair]) -> tuple[Pair | None, Pair | None]:
    """Which pair are legs and which arms: by names, else legs leave the trunk lower."""
    parts = _parts_below(tree)
    said = {pair: _kind_of(parts[pair[0]]) for pair in pairs}
    kinds = {pair: kind for pair, kind in said.items() if kind}

    def longest(kind: str) -> Pair | None:
        of_kind = [pair for pair in pairs if kinds.get(pair) == kind]
        return max(of_kind, key=lambda pair: tree.reach[pair[0]]) if of_kind else None

    legs, arms = longest("legs"), longest("arms")
    others = [pair for pair in pairs if pair not in kinds]
    if legs is None and arms is None:
        return _lower_first(tree, others)
    if len(others) == 1:
        return legs or others[0], arms or others[0]
    return legs, arms


def _lower_first(tree: Tree, pairs: list[Pair]) -> tuple[Pair | None, Pair | None]:
    """Of two pairs that names do not tell apart, first the one that leaves the trunk lower."""
    if len(pairs) != 2:
        return None, None
    for legs, arms in (pairs, pairs[::-1]):
        low, top = tree.meeting(*legs), tree.meeting(*arms)
        if low is not None and top is not None and low != top and low in tree.ancestors(top):
            return legs, arms
    return None, None


def _parts_below(tree: Tree) -> list[set[str]]:
    """Parts of limbs that the names of each node and of those below it speak of."""
    parts: list[set[str]] = [set() for _ in tree.parents]
    for node in range(len(parts) - 1, -1, -1):
        own = words.limb_part(tree.stems[tree.names[node]], has_arm=True)
        parts[node] |= {own} if own else set()
        if tree.parents[node] >= 0:
            parts[tree.parents[node]] |= parts[node]
    return parts


def _kind_of(parts: set[str]) -> str:
    """Whether names on the way down a limb speak of legs or of arms."""
    legs, arms = len(parts & words.LEG_PARTS), len(parts & words.ARM_PARTS)
    return "" if legs == arms else "legs" if legs > arms else "arms"


def _main_path(tree: Tree, start: int) -> list[int]:
    """From the start of a limb to its tip, by the middle finger or toe."""
    path = [start]
    while True:
        below = tree.branches[path[-1]]
        if not below:
            return path
        middle = [node for node in below if words.is_a("middle", tree.names[node])]
        others = [node for node in below if words.words_of(tree.names[node]).isdisjoint(_THUMBS)]
        path.append(max(middle or others or below, key=lambda node: tree.reach[node]))


def _side_by_place(tree: Tree, paths: list[tuple[list[int], ...]]) -> int:
    """1 if the first of each pair is on the left of the body, -1 on the right, 0 unknown."""
    first, second = paths[0]
    top = tree.meeting(paths[-1][0][0], paths[-1][1][0]) if len(paths) > 1 else None
    if top is None or min(len(first), len(second)) < 4:
        return 0
    places = tree.places
    up = places[:, top] - (places[:, first[-2]] + places[:, second[-2]]) / 2
    forward = sum(places[:, path[-1]] - places[:, path[-2]] for path in (first, second))
    left = np.cross(up, forward)
    along = ((places[:, first[0]] - places[:, second[0]]) * left).sum(axis=1)
    fraction = float((along > 0).mean())
    return 0 if 0.2 < fraction < 0.8 else 1 if fraction > 0.5 else -1


def _median(steps: Floats) -> float:
    lengths = np.linalg.norm(steps, axis=1)
    seen = lengths[np.isfinite(lengths)]
    return float(np.median(seen)) if len(seen) else 0.0
