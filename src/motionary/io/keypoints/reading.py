"""Reading of keypoints: JSON of OpenPose, Pose2Sim, COCO and AlphaPose.

A folder for each camera with a JSON for each image (OpenPose, Pose2Sim), or one JSON for all
images of a camera (COCO, AlphaPose).
"""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput, UnreadableFile, check_path
from motionary.io.cameras import natural
from motionary.io.keypoints.views import COCO, LAYOUTS, OPENPOSE, Place, Views
from motionary.io.text import read_json

Floats = NDArray[np.float64]

_MOST_FRAMES = 1_000_000
# A second person counts if it is as well seen as this part of the first one, so often.
_RIVAL, _OFTEN = 0.7, 0.05


class _Detected(NamedTuple):
    """People of one image: points (people, points, 3), and where each stands."""

    number: int | None
    people: list[Floats]
    places: list[Place]


def read_keypoints(
    folder: str | Path, *, layout: str | None = None, person: int | None = None
) -> Views:
    """The keypoints of one person in a folder of cameras.

    Parameters
    ----------
    folder : has a folder for each camera with a JSON for each image, or a JSON for each camera
    layout : one of `LAYOUTS`; found by the number of points, if None
    person : number of the person in each image's list, from 0; the best seen one, if None

    Raises
    ------
    UnreadableFile
        If a file is no JSON of keypoints.
    InvalidInput
        If there are less than two cameras, nobody is seen, or two people are.
    """
    folder = check_path(folder, remedy="give the folder of keypoints")
    if layout is not None and layout not in LAYOUTS:
        raise InvalidInput(f"layout: choose one of {', '.join(LAYOUTS)}, got {layout!r}")
    cameras = _find_cameras(folder)
    seen = [_read_camera(files) for _, files in cameras]
    size = _count_points(seen, folder.name)
    chosen = [[_choose(image, person) for image in images] for images in seen]
    names = tuple(name for name, _ in cameras)
    numbers, first, notes = _align([[image.number for image in images] for images in seen])
    if person is None:
        notes += _look_for_others(seen, names)
    n_frames = max((max(own, default=-1) for own in numbers), default=-1) + 1
    raw = np.full((len(cameras), n_frames, size, 3), np.nan)
    places: list[list[Place | None]] = [[None] * n_frames for _ in cameras]
    for camera, picks in enumerate(chosen):
        for number, pick in zip(numbers[camera], picks, strict=True):
            if pick is not None:
                raw[camera, number], places[camera][number] = pick
    if np.isnan(raw).all():
        raise InvalidInput(f"nobody is seen in any of {n_frames} frames", file=folder.name)
    layout = layout or _find_layout(raw, folder.name)
    if LAYOUTS[layout][0] != size:
        raise InvalidInput(f"{layout} has {LAYOUTS[layout][0]} points, {folder.name} has {size}")
    pixels, scores = _split(raw)
    known = (scores > 0).any(axis=(1, 2))
    notes += [f"{names[k]} sees nobody: its files hold no person" for k in np.flatnonzero(~known)]
    kept = len(LAYOUTS[layout][1])
    return Views(
        names, LAYOUTS[layout][1], pixels[:, :, :kept],
        scores[:, :, :kept], layout, first, tuple(tuple(own) for own in places), tuple(notes),
    )  # fmt: skip


# ---- files


def _find_cameras(folder: Path) -> list[tuple[str, list[Path]]]:
    """Names of cameras and their files, in natural sequence."""
    if not folder.is_dir():
        raise UnreadableFile(
            "is no folder; give the one that holds a folder per camera", file=folder
        )

    def files_of(place: Path) -> list[Path]:
        found = (path for path in place.iterdir() if path.suffix.lower() == ".json")
        return sorted((path for path in found if path.is_file()), key=lambda x: natural(x.name))

    inner = sorted((p for p in folder.iterdir() if p.is_dir()), key=lambda x: natural(x.name))
    cameras = [(place.name, files) for place in inner if (files := files_of(place))]
    if not cameras:
        cameras = [(path.stem, [path]) for path in files_of(folder)]
    if len(cameras) < 2:
        raise InvalidInput(
            f"holds keypoints of {len(cameras)} cameras, and two are needed; expected a "
            "folder for each camera with a .json for each image, or a .json for each camera",
            file=folder,
        )
    return cameras


def _read_camera(files: Sequence[Path]) -> list[_Detected]:
    """The images of one camera."""
    images = [image for path in files for image in _read_file(path)]
    numbers = [image.number for image in images]
    if None in numbers or len(set(numbers)) != len(numbers):
        return [image._replace(number=k) for k, image in enumerate(images)]
    return images


def _read_file(path: Path) -> list[_Detected]:
    content = read_json(path)
    if isinstance(content, dict) and isinstance(content.get("people"), list):
        people = [one.get(OPENPOSE) for one in content["people"] if isinstance(one, dict)]
        return [_detected(_number_of(path.stem), path, list(enumerate(people)))]
    named: dict[Any, Any] = {}
    if isinstance(content, dict) and isinstance(content.get("annotations"), list):
        for image in content.get("images") or ():
            if isinstance(image, dict):
                named[image.get("id")] = image.get("file_name")
        content = content["annotations"]
    if not isinstance(content, list) or not all(
        isinstance(one, dict) and "image_id" in one and COCO in one for one in content
    ):
        raise UnreadableFile(
            f"holds no keypoints; expected OpenPose's people with {OPENPOSE}, or "
            "annotations of COCO with image_id and keypoints",
            file=path.name,
        )
    images: dict[Any, list[tuple[int, Any]]] = {key: [] for key in named}
    for index, one in enumerate(content):
        images.setdefault(one["image_id"], []).append((index, one[COCO]))
    return [_detected(_number_of(named.get(key, key)), path, own) for key, own in images.items()]


