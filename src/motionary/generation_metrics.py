"""Measures of generated motion on features of its poses: FID_g and diversity.

`published` gives the 32 numbers of the code that is widespread in dance generation, faults
included; `corrected` the 40 features of this package, measured at 120 Hz whatever the rate of
the motion, with the lengths of the body that moves, averaged velocities and two thresholds.

The "manual" or "geometric" features behind FID_g and Dist_g, published with AIST++ (Li,
Yang, Ross and Kanazawa, 2021) and copied since: fractions of the frames in which features
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
- one threshold and no average over frames, so that noise switches features.

Conventions: metres, y up, joints (frames, 24, 3) in the order of SMPL bodies.

FID_g and Dist_g of dance generation (Li, Yang, Ross and Kanazawa, 2021), as the code that
is widespread since computes them: the features of both sets are first normalised by mean
and standard deviation (of the population) of the *real* set. FID is the Fréchet distance
of two normal distributions, covariances with n - 1; diversity the mean Euclidean distance
of all pairs of a set. Neither has a unit, and numbers compare only between sets that were
normalised by the same real one.
"""

from collections.abc import Callable, Sequence
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motionary.errors import InvalidInput
from motionary.features import compute_features
from motionary.motion import GENERIC_JOINTS, Motion
from motionary.rotations import unit_vectors

__all__ = [
    "PUBLISHED_COLUMNS", "Mode", "diversity", "frechet_distance", "motion_features",
    "published_features",
]  # fmt: skip

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Mode = Literal["published", "corrected"]

#: The 24 joints in the order of SMPL bodies, by the names that the features use.
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
# What the widespread code adds to each deviation.
_FLOOR = 1e-10
_SMPL = "smpl"


def motion_features(
    motion: Motion | ArrayLike,
    *,
    mode: Mode = "corrected",
    rate_hz: float | None = None,
    skeleton: str | Sequence[str] = _SMPL,
) -> Floats:
    """Fractions of the frames of one motion in which each feature holds.

    Parameters
    ----------
    motion : Motion, or array, shape (frames, joints, 3), metres, y up
    mode : "corrected", or "published" for numbers that are equal to those in print
    rate_hz : frames per second, for arrays; the published mode pays no heed to any rate
    skeleton : for arrays, as `compute_features` takes it

    Returns
    -------
    array, shape (40,) corrected or (32,) published
        Corrected, a feature that the skeleton never shows is NaN; published, all joints
        must be seen. Of a Motion whose skeleton has no second spine joint, the published
        mode puts it halfway between its neighbours, where it is never the lowest joint.

    Raises
    ------
    InvalidInput
        If the mode is unknown, or joints, rate or shape do not do for it.
    """
    if mode not in ("published", "corrected"):
        raise InvalidInput(f"mode must be 'published' or 'corrected', got {mode!r}")
    if mode == "published":
        return published_features(_smpl_positions(motion, skeleton))
    if isinstance(motion, Motion):
        return compute_features(motion).fractions()
    return compute_features(motion, rate_hz=rate_hz, skeleton=skeleton).fractions()


