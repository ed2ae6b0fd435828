"""How does a recording become words?

Joint positions are brought to 120 Hz, relations measured and switched there, and every
fourth frame kept: words at 30 Hz, as the thresholds of the published work expect.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motionary.errors import InvalidInput
from motionary.features.body import Body
from motionary.features.catalogue import FULL_BODY
from motionary.features.feature_set import FeatureSet, holds
from motionary.features.hysteresis import hysteresis
from motionary.features.sequence import FeatureSequence
from motionary.features.travel import needs_travel
from motionary.features.vectors import Floats
from motionary.motion import GENERIC_JOINTS, JointMapping, Motion, resample
from motionary.packing import pack
from motionary.recording import Recording
from motionary.skeletons import find_mapping, known_mappings, named_mapping

Bools = NDArray[np.bool_]

MEASURE_HZ = 120.0
_STEP = 4

# Below, a frame tells nothing of speed, and a wrong rate would fill the memory.
_LEAST_HZ = 1.0


def compute_features(
    motion: Motion | ArrayLike,
    *,
    rate_hz: float | None = None,
    skeleton: str | Sequence[str] | None = None,
    feature_set: FeatureSet = FULL_BODY,
) -> FeatureSequence:
    """Words of a motion, or of an array of joint positions.

    Parameters
    ----------
    motion : Motion, or array, shape (frames, joints, 3), metres, y up, NaN = not seen
    rate_hz : frames per second; for arrays
    skeleton : for arrays: name of a known skeleton with a usual order of joints ("smpl"),
        or the joints' names in the order of the array; left out, the array holds the 24
        generic joints in their order
    feature_set : relations to compute

    Returns
    -------
    FeatureSequence at 30 Hz

    Raises
    ------
    InvalidInput
        If an array comes without rate, in another shape, or its joints are unknown; if a
        motion's joints are unknown or its rate is below 1 Hz.
    """
    if not isinstance(motion, Motion):
        motion = _motion_from_array(motion, rate_hz, skeleton)
    elif rate_hz is not None or skeleton is not None:
        raise InvalidInput(
            "rate_hz= and skeleton= go with arrays; a Motion has its own: read(..., rate_hz=, "
            "skeleton=) or dataclasses.replace changes them"
        )
    if motion.rate_hz < _LEAST_HZ:
        raise InvalidInput(
            f"{motion.source or 'motion'}: features need at least {_LEAST_HZ:g} frames per "
            f"second, got {motion.rate_hz:g}; check the rate of the recording"
        )
    positions = resample(motion.generic_positions(), rate_hz=motion.rate_hz, to_hz=MEASURE_HZ)
    features, known = feature_matrix(positions, feature_set)
    if motion.in_place:
        lost = [needs_travel(feature) for feature in feature_set.features]
        features[:, lost] = known[:, lost] = False
    return FeatureSequence(
        packed=pack(features[::_STEP]),
        known=pack(known[::_STEP]),
        feature_set=feature_set,
        recording=motion.recording,
    )


def describe_reference_lengths(motion: Motion) -> tuple[str, ...]:
    """Which lengths of a partial body are measured by others, a sentence each.

    Parameters
    ----------
    motion : whose joints are mapped
    """
    body = Body.from_positions(motion.generic_positions(), rate_hz=motion.rate_hz)
    sides = {
        "right": body.reference_length("humerus"),
        "left": body.reference_length("left humerus"),
    }
    if sides["right"] and sides["right"] == sides["left"]:
        sides = {"": sides["right"]}
    return tuple(
        f"no {f'{side} ' if side else ''}upper arm: {substitute} stands in for it as the measure "
        "of distances and speeds"
        for side, substitute in sides.items()
        if substitute
    )


def feature_matrix(
    positions: Floats, feature_set: FeatureSet, *, before: Bools | None = None
) -> tuple[Bools, Bools]:
    """Relations at 120 Hz and which of them are known.

    Parameters
    ----------
    positions : array, shape (frames, 24, 3), generic joints, metres, y up, at 120 Hz
    feature_set : relations to compute
    before : array, shape (features,): relations that hold before the first frame, for a
        piece of a longer recording; none if left out

    Returns
    -------
    features, known : arrays, shape (frames, features), bool; unknown features are False
    """
    n_frames, n_features = positions.shape[0], len(feature_set)
    if positions.shape[1:] != (len(GENERIC_JOINTS), 3) or n_frames == 0:
        raise InvalidInput(
            f"relations need positions of shape (frames, {len(GENERIC_JOINTS)} generic joints, "
            f"3), at least one frame, got {positions.shape}"
        )
    if before is None:
        before = np.zeros(n_features, dtype=np.bool_)
    if np.shape(before) != (n_features,):
        raise InvalidInput(f"before needs one state a relation, {n_features}, got {len(before)}")
    body = Body.from_positions(positions, rate_hz=MEASURE_HZ)
    features = np.empty((n_features, n_frames), dtype=np.bool_)
    known = np.empty_like(features)
    for i, feature in enumerate(feature_set.features):
        value = feature.measure(body)
        known[i] = ~np.isnan(value)
        strong = holds(value, feature.test, feature.strong)
        weak = holds(value, feature.test, feature.weak)
        features[i] = hysteresis(strong, weak, known[i], before=bool(before[i]))
    return features.T, known.T


def _motion_from_array(
    positions: ArrayLike, rate_hz: float | None, skeleton: str | Sequence[str] | None
) -> Motion:
    array = np.asarray(positions, dtype=np.float64)
    if rate_hz is None:
        raise InvalidInput("an array of positions needs rate_hz=, its frames per second")
    if array.ndim != 3 or array.shape[2] != 3:
        raise InvalidInput(f"positions need shape (frames, joints, 3), got {array.shape}")
    names, mapping = _joints_of_array(skeleton)
    if array.shape[1] != len(names):
        expected = "skeleton= names" if skeleton is not None else "without skeleton= there must be"
        raise InvalidInput(
            f"{expected} {len(names)} joints, the array has {array.shape[1]}; pass "
            "skeleton= with the names of its joints, in the order of the array"
        )
    return Motion(names, array, Recording(rate_hz=rate_hz), mapping)


def _joints_of_array(
    skeleton: str | Sequence[str] | None,
) -> tuple[tuple[str, ...], JointMapping]:
    if skeleton is None:
        return GENERIC_JOINTS, named_mapping("generic")
    if isinstance(skeleton, str):
        mapping = named_mapping(skeleton)
        if not mapping.order:
            raise InvalidInput(
                f"joints of skeleton {skeleton!r} have no usual order; pass skeleton= with "
                "their names, in the order of the array"
            )
        return mapping.order, mapping
    names = tuple(skeleton)
    found = find_mapping(names)
    if found is None:
        raise InvalidInput(
            f"no known skeleton has the joints {', '.join(names[:6])}, ...; "
            f"known are {', '.join(known_mappings())}"
        )
    return names, found
