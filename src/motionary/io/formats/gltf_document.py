"""The container of glTF 2.0: documents, buffers, accessors, animations.

After the specification of Khronos (glTF 2.0, sections 3.6, 4.4). The document is JSON, alone or
in the first chunk of a GLB file; buffers are its second chunk, data URIs, or files beside it.
What a file states is checked against the bytes that are there before anything is made of it.

Animations after section 3.11 and appendix C: steps, lines (of turns: arcs) and cubic splines;
before the first and after the last key their values hold.
"""

import binascii
import json
import os
import struct
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, NoReturn
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from motionary.errors import NotAMotion, UnreadableFile, describe_cause
from motionary.files import most_unpacked, read_bytes
from motionary.io.formats.times import rate_of_frame_time
from motionary.rotations import Floats, slerp

Object = Mapping[str, Any]

_MAGIC, _JSON, _BINARY = b"glTF", 0x4E4F534A, 0x004E4942
_TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
# Normalised integers stand for -1 to 1, or 0 to 1.
_LARGEST = {5120: 127.0, 5121: 255.0, 5122: 32767.0, 5123: 65535.0}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


class Document:
    """A glTF file: its objects by kind and number, and the numbers of its accessors.

    Attributes
    ----------
    name : of the file, for errors
    size : bytes of the file and of the buffers beside it that were read
    """

    def __init__(self, path: Path) -> None:
        content = read_bytes(path)
        self.path, self.name, self.size = path, path.name, len(content)
        self._binary: bytes | None = None
        self._buffers: dict[int, memoryview] = {}
        self._items: dict[str, list[Object]] = {}
        self._made = 0
        text = self._unpack(content) if content[:4] == _MAGIC else content
        try:
            root = json.loads(text.decode("utf-8-sig"))
        except (ValueError, RecursionError) as error:
            reason = f"is no glTF, whose text is JSON: {describe_cause(error)}"
            raise UnreadableFile(reason, file=self.name) from None
        if not isinstance(root, dict) or not isinstance(root.get("asset"), dict):
            raise NotAMotion("holds no glTF; expected an object with an asset", file=self.name)
        version = str(root["asset"].get("version", ""))
        if not version.startswith("2."):
            self.fail(f"is glTF {version[:20] or 'of no version'}, expected 2.0; export it again")
        self.root: Object = root

    def allows(self, n_bytes: int) -> bool:
        """Whether a file of this size may grow to so many bytes: arrays may share theirs."""
        return n_bytes <= most_unpacked(self.size)

    def fail(self, problem: str) -> NoReturn:
        """Raise `UnreadableFile` of this file."""
        raise UnreadableFile(problem, file=self.name)

    def _unpack(self, content: bytes) -> bytes:
        """JSON of a GLB file; its binary chunk is kept."""
        version, length = struct.unpack_from("<II", content.ljust(12, b"\0"), 4)
        if version != 2:
            self.fail(f"is binary glTF {version}, expected 2; export it again")
        if length > len(content):
            self.fail(f"should have {length} bytes and has {len(content)}; is it whole?")
        chunks: dict[int, bytes] = {}
        at = 12
        while at + 8 <= length:
            size, kind = struct.unpack_from("<II", content, at)
            if at + 8 + size > length:
                self.fail("a chunk ends behind the file; is it whole?")
            chunks.setdefault(kind, content[at + 8 : at + 8 + size])
            at += 8 + size
        self._binary = chunks.get(_BINARY)
        if _JSON not in chunks:
            self.fail("has no chunk of JSON, with which binary glTF begins; export it again")
        return chunks[_JSON]

    # ---- objects

    def items(self, key: str, within: Object | None = None) -> list[Object]:
        """A list of objects; empty where there is none."""
        if within is None and key in self._items:
            return self._items[key]
        value = (self.root if within is None else within).get(key, [])
        if not isinstance(value, list) or not all(isinstance(one, dict) for one in value):
            self.fail(f"{key} should be a list of objects")
        if within is None:
            self._items[key] = value
        return value

    def item(self, key: str, number: Any) -> Object:
        """One object of a list, by the number that another object gives."""
        items = self.items(key)
        return items[self.index(number, len(items), key)]

    def index(self, number: Any, n: int, what: str) -> int:
        """A number that names one of `n` things."""
        if not isinstance(number, int) or isinstance(number, bool) or not 0 <= number < n:
            self.fail(f"has {n} of {what} and names number {str(number)[:20]}")
        return number

    def part(self, within: Object, *keys: str) -> Object:
        """An object inside of others; empty where there is none."""
        for key in keys:
            value = within.get(key)
            if not isinstance(value, dict):
                return {}
            within = value
        return within

    def vector(self, within: Object, key: str, default: tuple[float, ...]) -> Floats:
        """Numbers of an object, as many as its default has."""
        value = within.get(key, default)
        try:
            result = np.array(value, dtype=np.float64)
        except (TypeError, ValueError, OverflowError):
            result = np.empty(0)
        if result.shape != (len(default),) or not np.isfinite(result).all():
            self.fail(f"{key} should be {len(default)} numbers, got {str(value)[:40]}")
        return result

    # ---- numbers

    def read(self, accessor: Any, *, width: int, n: int | None = None) -> Floats:
        """Elements of an accessor, shape (elements, width).

        Parameters
        ----------
        accessor : its number
        width : how many numbers an element needs
        n : how many elements are needed; None for those that are there
        """
        form = self.item("accessors", accessor)
        count, kind = self._whole(form, "count"), form.get("type")
        code = self._whole(form, "componentType")
        if _WIDTHS.get(str(kind)) != width or code not in _TYPES:
            self.fail(f"an accessor is {str(kind)[:20]} of {str(code)[:20]}, expected {width} wide")
        if n is not None and count != n:
            self.fail(f"an accessor has {count} elements where {n} are needed")
        self._made += 8 * count * width
        if not self.allows(self._made):
            self.fail("says that it has more numbers than its bytes can hold")
        dtype = np.dtype(_TYPES[code])
        if "bufferView" in form:
            result = self._elements(form, dtype, count, width).astype(np.float64)
        elif n is None:
            # Nothing in the file bounds what would be made of zeros.
            self.fail("an accessor has no numbers")
        else:
            result = np.zeros((count, width))
        if sparse := self.part(form, "sparse"):
            self._replace(result, sparse, dtype)
        if form.get("normalized") is True and code in _LARGEST:
            result = np.maximum(result / _LARGEST[code], -1.0)
        return result

    def _replace(self, result: Floats, sparse: Object, dtype: "np.dtype[Any]") -> None:
        """Put the elements that a sparse accessor lists in their places."""
        n = self._whole(sparse, "count")
        indices = self.part(sparse, "indices")
        code = self._whole(indices, "componentType")
        if code not in (5121, 5123, 5125):
            self.fail("a sparse accessor has no whole numbers for indices")
        at = self._elements(indices, np.dtype(_TYPES[code]), n, 1)[:, 0]
        if (at >= len(result)).any():
            self.fail("a sparse accessor names elements that are not there")
        values = self._elements(self.part(sparse, "values"), dtype, n, result.shape[1])
        result[at.astype(np.intp)] = values

    def _elements(
        self, place: Object, dtype: "np.dtype[Any]", count: int, width: int
    ) -> NDArray[Any]:
        """A view of elements in a buffer, (count, width)."""
        view = self.item("bufferViews", place.get("bufferView"))
        if "EXT_meshopt_compression" in self.part(view, "extensions"):
            self.fail("its animation is packed (EXT_meshopt_compression); export it unpacked")
        data = self._buffer(view.get("buffer"))
        start, length = self._whole(view, "byteOffset", 0), self._whole(view, "byteLength")
        if start + length > len(data):
            self.fail("a view ends behind its buffer; is the file whole?")
        element = dtype.itemsize * width
        stride = self._whole(view, "byteStride", 0) or element
        offset = self._whole(place, "byteOffset", 0)
        if stride < element or (count and offset + (count - 1) * stride + element > length):
            self.fail("an accessor ends behind its view; is the file whole?")
        return np.ndarray((count, width), dtype, data, start + offset, (stride, dtype.itemsize))

    def _whole(self, within: Object, key: str, default: int | None = None) -> int:
        value = within.get(key, default)
        if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value < 1 << 48:
            self.fail(f"{key} should be a whole number, got {str(value)[:20]}")
        return value

    def _buffer(self, number: Any) -> memoryview:
        form = self.item("buffers", number)
        if number not in self._buffers:
            uri = form.get("uri")
            if uri is not None:
                content = self._load(str(uri))
            elif number == 0 and self._binary is not None:
                content = self._binary
            else:
                self.fail(f"buffer {number} has no bytes")
            self._buffers[number] = memoryview(content)
        return self._buffers[number]

    def _load(self, uri: str) -> bytes:
        """Bytes of a data URI, or of a file in the folder of the document."""
        if uri[:5].lower() == "data:":
            head, _, content = uri.partition(",")
            if not head.lower().endswith(";base64"):
                self.fail("a buffer is no base64")
            try:
                text = unquote("".join(content.split()))
                return binascii.a2b_base64(text.encode("ascii"), strict_mode=True)
            except (binascii.Error, UnicodeEncodeError):
                self.fail("a buffer is damaged base64")
        name = unquote(uri)
        home = os.path.realpath(self.path.absolute().parent)
        # Whatever the name and links on the way: no other folder's files are read.
        is_plain = not {"\0", ":"} & set(name)
        place = os.path.realpath(Path(home) / name) if is_plain else ""
        if not place or not Path(place).is_relative_to(home):
            self.fail(f"names a buffer outside its folder, {name[:60]!r}; put the file beside it")
        try:
            beside = read_bytes(place)
        except UnreadableFile as error:
            self.fail(f"its buffer {name[:60]!r} {error.problem}; put the file beside it")
        self.size += len(beside)
        return beside


# -- animations ---------------------------------------------------------------------------


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
    """Channels of an animation that move joints, which are given by their nodes."""
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
