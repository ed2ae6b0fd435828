"""Depth out of RealSense's .bag and Azure Kinect's or Femto's .mkv, behind the extra `depth`.

Conventions: what is told of a recording has the names of `depth_images`; distortions are in the
order of OpenCV: k1, k2, p1, p2, k3, k4, k5, k6.
"""

import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput, UnreadableFile, describe_cause

__all__ = ["VIDEOS", "StoredImages", "telling"]

_CODES = {"16UC1": "u2", "mono16": "u2", "32FC1": "f4"}
# Azure Kinect's modes by the size of their images: size of the sensor that the calibration is for,
# binned, and which part of it is kept (Azure Kinect Sensor SDK, depth modes).
_MODES = {
    (640, 576): ((1024, 1024), (192, 180)), (320, 288): ((512, 512), (96, 90)),
    (1024, 1024): ((1024, 1024), (0, 0)), (512, 512): ((512, 512), (0, 0)),
}  # fmt: skip
_CALIBRATION = "calibration.json"


@dataclass(frozen=True)
class StoredImages:
    """Images that stay in their file until they are asked for: how many, and how to open them."""

    count: int
    open: Callable[[], Iterator[NDArray[Any]]]

    def __len__(self) -> int:
        return self.count

    def __iter__(self) -> Iterator[NDArray[Any]]:
        return self.open()


@contextmanager
def telling(path: Path, package: str) -> Iterator[None]:
    """Raise what another library raises of a file as `UnreadableFile`, or what it needs."""
    try:
        yield
    except (InvalidInput, UnreadableFile):
        raise
    except ImportError as error:
        raise InvalidInput(
            f"{path.suffix} needs {package}: pip install 'motionary[depth]', or export the depth "
            "as 16-bit PNG",
            file=path.name,
        ) from error
    except Exception as error:
        # The libraries raise whatever a damaged file leads them to.
        raise UnreadableFile(f"cannot be read: {describe_cause(error)}", file=path.name) from error


def _read_bag(path: Path) -> tuple[StoredImages, dict[str, Any]]:
    """Depth of a bag of RealSense's recorder or of ROS, and its camera."""
    with telling(path, "rosbags"):
        from rosbags.highlevel import AnyReader

        told: dict[str, Any] = {}
        with AnyReader([path]) as bag:
            topic = _find_topic(path, {one.topic: one.msgtype for one in bag.connections})
            times: list[float] = []
            first: Any = None
            for one, stamp, raw in bag.messages([c for c in bag.connections if c.topic == topic]):
                first = first or bag.deserialize(raw, one.msgtype)
                times.append(stamp / 1e9)
            if first is None:
                raise UnreadableFile("holds no images of depth", file=path.name)
            for one, _, raw in bag.messages(_find_companions(bag.connections, topic)):
                told |= _read_companion(bag.deserialize(raw, one.msgtype))
        if len(times) > 1:
            told["times_s"] = times
        if first.encoding not in _CODES:
            raise InvalidInput(
                f"depth needs one of {', '.join(_CODES)}, got {first.encoding}", file=path.name
            )
        if first.encoding == "32FC1":
            told["depth_scale"] = 1.0
    return StoredImages(len(times), lambda: _open_bag(path, topic)), told


def _find_topic(path: Path, topics: Mapping[str, str]) -> str:
    """The topic of depth, of the sensor itself before one aligned to colour."""
    found = sorted(
        (("aligned" in topic, topic) for topic, kind in topics.items()
         if kind == "sensor_msgs/msg/Image" and "depth" in topic.lower()),
    )  # fmt: skip
    if not found:
        raise UnreadableFile(
            f"holds no images of depth; it has {', '.join(sorted(topics)) or 'nothing'}",
            file=path.name,
        )
    return found[0][1]


def _find_companions(connections: Iterable[Any], topic: str) -> list[Any]:
    """Connections that tell of the camera whose images a topic has.

    RealSense's recorder writes /device_0/sensor_0/Depth_0/image/data, .../Depth_0/info/camera_info
    and /device_0/sensor_0/option/Depth_Units/value; ROS has camera_info beside the images.
    """
    parts = topic.split("/")
    of_stream = "/".join(parts[: -2 if parts[-2:] == ["image", "data"] else -1]) + "/"
    of_sensor = "/".join(parts[:3]) + "/"
    return [
        one for one in connections
        if (one.msgtype.endswith("/CameraInfo") and one.topic.startswith(of_stream))
        or (one.topic.endswith("Depth_Units/value") and one.topic.startswith(of_sensor))
    ]  # fmt: skip


