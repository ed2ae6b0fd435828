"""Calibrated cameras: TOML of Pose2Sim, anipose and freemocap, Qualisys, OpenCV's YAML and XML.

Conventions: `rotation` and `translation` take the world into the camera, x = R X + t, as
OpenCV has it; the camera looks along its z, x to the right, y down. Lengths stay in the unit of
the file. Lens distortion is that of OpenCV: k1, k2, p1, p2, k3, or four numbers of a fisheye.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput, UnreadableFile, check_path
from motionary.io.text import parse_xml, read_text, read_toml
from motionary.rotations import quaternions_to_matrices, rotation_vectors_to_quaternions

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

Floats = NDArray[np.float64]

# Qualisys counts intrinsics in 64ths of a pixel, and places in millimetres.
_QUALISYS_STEPS = 64.0
_TOML_KEYS = {
    "matrix": "matrix", "turn": "rotation", "move": "translation", "lens": "distortions",
    "size": "size",
}  # fmt: skip
_OPENCV_KEYS = {
    "matrix": ("camera_matrix", "CameraMatrix", "K", "intrinsic_matrix", "M"),
    "turn": ("R", "Rot", "rotation", "Rotation", "rvec", "rotation_matrix"),
    "move": ("T", "translation", "Translation", "tvec", "t"),
    "lens": ("distortion_coefficients", "DistortionCoeffs", "dist", "D", "dist_coeffs",
             "distortion", "k"),
}  # fmt: skip
_SIZE_KEYS = (("image_width", "image_height"), ("width", "height"), ("W", "H"))
_YAML_SUFFIXES = (".yml", ".yaml", ".xml")


@dataclass(frozen=True, slots=True, eq=False)
class CalibratedCamera:
    """A camera whose lens and place are known.

    Attributes
    ----------
    name : as the calibration calls it
    matrix : array, shape (3, 3), focal lengths and centre in pixels
    rotation : array, shape (3, 3), from the world to the camera
    translation : array, shape (3,), in the unit of the calibration
    distortion : k1, k2, p1, p2, k3 of OpenCV, or k1 to k4 of its fisheye
    size : width and height in pixels; None if the calibration does not say
    fisheye : whether the lens is one
    """

    name: str
    matrix: Floats
    rotation: Floats
    translation: Floats
    distortion: Floats
    size: tuple[float, float] | None = None
    fisheye: bool = False

    def __post_init__(self) -> None:
        finite = all(
            np.isfinite(part).all()
            for part in (self.matrix, self.rotation, self.translation, self.distortion)
        )
        if not finite or self.matrix[0, 0] <= 0 or self.matrix[1, 1] <= 0:
            raise InvalidInput(
                f"camera {self.name}: needs finite numbers and focal lengths above 0; "
                "was it calibrated?"
            )
        if not np.allclose(self.rotation @ self.rotation.T, np.eye(3), atol=1e-3):
            raise InvalidInput(f"camera {self.name}: its rotation is no rotation matrix")

    @property
    def position(self) -> Floats:
        """Place of the camera in the world, in the unit of the calibration."""
        place: Floats = -self.rotation.T @ self.translation
        return place


def read_cameras(path: str | Path) -> tuple[CalibratedCamera, ...]:
    """The cameras of a calibration, in its sequence.

    Parameters
    ----------
    path : a TOML of Pose2Sim, anipose or freemocap, a .qca.txt of Qualisys, a YAML or XML of
        OpenCV, or a folder of such files: one per camera, or intri.yml and extri.yml

    Raises
    ------
    UnreadableFile
        If it is none of these.
    InvalidInput
        If a camera lacks something, or its numbers are impossible.
    """
    path = check_path(path, remedy="give the calibration's file")
    if path.is_dir():
        cameras = _read_folder(path)
    elif path.suffix.lower() == ".toml":
        cameras = _from_toml(read_toml(path), path.name)
    elif path.suffix.lower() in _YAML_SUFFIXES:
        cameras = _from_opencv(_read_storage(path), path)
    elif path.name.lower().endswith((".qca.txt", ".qca")):
        cameras = _from_qualisys(read_text(path), path.name)
    else:
        raise UnreadableFile(
            "is no calibration that can be read; give a .toml (Pose2Sim, anipose, "
            "freemocap), .qca.txt (Qualisys), or .yml or .xml (OpenCV)",
            file=path.name,
        )
    names = [camera.name for camera in cameras]
    if not cameras or len(set(names)) != len(names):
        raise InvalidInput(
            f"needs cameras of different names, got {', '.join(names) or 'none'}", file=path.name
        )
    return tuple(cameras)


def _camera(
    name: str, source: str, parts: Mapping[str, Any], *, fisheye: bool = False
) -> CalibratedCamera:
    """A camera of matrix, lens, turn, move and size, whatever shape a file gives them."""
    lacking = [part for part in ("matrix", "turn", "move") if parts.get(part) is None]
    if lacking:
        words = {"matrix": "a camera matrix", "turn": "a rotation", "move": "a translation"}
        raise InvalidInput(
            f"camera {name} lacks {' and '.join(words[part] for part in lacking)}; "
            "intrinsics and extrinsics are both needed",
            file=source,
        )
    try:
        matrix = np.array(parts["matrix"], dtype=np.float64).reshape(3, 3)
        turn = np.array(parts["turn"], dtype=np.float64).ravel()
        if turn.size == 3:
            turn = quaternions_to_matrices(rotation_vectors_to_quaternions(turn)).ravel()
        rotation = turn.reshape(3, 3)
        move = np.array(parts["move"], dtype=np.float64).reshape(3)
        lens = parts.get("lens")
        distortion = np.zeros(0) if lens is None else np.array(lens, dtype=np.float64).ravel()
    except (TypeError, ValueError) as error:
        raise InvalidInput(
            f"camera {name}: a matrix needs 3 x 3 numbers, a rotation 3 or 9, a translation 3",
            file=source,
        ) from error
    size = parts.get("size")
    both = None
    if size is not None and len(size) >= 2 and min(size[:2]) > 0:
        both = (float(size[0]), float(size[1]))
    most = 4 if fisheye else 5
    if distortion.size > most and np.any(distortion[most:]):
        raise InvalidInput(
            f"camera {name}: has {distortion.size} numbers of distortion and at most "
            f"{most} are understood; calibrate without the rational model",
            file=source,
        )
    lens = np.zeros(most)
    lens[: distortion.size] = distortion[:most]
    return CalibratedCamera(name, matrix, rotation, move, lens, both, fisheye)


def _from_toml(content: Mapping[str, Any], source: str) -> list[CalibratedCamera]:
    """Cameras of tables with matrix, distortions, rotation and translation."""
    tables = {
        key: table
        for key, table in content.items()
        if isinstance(table, dict) and {"matrix", "rotation", "translation"} & table.keys()
    }
    if not tables:
        raise UnreadableFile(
            "holds no camera; expected tables such as [cam_01] with matrix, "
            "distortions, rotation and translation",
            file=source,
        )
    cameras = []
    for key, table in tables.items():
        parts = {part: table.get(name) for part, name in _TOML_KEYS.items()}
        name, fisheye = str(table.get("name", key)), bool(table.get("fisheye", False))
        cameras.append(_camera(name, source, parts, fisheye=fisheye))
    return cameras


def _parse_xml(text: str, source: str, maker: str) -> "Element":
    problem, refusal = f"is no XML of {maker}", f"has entities, as no file of {maker} does"
    return parse_xml(text, file=source, problem=problem, refusal=refusal)


def _from_qualisys(text: str, source: str) -> list[CalibratedCamera]:
    """Video cameras of a Qualisys calibration; those without images are left out."""
    root = _parse_xml(text, source, "Qualisys")
    cameras: list[CalibratedCamera] = []
    found = root.findall(".//camera")
    seeing = [one for one in found if "video" in (one.get("model") or "").lower()]
    for one in seeing or found:
        name = one.get("serial") or f"camera {len(cameras) + 1}"
        view, lens, place = (one.find(tag) for tag in ("fov_video", "intrinsic", "transform"))
        if view is None or lens is None or place is None:
            raise InvalidInput(
                f"camera {name} lacks fov_video, intrinsic or transform; export the "
                "calibration of the video cameras",
                file=source,
            )
        cameras.append(_qualisys_camera(name, source, view.attrib, lens.attrib, place.attrib))
    return sorted(cameras, key=lambda camera: natural(camera.name))


def _qualisys_camera(
    name: str,
    source: str,
    view: Mapping[str, str],
    lens: Mapping[str, str],
    place: Mapping[str, str],
) -> CalibratedCamera:
    try:
        left, top, right, bottom = (float(view[k]) for k in ("left", "top", "right", "bottom"))
        focal = [float(lens[f"focalLength{axis}"]) / _QUALISYS_STEPS for axis in "UV"]
        centre = [float(lens[f"centerPoint{axis}"]) / _QUALISYS_STEPS for axis in "UV"]
        kinds = ("radialDistortion1", "radialDistortion2", "tangentalDistortion1",
                 "tangentalDistortion2")  # fmt: skip
        bent = [float(lens.get(kind, 0)) / _QUALISYS_STEPS for kind in kinds]
        turn = np.array([float(place[f"r{i}{j}"]) for i in "123" for j in "123"]).reshape(3, 3)
        position = np.array([float(place[axis]) for axis in "xyz"]) / 1000
    except (KeyError, ValueError) as error:
        raise InvalidInput(f"camera {name} has no number {error}", file=source) from None
    # Rows of the file are the camera's axes; it looks along -z, with y up.
    rotation = np.diag([1.0, -1.0, -1.0]) @ turn
    matrix = [focal[0], 0, centre[0] - left, 0, focal[1], centre[1] - top, 0, 0, 1]
    size = (right - left + 1, bottom - top + 1)
    parts = {"matrix": matrix, "turn": rotation, "move": -rotation @ position, "lens": bent}
    return _camera(name, source, {**parts, "size": size})


# ---- OpenCV


def _read_folder(path: Path) -> list[CalibratedCamera]:
    """Cameras of intri.yml and extri.yml, or of one file each, by their names."""
    pair = [path / "intri.yml", path / "extri.yml"]
    if all(one.is_file() for one in pair):
        return _from_opencv(_read_storage(pair[0]) | _read_storage(pair[1]), path)
    found = (one for one in path.iterdir() if one.suffix.lower() in _YAML_SUFFIXES)
    files = sorted(found, key=lambda one: natural(one.name))
    if not files:
        raise UnreadableFile(
            "holds no calibration; expected intri.yml and extri.yml, or a .yml or .xml "
            "for each camera",
            file=path,
        )
    return [camera for one in files for camera in _from_opencv(_read_storage(one), one)]


def _from_opencv(content: Mapping[str, Any], path: Path) -> list[CalibratedCamera]:
    """Cameras of K_name, dist_name, R_name or Rot_name and T_name, or the one of a file."""
    names = content.get("names")
    if not isinstance(names, list):
        names = [key[2:] for key in content if key.startswith("K_")]
    if names:
        return [_named_camera(content, f"_{name}", str(name), path.name) for name in names]
    return [_named_camera(content, "", path.stem, path.name)]


def _named_camera(
    content: Mapping[str, Any], ending: str, name: str, source: str
) -> CalibratedCamera:
    def find(keys: tuple[str, ...]) -> Any:
        found = [content[key + ending] for key in keys if key + ending in content]
        # A matrix tells more than a vector that it was made of.
        return max(found, key=np.size) if found else None

    size = None
    for width, height in _SIZE_KEYS:
        both = [content.get(key + ending, content.get(key)) for key in (width, height)]
        if size is None and all(isinstance(one, int | float) for one in both):
            size = both
    parts = {part: find(wanted) for part, wanted in _OPENCV_KEYS.items()}
    return _camera(name, source, {**parts, "size": size})


def _read_storage(path: Path) -> dict[str, Any]:
    """Numbers and matrices of OpenCV's file storage, by their keys."""
    read = _read_xml if path.suffix.lower() == ".xml" else _read_yaml
    return read(read_text(path), path.name)