def published_features(positions: ArrayLike) -> Floats:
    """The 32 numbers of one motion, by the widespread code.

    Parameters
    ----------
    positions : array, shape (frames, 24, 3), metres, y up
        Joints in the order of SMPL bodies. There is no rate to give: the code has none.

    Returns
    -------
    array, shape (32,)
        Fractions of the frames from the second on, in the order of `PUBLISHED_COLUMNS`.

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
    body = _Body(array)
    held = (*_of_hands(body), *_of_feet(body), *_of_the_whole(body))
    return np.array([one.mean() for one in held])


def frechet_distance(generated: ArrayLike, real: ArrayLike, *, mode: Mode = "corrected") -> float:
    """FID_g: Fréchet distance between two sets of motions, normalised by the real one.

    With fewer motions than features the covariances are singular: the distance is defined
    but depends on the number of motions, so compare sets of one size only.

    Parameters
    ----------
    generated, real : arrays, shape (motions, features), from `motion_features`
        At least two motions each.
    mode : "published" divides by deviation + 1e-10, so that a feature that no real motion
        varies decides everything as soon as a generated one does; "corrected" leaves such
        a feature as it is, a fraction, and leaves out features that are unknown (NaN) in
        any motion

    Raises
    ------
    InvalidInput
        If the sets do not fit together, are too small, or have no known feature in common.
    """
    first, second = _normalised(generated, real, mode)
    difference = first.mean(axis=0) - second.mean(axis=0)
    one, two = np.cov(first, rowvar=False), np.cov(second, rowvar=False)
    one, two = np.atleast_2d(one), np.atleast_2d(two)
    spread = np.trace(one) + np.trace(two) - 2 * _trace_of_root(one, two)
    # Rounding may leave a hair below zero for equal sets.
    return float(max(difference @ difference + spread, 0.0))


def diversity(
    generated: ArrayLike, real: ArrayLike | None = None, *, mode: Mode = "corrected"
) -> float:
    """Dist_g: mean distance of all pairs of motions of a set.

    Parameters
    ----------
    generated : array, shape (motions, features), at least two motions
    real : array, shape (motions, features)
        What normalises; the set itself if left out.
    mode : as in `frechet_distance`

    Raises
    ------
    InvalidInput
        As in `frechet_distance`.
    """
    features, _ = _normalised(generated, generated if real is None else real, mode)
    n = len(features)
    total = sum(
        float(np.linalg.norm(features[i + 1 :] - features[i], axis=1).sum()) for i in range(n - 1)
    )
    return total / (n * (n - 1) / 2)


def _smpl_positions(motion: Motion | ArrayLike, skeleton: str | Sequence[str]) -> ArrayLike:
    if not isinstance(motion, Motion):
        if skeleton != _SMPL:
            raise InvalidInput(
                "published features take arrays in the order of SMPL's 24 joints only, got "
                f"skeleton={skeleton!r}; pass a Motion, or mode='corrected'"
            )
        return motion
    generic = motion.generic_positions()
    belly, chest = (generic[:, GENERIC_JOINTS.index(joint)] for joint in ("belly", "chest"))
    result = np.empty((motion.n_frames, len(JOINTS), 3))
    for i, joint in enumerate(JOINTS):
        if joint in GENERIC_JOINTS:
            result[:, i] = generic[:, GENERIC_JOINTS.index(joint)]
        elif "spine2" in motion.names:
            result[:, i] = motion.positions[:, motion.names.index("spine2")]
        else:
            result[:, i] = (belly + chest) / 2
    return result


def _normalised(generated: ArrayLike, real: ArrayLike, mode: Mode) -> tuple[Floats, Floats]:
    ours, theirs = (np.asarray(one, dtype=np.float64) for one in (generated, real))
    for name, one in (("generated", ours), ("real", theirs)):
        if one.ndim != 2 or len(one) < 2 or one.shape[1:] != theirs.shape[1:]:
            raise InvalidInput(
                "sets need shape (motions, features), the same features and at least two "
                f"motions, got {name} of shape {one.shape} beside {theirs.shape}"
            )
    known = np.isfinite(ours).all(axis=0) & np.isfinite(theirs).all(axis=0)
    if mode == "published" and not known.all():
        raise InvalidInput("published features are never NaN or infinite; use mode='corrected'")
    if mode not in ("published", "corrected"):
        raise InvalidInput(f"mode must be 'published' or 'corrected', got {mode!r}")
    if not known.any():
        raise InvalidInput("no feature is known in every motion; leave motions out, or look at NaN")
    ours, theirs = ours[:, known], theirs[:, known]
    mean, scale = theirs.mean(axis=0), theirs.std(axis=0)
    scale = scale + _FLOOR if mode == "published" else np.where(scale > _FLOOR, scale, 1.0)
    return (ours - mean) / scale, (theirs - mean) / scale


def _trace_of_root(one: Floats, two: Floats) -> float:
    """Trace of the square root of a product of covariances, also of singular ones."""
    values, vectors = np.linalg.eigh(one)
    root = (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
    inner = np.linalg.eigvalsh(root @ two @ root)
    return float(np.sqrt(np.maximum(inner, 0.0)).sum())


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
        """Distance of a joint beyond another one in a direction."""
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
    """A feature of the right side, called with ("r", "l"), and of the left."""
    return [feature("r", "l"), feature("l", "r")]


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