def _read_companion(message: Any) -> dict[str, Any]:
    if hasattr(message, "data"):
        return {"depth_scale": float(message.data)}
    # ROS 2 has the same fields in small letters.
    matrix = np.ravel(message.K if hasattr(message, "K") else message.k)
    bent = np.ravel(message.D if hasattr(message, "D") else message.d)
    return {
        "focal": [matrix[0], matrix[4]], "centre": [matrix[2], matrix[5]],
        "width": message.width, "height": message.height, "distortion": bent.tolist(),
    }  # fmt: skip


def _open_bag(path: Path, topic: str) -> Iterator[NDArray[Any]]:
    with telling(path, "rosbags"):
        from rosbags.highlevel import AnyReader

        with AnyReader([path]) as bag:
            wanted = [one for one in bag.connections if one.topic == topic]
            for one, _, raw in bag.messages(wanted):
                image: Any = bag.deserialize(raw, one.msgtype)
                code = (">" if image.is_bigendian else "<") + _CODES[image.encoding]
                values = np.frombuffer(image.data, np.uint8).reshape(image.height, image.step)
                width = image.width * np.dtype(code).itemsize
                yield np.ascontiguousarray(values[:, :width]).view(code)


def _read_mkv(path: Path) -> tuple[StoredImages, dict[str, Any]]:
    """The depth track of a Matroska file, and its camera by the calibration that is attached."""
    with telling(path, "av"):
        import av

        with av.open(str(path)) as container:
            track = _find_track(path, container)
            told: dict[str, Any] = {}
            stream: Any
            for stream in container.streams:
                if stream.type == "attachment" and stream.name == _CALIBRATION:
                    told = read_calibration(stream.data, (track.width, track.height))
            step = float(track.time_base)
            packets = container.demux(track)
            times = [packet.pts * step for packet in packets if packet.pts is not None]
        if not times:
            raise UnreadableFile("holds no images of depth", file=path.name)
        if len(times) > 1:
            told["times_s"] = times
    return StoredImages(len(times), lambda: _open_mkv(path)), told


def _find_track(path: Path, container: Any) -> Any:
    """The track called DEPTH, or the first of 16 bits grey that is not called IR."""
    tracks = {
        str(one.metadata.get("title", "")).upper(): one
        for one in reversed(container.streams.video)
        if str(one.codec_context.pix_fmt).startswith("gray16")
    }
    tracks.pop("IR", None)
    if not tracks:
        kinds = ", ".join(str(one.codec_context.pix_fmt) for one in container.streams.video)
        raise UnreadableFile(
            f"holds no track of depth, 16 bits of grey; it has {kinds or 'no images'}",
            file=path.name,
        )
    return tracks.get("DEPTH", list(tracks.values())[-1])


def _open_mkv(path: Path) -> Iterator[NDArray[Any]]:
    with telling(path, "av"):
        import av

        with av.open(str(path)) as container:
            for frame in container.decode(_find_track(path, container)):
                yield frame.to_ndarray()


def read_calibration(content: bytes, size: tuple[int, int]) -> dict[str, Any]:
    """What an Azure Kinect's calibration.json says of the depth camera, for images of a size."""
    try:
        cameras = json.loads(content.rstrip(b"\0"))["CalibrationInformation"]["Cameras"]
        (own,) = [one for one in cameras if one["Purpose"] == "CALIBRATION_CameraPurposeDepth"]
        numbers = [float(one) for one in own["Intrinsics"]["ModelParameters"]]
        cx, cy, fx, fy, k1, k2, k3, k4, k5, k6, _, _, p2, p1 = numbers[:14]
    except (ValueError, LookupError, TypeError, RecursionError) as error:
        raise InvalidInput(
            f"{_CALIBRATION}: {describe_cause(error)}; give --intrinsics of the depth camera"
        ) from error
    if size not in _MODES:
        raise InvalidInput(
            f"{_CALIBRATION} is for images of {sorted(_MODES)}, got {size}; give --intrinsics"
        )
    (width, height), (left, top) = _MODES[size]
    return {
        "focal": [fx * width, fy * height],
        "centre": [cx * width - left - 0.5, cy * height - top - 0.5],
        "distortion": [k1, k2, p1, p2, k3, k4, k5, k6],
    }


#: Readers by the file's ending.
VIDEOS = {".bag": _read_bag, ".mkv": _read_mkv}