def _read_xml(text: str, source: str) -> dict[str, Any]:
    content: dict[str, Any] = {}
    for node in _parse_xml(text, source, "OpenCV"):
        data = node.findtext("data") if node.find("data") is not None else node.text
        numbers = _numbers(data or "")
        content[node.tag] = numbers[0] if len(numbers) == 1 else numbers or (data or "").strip()
    return content


def _read_yaml(text: str, source: str) -> dict[str, Any]:
    """The part of YAML that OpenCV writes: keys, numbers, matrices, and a list of names."""
    content: dict[str, Any] = {}
    key = ""
    for block in re.split(r"\n(?=\S)", text):
        head = re.match(r"([A-Za-z_][\w. -]*?)\s*:\s*(.*)", block, re.DOTALL)
        if head is None:
            continue
        key, rest = head.groups()
        data = re.search(r"data\s*:\s*\[(.*?)\]", rest, re.DOTALL)
        if data is not None:
            content[key] = _numbers(data.group(1))
        elif re.match(r"\s*(\n\s*)?-", rest):
            content[key] = re.findall(r"-\s*[\"']?([^\"'\n]+?)[\"']?\s*(?:\n|$)", rest)
        elif rest.lstrip().startswith("["):
            content[key] = _numbers(rest.strip()[1:].partition("]")[0])
        else:
            numbers = _numbers(rest)
            content[key] = numbers[0] if len(numbers) == 1 else rest.strip()
    if not key:
        raise UnreadableFile("is no YAML of OpenCV; it has no line such as K_01: ...", file=source)
    return content


def _numbers(text: str) -> list[float]:
    """All numbers of a text, none if something else stands between them."""
    try:
        return [float(word) for word in text.replace(",", " ").split()]
    except ValueError:
        return []


def natural(name: str) -> list[tuple[int, str | int]]:
    """A key that sorts cam2 before cam10."""
    return [
        (0, int(part)) if part.isdigit() and part.isascii() else (1, part.lower())
        for part in re.split(r"([0-9]+)", name)
        if part
    ]
