"""The axis that points up in a file, and turning a recording so that y is up.

By the body over the whole recording. Now and then the head (or what is seen of the trunk) is
above the feet: it stands along that axis. Who lies on the floor seems to stand along another
one; then the floor tells: the lowest point of a body stays near it, whatever the body does,
while the ends of a body along other axes wander. A body that lies still, or crouches all the
time, does not tell.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.io.normalise.units import INSISTS, FileMetadata
from motionary.motion import GENERIC_JOINTS, Motion, Skeleton
from motionary.rotations import matrices_to_quaternions, multiply_quaternions

Floats = NDArray[np.float64]

#: Axis that points up, and the file's axes (with signs) that become x, y and z.
_TURNS: dict[str, tuple[tuple[int, int], ...]] = {
    "x": ((1, -1), (0, 1), (2, 1)),
    "y": ((0, 1), (1, 1), (2, 1)),
    "z": ((0, 1), (2, 1), (1, -1)),
    "-x": ((1, 1), (0, -1), (2, 1)),
    "-y": ((0, 1), (1, -1), (2, -1)),
    "-z": ((0, 1), (2, -1), (1, 1)),
}
UPS = tuple(_TURNS)

# Cosine: who stands along an axis has the head within 37 degrees of it, above the feet.
_CLEAR = 0.8
_NOW_AND_THEN = 0.1
_HARDLY_EVER = 0.02
_MOSTLY = 0.5
# A floor is clearly steadier than another if it moves half as much, and that other one by
# this fraction of the way from feet to head.
_HALF = 0.5
_MOVES = 0.05
# Who jumps leaves the floor by less than this fraction of the body, who crawls goes further.
_CRAWLS = 0.5
# Who walks goes at least half a body's length, mostly in the direction of the face.
_SOME_WAY = 0.5
_FACING = 0.6
_HIGH = ("headtop", "head", "neck", "chest")
_LOW = ("ltoes", "rtoes", "lankle", "rankle")
# Hips of who breathes stir less than this fraction of the body.
_STIRS = 0.03
_ENDS = (
    (_HIGH, _LOW),
    (("root", "lhip", "rhip"), _LOW),
    (_HIGH, ("root", "lhip", "rhip", "belly")),
)


@dataclass(frozen=True, eq=False)
class Stance:
    """How a body stands; what only doubtful cases need is computed when it is asked for.

    Attributes
    ----------
    fractions : per axis, the fraction of frames in which the body stands along it
    bodies, along : frames in which that is known, and the way from the body's low end to the
        high one in each
    size : the usual length of that way
    has_feet : whether the low end are feet
    """

    fractions: dict[str, float]
    bodies: Floats
    along: Floats
    size: float
    has_feet: bool

    @cached_property
    def floors(self) -> dict[str, float]:
        """Per axis, how far the body's end on its side wanders, as a fraction of the body.

        0 where no foot is seen, as there is no floor to tell of.
        """
        bodies = self.bodies[:, ~np.isnan(self.bodies).all(axis=(0, 2))]
        ends = np.hstack((np.nanmin(bodies, axis=1), np.nanmax(bodies, axis=1)))
        wander = _wandering(ends) / self.size if self.has_feet else np.zeros(6)
        return dict(zip(("x", "y", "z", "-x", "-y", "-z"), wander.tolist(), strict=True))

    @cached_property
    def walks(self) -> bool:
        """Whether the body goes some way, and in the direction that it faces."""
        return _walks(self.bodies, self.along, self.size)

    @cached_property
    def is_planted(self) -> bool:
        """Whether a foot stays where it is while the hips move, as of who stands."""
        return _is_planted(self.bodies, self.size)

    def stands(self, axis: str) -> bool:
        """Whether the body stands along an axis now and then."""
        return self.fractions[axis] >= _NOW_AND_THEN

    def steadier(self, axis: str, other: str) -> bool:
        """Whether there is a floor along one axis rather than along the other."""
        return self.floors[axis] < _HALF * self.floors[other] and self.floors[other] > _MOVES

    def refutes(self, axis: str) -> str | None:
        """The axis along which the body clearly stands, if it clearly is not the given one."""
        best = max(self.fractions, key=lambda a: self.fractions[a])
        never = self.fractions[axis] < _HARDLY_EVER and self.fractions[best] > _MOSTLY
        return best if never and not is_still(self, usual=axis, seen=best) else None


def check_up(up: str) -> str:
    """The name of an axis, lower case, without a plus or an exclamation mark.

    Raises
    ------
    InvalidInput
        If it names none.
    """
    axis = up.strip().lower().removeprefix("+").removesuffix(INSISTS)
    if axis not in _TURNS:
        raise InvalidInput(f"up must be one of {', '.join(UPS)}, got {up!r}")
    return axis


def turn_up(positions: Floats, up: str) -> Floats:
    """Positions with y up, of positions in which `up` is; right-handed stays right-handed.

    Parameters
    ----------
    positions : array, shape (..., 3)
    up : one of `UPS`
    """
    axes = _TURNS[check_up(up)]
    if up == "y":
        return positions
    result = np.empty_like(positions)
    for i, (axis, sign) in enumerate(axes):
        np.multiply(positions[..., axis], sign, out=result[..., i])
    return result


def turn(motion: Motion, up: str) -> Motion:
    """The motion with y up, of one in which `up` is; of a rig, the roots turn."""
    if check_up(up) == "y":
        return motion
    skeleton, rotations = motion.skeleton, motion.rotations
    if skeleton is not None:
        roots = skeleton.parents < 0
        offsets = skeleton.offsets.copy()
        offsets[roots] = turn_up(offsets[roots], up)
        skeleton = Skeleton(skeleton.names, skeleton.parents, offsets, ends=skeleton.ends)
        if rotations is not None:
            world = matrices_to_quaternions(turn_up(np.eye(3), up).T)
            rotations = rotations.copy()
            rotations[:, roots] = multiply_quaternions(world, rotations[:, roots])
    return replace(
        motion, positions=turn_up(motion.positions, up), skeleton=skeleton, rotations=rotations
    )


def turn_back(positions: Floats, up: str) -> Floats:
    """The inverse of `turn_up`."""
    result = np.empty_like(positions)
    for i, (axis, sign) in enumerate(_TURNS[check_up(up)]):
        np.multiply(positions[..., i], sign, out=result[..., axis])
    return result


def find_stance(generic: Floats) -> Stance | None:
    """How the body stands; None if neither feet and trunk nor a trunk is seen.

    Parameters
    ----------
    generic : array, shape (frames, 24, 3), generic joints in any unit, NaN = not seen
    """
    for high, low in _ENDS:
        has_feet = low == _LOW
        along = _mean_of(generic, high) - _mean_of(generic, low)
        seen = ~np.isnan(along).any(axis=1)
        if seen.any():
            break
    else:
        return None
    along = along[seen]
    lengths = np.linalg.norm(along, axis=1, keepdims=True)
    cosines = along / np.maximum(lengths, 1e-12)
    size = max(float(np.median(lengths)), 1e-12)
    fractions = {}
    for i, letter in enumerate("xyz"):
        fractions[letter] = float((cosines[:, i] > _CLEAR).mean())
        fractions[f"-{letter}"] = float((cosines[:, i] < -_CLEAR).mean())
    return Stance(fractions, generic[seen], along, size, has_feet)


def detect_up(stance: Stance | None, *, usual: str) -> str | None:
    """The axis that points up by the body, or None if it does not tell.

    Parameters
    ----------
    stance : see `find_stance`
    usual : axis of the format; it counts if the body stands along it now and then, or has
        its floor there, unless another axis has both and the steadier floor
    """
    if stance is None:
        return None
    standing = [axis for axis in UPS if stance.stands(axis)]
    if not standing:
        return None
    best = usual if usual in standing else max(standing, key=lambda axis: stance.fractions[axis])
    rivals = [axis for axis in standing if axis != best and stance.steadier(axis, best)]
    best = min(rivals, key=lambda axis: stance.floors[axis]) if rivals else best
    if usual in standing:
        return best
    crawls = stance.steadier(usual, best) and stance.floors[best] > _CRAWLS and not stance.walks
    return usual if crawls else best


def is_still(stance: Stance, *, usual: str, seen: str) -> bool:
    """Whether a body along another axis than the usual one may as well be lying still."""
    if usual.removeprefix("-") == seen.removeprefix("-"):
        return False
    # Who lies and moves may keep a foot in its place, too, but rests on the usual floor.
    stands = stance.is_planted and stance.floors[seen] <= stance.floors[usual]
    return not (stance.walks or stands or stance.steadier(seen, usual))


class Decision(NamedTuple):
    """An axis, the note on it, and whether the body casts doubt on it."""

    axis: str
    note: str
    is_doubtful: bool = False


def find_axis(
    motion: Motion, metadata: FileMetadata, up: str | None, stance: Stance | None
) -> Decision:
    """The axis that points up, and a note on where that is known from.

    Raises
    ------
    InvalidInput
        If the caller or the file contradicts the body, or it lies or stands, one cannot know.
    """
    if up is not None:
        axis = check_up(up)
        other = None if stance is None else stance.refutes(axis)
        if other is not None and not up.strip().endswith(INSISTS):
            raise InvalidInput(
                f"{axis} points up as given, but its head is above its feet along "
                f"{other}; say which with --up {other} or, to insist, --up '{axis}!' (up=...)",
                file=motion.source,
            )
        return Decision(axis, f"{axis} up, as given")
    usual = metadata.up or metadata.usual_up
    seen = detect_up(stance, usual=usual)
    lies = stance is not None and seen is not None and is_still(stance, usual=usual, seen=seen)
    found = _find_unstated_axis(motion, metadata, usual, seen, is_still=lies)
    if metadata.origin and found.axis == usual:
        return Decision(usual, f"{usual} up, as {metadata.origin} has")
    return found


def _find_unstated_axis(
    motion: Motion, metadata: FileMetadata, usual: str, seen: str | None, *, is_still: bool
) -> Decision:
    source = motion.source
    if metadata.up is not None and seen not in (None, metadata.up) and not is_still:
        raise InvalidInput(
            f"says that {metadata.up} points up, but its head is above its "
            f"feet along {seen}; say which with --up {metadata.up} or --up {seen} (up=...)",
            file=source,
        )
    if metadata.up is not None:
        stated = "as the file says"
    else:
        stated = "by definition" if metadata.by_definition else "assumed"
    if not is_still:
        by_body = seen is not None and metadata.up is None
        axis = seen or usual
        return Decision(axis, f"{axis} up, {'by the body' if by_body else stated}")
    if metadata.up is not None or metadata.by_definition:
        note = f"{usual} up, {stated}; the body lies along {seen}, or stands still"
        return Decision(usual, note, is_doubtful=True)
    if _rest_axis(motion) not in (None, seen):
        raise InvalidInput(
            f"its body stands along {seen}, or lies still where {usual} points up; "
            f"say which with --up {seen} or --up {usual} (up=...)",
            file=source,
        )
    return Decision(str(seen), f"{seen} up, by the body, which stands or lies still")


def _rest_axis(motion: Motion) -> str | None:
    """The axis along which a rig stands when nothing is turned, by its offsets."""
    skeleton = motion.skeleton
    if skeleton is None or motion.mapping is None or skeleton.ends:
        return None
    places = np.zeros_like(skeleton.offsets)
    for joint, parent in enumerate(skeleton.parents.tolist()):
        places[joint] = skeleton.offsets[joint] + (places[parent] if parent >= 0 else 0.0)
    at_rest = replace(motion, positions=places[None], rotations=None)
    stance = find_stance(at_rest.generic_positions())
    return None if stance is None else next((axis for axis in UPS if stance.stands(axis)), None)


def _walks(bodies: Floats, along: Floats, size: float) -> bool:
    """Whether a body goes where it faces, forward or backward, across its own axis."""
    root = bodies[:, GENERIC_JOINTS.index("root")]
    sides = [_mean_of(bodies, (f"{side}hip", f"{side}shoulder")) for side in "lr"]
    facing = np.cross(sides[0] - sides[1], along)
    facing /= np.maximum(np.linalg.norm(facing, axis=1, keepdims=True), 1e-12)
    steps = np.diff(root, axis=0)
    seen = ~np.isnan(steps + facing[:-1]).any(axis=1)
    steps, facing = steps[seen], facing[:-1][seen]
    way = float(np.linalg.norm(steps, axis=1).sum())
    ahead = abs(float((steps * facing).sum()))
    return way > 0 and ahead > _SOME_WAY * size and ahead > _FACING * way


def _is_planted(bodies: Floats, size: float) -> bool:
    """Whether a foot stays where it is while the hips move."""
    wanders = []
    for joints in (("root",), _LOW):
        tracks = [bodies[:, GENERIC_JOINTS.index(joint)] for joint in joints]
        tracks = [track[~np.isnan(track).any(axis=1)] for track in tracks]
        widths = [float(_wandering(track).max()) for track in tracks if len(track)]
        wanders.append(min(widths, default=np.nan))
    root, foot = wanders
    return root > _STIRS * size and foot < _HALF * root


def _wandering(places: Floats) -> Floats:
    """Width of the middle four fifths of each column."""
    low, high = np.percentile(places, (10, 90), axis=0)
    width: Floats = high - low
    return width


def _mean_of(generic: Floats, joints: tuple[str, ...]) -> Floats:
    """Mean over those of the joints that are ever seen."""
    places = [GENERIC_JOINTS.index(joint) for joint in joints]
    seen = [place for place in places if not np.isnan(generic[:, place]).all()]
    if not seen:
        return np.full((len(generic), 3), np.nan)
    result: Floats = generic[:, seen].mean(axis=1)
    return result