def _number_of(name: Any) -> int | None:
    """The last whole number of an image's name."""
    if isinstance(name, int):
        return name
    found = re.findall(r"[0-9]+", Path(str(name)).name)
    return int(found[-1]) if found and len(found[-1]) < 18 else None


def _detected(number: int | None, path: Path, lists: list[tuple[int, Any]]) -> _Detected:
    people, places = [], []
    for index, flat in lists:
        if not isinstance(flat, list) or not flat:
            continue
        try:
            points = np.array(flat, dtype=np.float64)
        except (TypeError, ValueError):
            points = np.zeros(1)
        if points.ndim != 1 or points.size % 3:
            raise UnreadableFile(
                f"expected numbers x, y, score of each point, got {str(flat)[:60]}", file=path.name
            )
        people.append(points.reshape(-1, 3))
        places.append(Place(path, index))
    return _Detected(number, people, places)


# ---- people, frames, points


def _count_points(seen: list[list[_Detected]], source: str) -> int:
    sizes = {len(one) for images in seen for image in images for one in image.people}
    if not sizes:
        raise InvalidInput(
            "nobody is seen in any image; all lists of people are empty", file=source
        )
    if len(sizes) > 1:
        raise InvalidInput(
            f"people have {sorted(sizes)} points; keep one layout in a folder", file=source
        )
    return sizes.pop()


def _weight(points: Floats) -> float:
    """How well and how large a person is seen."""
    seen = points[points[:, 2] > 0]
    if not len(seen):
        return 0.0
    return float(seen[:, 2].clip(0, 1).sum() * np.linalg.norm(np.ptp(seen[:, :2], axis=0)))


def _choose(image: _Detected, person: int | None) -> tuple[Floats, Place] | None:
    """Points and place of the person in one image; None if it is not seen."""
    if person is not None:
        if not 0 <= person < len(image.people):
            return None
        return image.people[person], image.places[person]
    if not image.people:
        return None
    best = max(range(len(image.people)), key=lambda k: _weight(image.people[k]))
    return image.people[best], image.places[best]


def _look_for_others(seen: list[list[_Detected]], names: Sequence[str]) -> list[str]:
    """Notes on further people; refused where one is often nearly as well seen as the first."""
    notes = []
    for name, images in zip(names, seen, strict=True):
        ranked = [sorted(map(_weight, image.people), reverse=True) for image in images]
        often = sum(len(own) > 1 and own[1] > _RIVAL * own[0] for own in ranked)
        if often > _OFTEN * len(images):
            raise InvalidInput(
                f"sees two people in {often} of {len(images)} images; tell them apart "
                "first (Pose2Sim: personAssociation) and give that folder, or the number of "
                "the person in each list: --person 0",
                file=name,
            )
        several = sum(len(own) > 1 for own in ranked)
        if several:
            notes.append(
                f"{name} sees several people in {several} of {len(images)} images: the one that "
                "is seen best is taken"
            )
    return notes


def _align(numbers: list[list[int | None]]) -> tuple[list[list[int]], int, list[str]]:
    """Frames from 0 of each camera's images, the number of the first one, and notes."""
    known = [[n for n in own if n is not None] for own in numbers]
    firsts = [min(own) for own in known if own]
    lasts = [max(own) for own in known if own]
    most = max(map(len, known))
    # Numbers that are times, or that each camera counts for itself, do not join cameras.
    if max(lasts) - min(firsts) + 1 <= min(_MOST_FRAMES, 2 * most + 1):
        first = min(firsts)
        return [[n - first for n in own] for own in known], first, []
    notes = ["numbers of the cameras' images do not fit each other: images are joined in sequence"]
    return [list(range(len(own))) for own in known], 0, notes


def _find_layout(raw: Floats, source: str) -> str:
    """The layout by the number of points; of two with 25 the one whose feet are at the ankles."""
    size = raw.shape[2]
    fitting = [name for name, (count, _) in LAYOUTS.items() if count == size]
    if not fitting:
        known = ", ".join(f"{name} {count}" for name, (count, _) in LAYOUTS.items())
        raise InvalidInput(f"people have {size} points; known layouts: {known}", file=source)
    if len(fitting) == 1:
        return fitting[0]
    pixels = _split(raw)[0]

    def far(name: str, one: str, other: str) -> float:
        names = LAYOUTS[name][1]
        away = pixels[:, :, names.index(one)] - pixels[:, :, names.index(other)]
        far = np.linalg.norm(away, axis=-1)
        return float(np.nanmedian(far)) if np.isfinite(far).any() else np.inf

    pairs = (("LAnkle", "LHeel"), ("RAnkle", "RHeel"), ("LEye", "Nose"), ("REye", "Nose"))
    return min(fitting, key=lambda name: min(sum(far(name, *pair) for pair in pairs), 1e9))


def _split(raw: Floats) -> tuple[Floats, Floats]:
    """Pixels, NaN where not detected, and scores."""
    pixels, scores = raw[..., :2].copy(), np.nan_to_num(raw[..., 2])
    # COCO's third number is 0, 1 (hidden) or 2 (seen).
    if scores.size and scores.max() > 1 and np.isin(scores, (0, 1, 2)).all():
        scores = scores / 2
    lost = (scores <= 0) | np.isnan(pixels).any(axis=-1) | (pixels == 0).all(axis=-1)
    pixels[lost] = np.nan
    return pixels, np.where(lost, 0.0, scores.clip(0, 1))
