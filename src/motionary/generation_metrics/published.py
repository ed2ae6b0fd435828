"""Which 32 numbers does the code that is widespread in dance generation take of a motion?

The "manual" or "geometric" features behind FID_g and Dist_g, published with AIST++ (Li,
Yang, Ross and Kanazawa, 2021) and copied since: shares of the frames in which relations
after Müller and Röder (2006) hold. Computed here as that code does, with its faults:

- a velocity is the difference to the frame before times 120, whatever the rate, so that
  the same motion at half the rate moves twice as fast;
- "hand moves up" (columns 5, 6) never looks at a hand: both are the chest's velocity away
  from the belly;
- "hands approach" (10) and "hand away from root" (11, 12) measure other joints along other
  lines than their names say, the first of them hands that move apart;
- mirroring by names turns planes round, so the columns of a pair ask for opposite
  directions: 1 counts a right hand that moves *backward*, 2 a left hand that moves forward,
  15 a right foot *in front of* the left leg, 16 a left foot behind the right leg;
- lengths are those of the body model at rest, whoever moves;
- one threshold and no average over frames, so that noise switches relations.

Conventions: metres, y up, joints (frames, 24, 3) in the order of SMPL bodies.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motionary.errors import InvalidInput
from motionary.rotations import unit_vectors

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

#: The 24 joints in the order of SMPL bodies, by the names that the relations use.
JOINTS = (
    "root", "lhip", "rhip", "belly", "lknee", "rknee", "spine", "lankle", "rankle", "chest",
    "ltoes", "rtoes", "neck", "lclavicle", "rclavicle", "head", "lshoulder", "rshoulder",
    "lelbow", "relbow", "lwrist", "rwrist", "lfingers", "rfingers",
)  # fmt: skip

#: What each column is meant to say; the module tells which of them say something else.
PUBLISHED_COLUMNS = (
    "right hand moves forward", "left hand moves forward",
    "right hand above neck", "left hand above neck",
    "right hand moves up", "left hand moves up",
    "right elbow bent", "left elbow bent",
    "hands far apart", "hands approach each other",
    "right hand moves away from the body", "left hand moves away from the body",
    "right hand fast", "left hand fast",
    "right foot behind left leg", "left foot behind right leg",
    "right foot raised", "left foot raised",
    "feet far apart sideways",
    "right knee bent", "left knee bent",
    "right foot fast", "left foot fast",
    "right upper arm away from the body", "left upper arm away from the body",
    "right hip bent", "left hip bent",
    "hips behind the feet", "spine horizontal",
    "right hand low", "left hand low",
    "body moves fast",
)  # fmt: skip

# Of the body model at rest, metres: upper arm, shoulder width, hip width.
_REST = {
    "lshoulder": (0.199113488, 0.236807942, -0.0180702247),
    "lelbow": (0.454445392, 0.221158922, -0.0410167128),
    "rshoulder": (-0.191692337, 0.236928746, -0.0123055102),
    "lhip": (0.0564076714, -0.323069185, 0.0109197125),
    "rhip": (-0.0624834076, -0.331302464, 0.0150412619),
}
# The rate that velocities pretend.
_HZ = 120.0


def published_features(positions: ArrayLike) -> Floats:
    """The 32 numbers of one motion, by the widespread code.

    Parameters
    ----------
    positions : array, shape (frames, 24, 3), metres, y up
        Joints in the order of SMPL bodies. There is no rate to give: the code has none.

    Returns
    -------
    array, shape (32,)
        Shares of the frames from the second on, in the order of `PUBLISHED_COLUMNS`.

    Raises
    ------
    InvalidInput
        If the array has another shape, fewer than two frames, or joints that are not seen.
    """
    array = np.asarray(positions, dtype=np.float64)
    if array.ndim != 3 or array.shape[1:] != (len(JOINTS), 3) or len(array) < 2:
        raise InvalidInput(
            "published features need positions of shape (frames, 24 joints of SMPL, 3), at "
            f"least two frames, got {array.shape}; mode='corrected' takes other skeletons"
        )
    if not np.isfinite(array).all():
        raise InvalidInput(
            "published features need every joint in every frame, got positions that are not "
            "seen (NaN); mode='corrected' takes them"
        )
    return np.array([held.mean() for held in _features(_Body(array))])


class _Body:
    """Joints from the second frame on, and differences to the frame before."""

    def __init__(self, positions: Floats) -> None:
        self._positions = positions
        self.lowest: Floats = positions[1:, :, 1].min(axis=1)

    def at(self, joint: str) -> Floats:
        return self._positions[1:, JOINTS.index(joint)]

    def velocity(self, joint: str, relative_to: str | None = None) -> Floats:
        path = self._positions[:, JOINTS.index(joint)]
        if relative_to is not None:
            path = path - self._positions[:, JOINTS.index(relative_to)]
        velocity: Floats = np.diff(path, axis=0) * _HZ
        return velocity

    def line(self, a: str, b: str) -> Floats:
        """Unit vectors from a to b."""
        return unit_vectors(self.at(b) - self.at(a))

    def normal(self, corner: str, a: str, b: str) -> Floats:
        """Unit vectors along (a - corner) x (b - corner)."""
        return unit_vectors(np.cross(self.at(a) - self.at(corner), self.at(b) - self.at(corner)))

    def angle(self, a: str, b: str, c: str, d: str) -> Floats:
        """Degrees between the segments from a to b and from c to d."""
        return _degrees(_dot(self.line(a, b), self.line(c, d)))

    def beyond(self, direction: Floats, joint: str, corner: str) -> Floats:
        """How far a joint lies beyond another one in a direction."""
        return _dot(direction, self.at(joint) - self.at(corner))


def _dot(a: Floats, b: Floats) -> Floats:
    product: Floats = np.einsum("fi,fi->f", a, b)
    return product


def _degrees(cosine: Floats) -> Floats:
    degrees: Floats = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    return degrees


def _within(value: Floats, low: float, high: float) -> Bools:
    return (low < value) & (value < high)


def _length(a: str, b: str) -> float:
    return float(np.linalg.norm(np.subtract(_REST[a], _REST[b])))


def _both(feature: Callable[[str, str], Bools]) -> list[Bools]:
    """A relation of the right side, called with ("r", "l"), and of the left."""
    return [feature("r", "l"), feature("l", "r")]


def _features(body: _Body) -> list[Bools]:
    return [*_of_hands(body), *_of_feet(body), *_of_the_whole(body)]


def _of_hands(body: _Body) -> list[Bools]:
    hl, sw = _length("lshoulder", "lelbow"), _length("lshoulder", "rshoulder")
    up = body.line("chest", "neck")
    spine = _dot(body.velocity("chest", "belly"), body.line("belly", "chest"))
    aside = body.line("lshoulder", "rshoulder")
    apart = _dot(body.velocity("rwrist", "lwrist"), body.line("lwrist", "rwrist"))
    return [
        *_both(lambda s, o: _dot(
            body.velocity(f"{s}wrist", "neck"), body.normal("neck", f"{o}hip", f"{s}hip")
        ) > 1.8 * hl),
        *_both(lambda s, _: body.beyond(up, f"{s}wrist", "neck") > 0.2 * hl),
        *_both(lambda *_: spine > 1.8 * hl),
        *_both(lambda s, _: _within(
            body.angle(f"{s}elbow", f"{s}shoulder", f"{s}elbow", f"{s}wrist"), 0, 110
        )),
        body.beyond(aside, "rwrist", "lwrist") > 2.5 * sw,
        apart > 1.4 * hl,
        *_both(lambda s, o: _dot(
            body.velocity(f"{o}wrist", f"{s}wrist"), body.line(f"{s}wrist", "root")
        ) > 1.4 * hl),
        *_both(lambda s, _: np.linalg.norm(body.velocity(f"{s}wrist"), axis=1) > 2.5 * hl),
    ]  # fmt: skip


def _of_feet(body: _Body) -> list[Bools]:
    hl, hw = _length("lshoulder", "lelbow"), _length("lhip", "rhip")
    aside = body.line("lhip", "rhip")
    return [
        *_both(lambda s, o: body.beyond(
            body.normal("root", f"{o}toes", f"{o}hip"), f"{s}ankle", "root"
        ) > 0.38 * hl),
        *_both(lambda s, _: body.at(f"{s}ankle")[:, 1] - body.lowest > 1.2 * hl),
        body.beyond(aside, "rankle", "lankle") > 2.1 * hw,
        *_both(lambda s, _: _within(
            body.angle(f"{s}knee", f"{s}hip", f"{s}knee", f"{s}ankle"), 0, 110
        )),
        *_both(lambda s, _: np.linalg.norm(body.velocity(f"{s}ankle"), axis=1) > 2.5 * hl),
    ]  # fmt: skip


def _of_the_whole(body: _Body) -> list[Bools]:
    hl = _length("lshoulder", "lelbow")
    behind = body.normal("rankle", "lankle", "neck")
    upright = body.line("neck", "root")
    return [
        *_both(lambda s, _: _within(
            body.angle("neck", "root", f"{s}shoulder", f"{s}elbow"), 25, 180
        )),
        *_both(lambda s, _: _within(body.angle("neck", "root", f"{s}hip", f"{s}knee"), 50, 180)),
        body.beyond(behind, "root", "rankle") > 0.5 * hl,
        _within(_degrees(upright[:, 1]), 70, 110),
        *_both(lambda s, _: body.lowest - body.at(f"{s}wrist")[:, 1] > -1.2 * hl),
        np.linalg.norm(body.velocity("root"), axis=1) > 2.3 * hl,
    ]  # fmt: skip
