"""Animations of glTF 2.0: keys of what nodes do, the rate they tell, and values between keys.

After the specification of Khronos, sections 3.11 and appendix C: steps, lines (of turns: arcs)
and cubic splines; before the first and after the last key their values hold.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.io.formats.gltf_document import Document, Floats, Object
from motionary.io.formats.times import rate_of_frame_time
from motionary.rotations import slerp

# Numbers that a channel of each kind holds for a key.
_PATHS = {"translation": 3, "rotation": 4, "scale": 3}
_INTERPOLATIONS = ("LINEAR", "STEP", "CUBICSPLINE")
_LATEST_S = 1e6

# Rates on whose frames the keys of reduced animations lie; what is sampled otherwise.
_USUAL_HZ = (30.0, 24.0, 25.0, 60.0, 50.0, 100.0, 120.0, 240.0)
_SLOWEST_HZ = 10.0
# Keys this near to a frame, in steps, are on it.
_EVEN = 0.02
_ON_FRAME = 1e-3


class Channel(NamedTuple):
    """What an animation does with a joint: keys of its translation, rotation or scale."""

    joint: int
    path: str
    times: Floats
    values: Floats
    interpolation: str


def find_targets(
    document: Document, animation: Object, n_nodes: int
) -> list[tuple[int, str, Object]]:
    """Node, path and channel of what an animation moves."""
    found = []
    for channel in document.items("channels", animation):
        target = document.part(channel, "target")
        path = str(target.get("path"))
        if "node" in target and path in _PATHS:
            node = document.index(target["node"], n_nodes, "nodes")
            found.append((node, path, channel))
    return found


def read_channels(
    document: Document, animation: Object, joints: Mapping[int, int]
) -> list[Channel]:
    """Channels of an animation that move joints, which are given by their nodes.

    Raises
    ------
    UnreadableFile
        If keys are none, or out of order.
    """
    samplers = document.items("samplers", animation)
    times: dict[int, Floats] = {}
    channels: dict[tuple[int, str], Channel] = {}
    for node, path, channel in find_targets(document, animation, len(document.items("nodes"))):
        if node not in joints:
            continue
        joint = joints[node]
        sampler = samplers[document.index(channel.get("sampler"), len(samplers), "samplers")]
        interpolation = str(sampler.get("interpolation", "LINEAR"))
        if interpolation not in _INTERPOLATIONS:
            document.fail(f"interpolates by {interpolation[:30]!r}, which glTF does not know")
        number = document.index(sampler.get("input"), 1 << 48, "accessors")
        if number not in times:
            times[number] = _read_times(document, number)
        n_keys = len(times[number]) * (3 if interpolation == "CUBICSPLINE" else 1)
        values = document.read(sampler.get("output"), width=_PATHS[path], n=n_keys)
        if not np.isfinite(values).all():
            document.fail(f"an animation of node {node} has numbers that are none")
        channels[joint, path] = Channel(joint, path, times[number], values, interpolation)
    return list(channels.values())


def _read_times(document: Document, accessor: int) -> Floats:
    times = document.read(accessor, width=1)[:, 0]
    if not len(times) or not (np.abs(times) < _LATEST_S).all():
        document.fail("an animation has no times of its keys")
    if (np.diff(times) < 0).any():
        document.fail("time runs backward in an animation; put its keys in order")
    return times


def find_rate(channels: Sequence[Channel], given_hz: float | None) -> tuple[float, tuple[str, ...]]:
    """Frames per second to sample at, and a note where keys do not tell it."""
    if given_hz is not None or not channels:
        return given_hz or _USUAL_HZ[0], ()
    keys = max((channel.times for channel in channels), key=len)
    span = float(keys[-1] - keys[0])
    if len(keys) > 2 and span > 0:
        step = span / (len(keys) - 1)
        rounding = float(np.spacing(np.float32(np.abs(keys).max())))
        is_even = (np.abs(np.diff(keys) - step) <= _EVEN * step + rounding).all()
        rate = rate_of_frame_time(step)
        if is_even and rate >= _SLOWEST_HZ:
            return rate, ()
    everywhere = np.unique(np.concatenate([channel.times for channel in channels]))
    for rate in _USUAL_HZ:
        steps = (everywhere - everywhere[0]) * rate
        if (np.abs(steps - np.round(steps)) < _EVEN).all():
            note = f"keys lie on frames of {rate:g} Hz, read at this rate; --rate (rate_hz=...) "
            return rate, (f"{note}gives another",)
    note = f"keys lie at uneven times, read at {_USUAL_HZ[0]:g} Hz; --rate (rate_hz=...) gives "
    return _USUAL_HZ[0], (f"{note}another rate",)


def sample_channel(channel: Channel, at_s: Floats, rate_hz: float) -> Floats:
    """Values of a channel at times, (frames, width); the first and last key hold outside."""
    times = channel.times
    # A key a rounding error beside a frame is on it.
    near = _ON_FRAME / rate_hz
    right = np.searchsorted(times, at_s + near, side="right")
    left = (right - 1).clip(0, len(times) - 1)
    right = right.clip(0, len(times) - 1)
    span = times[right] - times[left]
    into = np.zeros(len(at_s))
    np.divide(at_s - times[left], span, out=into, where=span > 0)
    into[np.abs(at_s - times[left]) <= near] = 0.0
    into = into.clip(0.0, 1.0)[:, None]
    if channel.interpolation == "CUBICSPLINE":
        return _sample_cubic(channel.values, left, right, into, span[:, None])
    before: Floats = channel.values[left]
    after: Floats = channel.values[right]
    if channel.interpolation == "STEP":
        return before
    if channel.path == "rotation":
        with np.errstate(all="ignore"):
            before = before / np.linalg.norm(before, axis=1, keepdims=True)
            after = after / np.linalg.norm(after, axis=1, keepdims=True)
        return slerp(before, after, into)
    return before + (after - before) * into


def _sample_cubic(
    values: Floats, left: NDArray[np.intp], right: NDArray[np.intp], s: Floats, span: Floats
) -> Floats:
    """Hermite splines through keys of in-tangent, value, out-tangent (appendix C of glTF)."""
    keys = values.reshape(-1, 3, values.shape[1])
    result: Floats = (
        (2 * s**3 - 3 * s**2 + 1) * keys[left, 1]
        + span * (s**3 - 2 * s**2 + s) * keys[left, 2]
        + (3 * s**2 - 2 * s**3) * keys[right, 1]
        + span * (s**3 - s**2) * keys[right, 0]
    )
    return result
