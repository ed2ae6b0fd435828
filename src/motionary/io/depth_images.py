"""Recordings of depth cameras: folders of 16-bit PNG with intrinsics, npz, mat, bag and mkv.

Conventions: depth along the camera's axis in metres, NaN where nothing was measured. Intrinsics are
focal length and centre in pixels, the first pixel's centre at (0, 0). Mirrored images are turned
back: columns are reversed, and the centre with them. What a lens bends is put straight.
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput, UnreadableFile
from motionary.files import NO_SUCH_FILE
from motionary.io.cameras import natural
from motionary.io.depth_videos import VIDEOS, StoredImages, telling
from motionary.io.text import read_json

Floats = NDArray[np.float64]

__all__ = [
    "DEPTH_FORMATS", "INTRINSICS", "UTD_MHAD", "DepthRecording", "read_depth", "read_intrinsics",
]  # fmt: skip

#: Names of the file with intrinsics in a folder of images.
INTRINSICS = ("camera.json", "intrinsics.json", "camera_intrinsics.json")
DEPTH_FORMATS = {
    "PNG": "a folder of 16-bit images, with camera.json",
    "npz": "depth, focal, centre, rate_hz",
    "mat": "UTD-MHAD: d_depth",
    "bag": "RealSense or ROS; needs motionary[depth]",
    "mkv": "Azure Kinect or Femto; needs motionary[depth]",
}
#: The camera of UTD-MHAD, and that its images are mirrored.
UTD_MHAD: dict[str, Any] = {
    "focal": (285.63, 285.63), "centre": (160.0, 120.0), "rate_hz": 30.0, "unit": "mm",
    "mirrored": True,
}  # fmt: skip
_UNITS = {"mm": 0.001, "m": 1.0, "cm": 0.01}
Source = tuple[Path, ...] | NDArray[Any] | StoredImages
_Reader = Callable[[Path], tuple[Source, dict[str, Any]]]
# What cameras of rooms measure; beyond, the unit is another one.
_FARTHEST_M, _NEAREST_M = 30.0, 0.05
# A time step so many times the usual one is a gap.
_GAP = 2.5


@dataclass(frozen=True, eq=False)
class DepthRecording:
    """Images of a depth camera, read one after the other.

    Attributes
    ----------
    name : of the recording
    source : the files of the images, or all images (n, height, width) as they are, or where they
        are stored
    width, height : of the images
    focal, centre : in pixels
    rate_hz : images a second
    scale : metres of one
    distortion : of the lens, k1, k2, p1, p2, k3, k4, k5, k6 as OpenCV has them, or fewer; images
        are put straight
    mirrored : whether the images were mirrored; they are turned back
    world_from_camera, position : of the camera, if the file has them
    gaps : numbers of images before which time is missing
    notes : what was assumed or noticed
    """

    name: str
    source: Source
    width: int
    height: int
    focal: tuple[float, float]
    centre: tuple[float, float]
    rate_hz: float
    scale: float = 0.001
    distortion: tuple[float, ...] = ()
    mirrored: bool = False
    world_from_camera: Floats | None = None
    position: Floats | None = None
    gaps: tuple[int, ...] = ()
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        low, high = -0.5, 1.5
        for side, focal, centre in zip(
            (self.width, self.height), self.focal, self.centre, strict=True
        ):
            if not 0.2 * side < focal < 10 * side or not low * side < centre < high * side:
                raise InvalidInput(
                    f"intrinsics do not belong to images of {self.width} x "
                    f"{self.height}: focal {self.focal}, centre {self.centre}; give those of the "
                    "depth camera at this size, in pixels",
                    file=self.name,
                )
        if not 0 < self.rate_hz <= 1000:
            raise InvalidInput(
                f"images a second must be above 0, got {self.rate_hz:g}", file=self.name
            )

    def __len__(self) -> int:
        return len(self.source)

    def images(self) -> Iterator[Floats]:
        """Depth (height, width) in metres, image by image.

        Raises
        ------
        InvalidInput, UnreadableFile
            If an image has another size, too few bits, or values of another unit.
        """
        straight = self._find_straight() if any(self.distortion) else None
        for one in self.source:
            raw, name = (_read_png(one), one.name) if isinstance(one, Path) else (one, self.name)
            if raw.shape != (self.height, self.width):
                raise InvalidInput(
                    f"has another size, {raw.shape[1]} x {raw.shape[0]} in place of "
                    f"{self.width} x {self.height}; all images of a recording need one size",
                    file=name,
                )
            depth = raw.astype(np.float64) * self.scale
            depth[~(depth > 0)] = np.nan
            _check_unit(depth, name)
            if straight is not None:
                depth = np.where(straight < 0, np.nan, depth.reshape(-1)[straight])
            yield depth[:, ::-1] if self.mirrored else depth

    def _find_straight(self) -> NDArray[np.intp]:
        """The pixel of the bent image that each pixel of the straight one is; -1 outside."""
        # The nearest, not a mixture: depths between two surfaces are of neither.
        k1, k2, p1, p2, k3, k4, k5, k6 = (*self.distortion, *(0.0,) * 8)[:8]
        centre_x = self.width - 1 - self.centre[0] if self.mirrored else self.centre[0]
        x = ((np.arange(self.width) - centre_x) / self.focal[0])[None, :]
        y = ((np.arange(self.height) - self.centre[1]) / self.focal[1])[:, None]
        r = x * x + y * y
        out = (1 + r * (k1 + r * (k2 + r * k3))) / (1 + r * (k4 + r * (k5 + r * k6)))
        bent_x = x * out + 2 * p1 * x * y + p2 * (r + 2 * x * x)
        bent_y = y * out + p1 * (r + 2 * y * y) + 2 * p2 * x * y
        columns = np.rint(bent_x * self.focal[0] + centre_x)
        rows = np.rint(bent_y * self.focal[1] + self.centre[1])
        inside = (columns >= 0) & (columns < self.width) & (rows >= 0) & (rows < self.height)
        return np.where(inside, rows * self.width + columns, -1).astype(np.intp)


def read_depth(
    path: str | Path, *, intrinsics: Mapping[str, Any] | None = None, mirrored: bool | None = None
) -> DepthRecording:
    """A recording of a depth camera.

    Parameters
    ----------
    path : a folder of 16-bit PNG, an npz, a mat of UTD-MHAD, a bag of RealSense or ROS, an mkv of
        Azure Kinect or Femto; beside the last two there may be intrinsics, as NAME.json
    intrinsics : what the files do not say, or say wrongly: `focal`, `centre`, `distortion`,
        `rate_hz`, `unit` ("mm", "m"), `times_s`, `world_from_camera`, `position`
    mirrored : whether the images are mirrored; as the file says if None

    Raises
    ------
    UnreadableFile
        If there are no such images.
    InvalidInput
        If intrinsics are missing or wrong.
    """
    path = Path(path)
    if not path.exists():
        raise UnreadableFile(NO_SUCH_FILE, file=path)
    readers: dict[str, _Reader] = {".npz": _read_npz, ".mat": _read_mat, **VIDEOS}
    suffix = path.suffix.lower()
    read = _read_folder if path.is_dir() else readers.get(suffix)
    if read is None:
        kinds = "; ".join(f"{kind}: {what}" for kind, what in DEPTH_FORMATS.items())
        raise UnreadableFile(f"holds no depth images that can be read ({kinds})", file=path.name)
    source, told = read(path)
    if path.is_file() and suffix in VIDEOS and path.with_suffix(".json").is_file():
        told |= read_intrinsics(path.with_suffix(".json"))
    told |= intrinsics or {}
    first = next(iter(source))
    if isinstance(first, Path):
        first = _read_png(first)
    recording = _describe(path.stem, source, first, told)
    if mirrored is not None:
        recording = replace(recording, mirrored=mirrored)
    if recording.mirrored:
        turned = (recording.width - 1 - recording.centre[0], recording.centre[1])
        note = "the images are mirrored: left and right were exchanged back"
        recording = replace(recording, centre=turned, notes=(*recording.notes, note))
    return recording


def _describe(
    name: str, source: Source, first: NDArray[Any], told: Mapping[str, Any]
) -> DepthRecording:
    """The recording of images and of what is told of them."""
    focal = _pair(told, "focal", ("fx", "fy"))
    centre = _pair(told, "centre", ("cx", "cy"), ("ppx", "ppy"), ("center",))
    wanted = (("focal (fx, fy)", focal), ("centre (cx, cy)", centre))
    lacking = [what for what, given in wanted if given is None]
    if lacking:
        raise InvalidInput(
            f"intrinsics are missing: {' and '.join(lacking)} of the depth camera, in pixels; "
            "write them into camera.json beside the images, or give --intrinsics",
            file=name,
        )
    for side, given in (("width", first.shape[1]), ("height", first.shape[0])):
        if side in told and int(told[side]) != given:
            raise InvalidInput(
                f"intrinsics are for a {side} of {told[side]}, the images have {given}; "
                "give those of this size",
                file=name,
            )
    scale = told.get("depth_scale", _UNITS.get(str(told.get("unit", "mm"))))
    if scale is None:
        raise InvalidInput(f"unit: choose {', '.join(_UNITS)}, got {told['unit']!r}", file=name)
    rate, gaps, notes = _read_times(told, len(source))
    turn, place = told.get("world_from_camera"), told.get("position")
    if told.get("synthetic"):
        notes = (*notes, "the images are synthetic")
    return DepthRecording(
        name, source, first.shape[1], first.shape[0], focal, centre, rate, float(scale),
        tuple(np.ravel(told.get("distortion", ())).astype(float).tolist()),
        bool(told.get("mirrored", False)),
        None if turn is None else np.asarray(turn, dtype=np.float64),
        None if place is None else np.asarray(place, dtype=np.float64),
        gaps, notes,
    )  # fmt: skip


def _pair(told: Mapping[str, Any], name: str, *others: tuple[str, ...]) -> Any:
    """Two numbers by one of their names."""
    for names in ((name,), *others):
        if all(key in told for key in names):
            values = np.ravel([told[key] for key in names]).astype(np.float64)
            return (float(values[0]), float(values[-1]))
    return None


def _read_times(told: Mapping[str, Any], n: int) -> tuple[float, tuple[int, ...], tuple[str, ...]]:
    """Images a second, images before which time is missing, and what is noticed."""
    if "times_s" not in told:
        rate = told.get("rate_hz", told.get("fps"))
        if rate is None:
            return 30.0, (), ("30 images a second are assumed: neither rate nor times are told",)
        return float(rate), (), ()
    times = np.asarray(told["times_s"], dtype=np.float64)
    steps = np.diff(times)
    if times.shape != (n,) or not (steps > 0).all():
        raise InvalidInput(
            f"times_s needs a time in seconds for each of the {n} images, growing, got "
            f"{times.shape}"
        )
    usual = float(np.median(steps)) if n > 1 else 1 / 30
    gaps = tuple((np.flatnonzero(steps > _GAP * usual) + 1).tolist())
    longest = float(steps.max()) if n > 1 else 0.0
    notes = (f"{len(gaps)} gaps in time, up to {longest:.2f} s",) if gaps else ()
    return 1 / usual, gaps, notes


def _read_folder(path: Path) -> tuple[tuple[Path, ...], dict[str, Any]]:
    found = (one for one in path.iterdir() if one.suffix.lower() == ".png")
    files = tuple(sorted(found, key=lambda one: natural(one.stem)))
    if not files:
        raise UnreadableFile("holds no PNG images of depth", file=path)
    told: dict[str, Any] = {}
    for name in INTRINSICS:
        if (path / name).is_file():
            told = read_intrinsics(path / name)
            break
    if "times_s" not in told and all(one.stem.count(".") == 1 for one in files):
        # As the TUM benchmark names them: 1305031102.160407.png.
        with suppress(ValueError):
            files = tuple(sorted(files, key=lambda one: float(one.stem)))
            told = {**told, "times_s": [float(one.stem) for one in files]}
    return files, told


def read_intrinsics(path: Path) -> dict[str, Any]:
    """What a file of JSON tells of a depth camera.

    Raises
    ------
    UnreadableFile
        If the file is missing or no JSON.
    InvalidInput
        If it is no object.
    """
    told = read_json(path)
    if not isinstance(told, dict):
        raise InvalidInput('needs {"focal": [fx, fy], "centre": [cx, cy]}', file=path.name)
    return told


def _read_npz(path: Path) -> tuple[NDArray[Any], dict[str, Any]]:
    # Images of a still background pack too well for the limits of other arrays.
    with (
        telling(path, "NumPy"),
        path.open("rb") as file,
        np.load(file, allow_pickle=False) as arrays,
    ):
        held = {key: arrays[key] for key in arrays.files}
    images = held.pop("depth", None)
    if images is None or images.ndim != 3 or not len(images):
        raise UnreadableFile(
            f"needs an array `depth` (images, height, width), got {', '.join(held) or 'nothing'}",
            file=path.name,
        )
    told = {key: one.item() if one.ndim == 0 else one for key, one in held.items()}
    if "unit" not in told and np.issubdtype(images.dtype, np.floating):
        told["unit"] = "m"
    return images, told


def _read_mat(path: Path) -> tuple[NDArray[Any], dict[str, Any]]:
    from scipy.io import loadmat

    with telling(path, "SciPy"):
        held = loadmat(path)
    images = held.get("d_depth")
    if images is None or images.ndim != 3:
        raise UnreadableFile("holds no d_depth (height, width, images)", file=path.name)
    return np.moveaxis(images, 2, 0), dict(UTD_MHAD)


def _read_png(path: Path) -> NDArray[Any]:
    """A 16-bit image of one channel, as it is."""
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(path) as image:
            mode = image.mode
            values = np.array(image)
    except (UnidentifiedImageError, OSError, SyntaxError) as error:
        raise UnreadableFile(f"is no image that can be read: {error}", file=path.name) from None
    if not (mode.startswith("I") and values.ndim == 2):
        raise InvalidInput(
            f"depth needs one channel of 16 bits, got {mode} with "
            f"{8 * values.itemsize} bits: this is a picture "
            "for the eye; export the raw depth",
            file=path.name,
        )
    return values


def _check_unit(depth: Floats, name: str) -> None:
    """Refuse depths that no camera measures: the unit is another one."""
    known = depth[~np.isnan(depth)]
    if not len(known):
        return
    middle = float(np.median(known))
    if not _NEAREST_M < middle < _FARTHEST_M:
        other = "mm" if middle > _FARTHEST_M else "m"
        raise InvalidInput(
            f"depths of {middle:.4g} m are none of a room; the unit is another one, "
            f'perhaps "unit": "{other}"',
            file=name,
        )
