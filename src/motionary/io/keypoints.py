"""Keypoints of one person in the images of several cameras, read and written again.

JSON of OpenPose, Pose2Sim, COCO and AlphaPose: a folder for each camera with a JSON for each
image (OpenPose, Pose2Sim), or one JSON for all images of a camera (COCO, AlphaPose). Files are
written again with points of sides exchanged. Points have one name in all layouts, those of
BODY_25, and the middle of the hips is "Hip".
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput, UnreadableFile, UnwritableFile, check_path
from motionary.files import read_bytes, write_atomically
from motionary.io.cameras import natural
from motionary.io.text import read_json

__all__ = ["LAYOUTS", "Place", "Views", "read_keypoints", "write_exchanged"]

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

_MOST_FRAMES = 1_000_000
# A second person counts if it is as well seen as this part of the first one, so often.
_RIVAL, _OFTEN = 0.7, 0.05

# Keys of the lists of points in files of OpenPose, and of COCO and AlphaPose.
_OPENPOSE, _COCO = "pose_keypoints_2d", "keypoints"

_FACE = ("Nose", "LEye", "REye", "LEar", "REar")
_BODY = (
    *_FACE, "LShoulder", "RShoulder", "LElbow", "RElbow", "LWrist", "RWrist", "LHip", "RHip",
    "LKnee", "RKnee", "LAnkle", "RAnkle",
)  # fmt: skip
_FEET = ("LBigToe", "LSmallToe", "LHeel", "RBigToe", "RSmallToe", "RHeel")
_ARMS = ("Nose", "Neck", "RShoulder", "RElbow", "RWrist", "LShoulder", "LElbow", "LWrist")
_LEGS = ("RHip", "RKnee", "RAnkle", "LHip", "LKnee", "LAnkle")
_HALPE = (
    *_BODY, "Head", "Neck", "Hip", "LBigToe", "RBigToe", "LSmallToe", "RSmallToe", "LHeel", "RHeel",
)  # fmt: skip
#: Number of points of each layout, and names of the first ones; others are left alone.
LAYOUTS: dict[str, tuple[int, tuple[str, ...]]] = {
    "BODY_25": (25, (*_ARMS, "Hip", *_LEGS, "REye", "LEye", "REar", "LEar", *_FEET)),
    "BODY_25B": (25, (*_BODY, "Neck", "Head", *_FEET)),
    "HALPE_26": (26, _HALPE),
    "COCO": (17, _BODY),
    "COCO_18": (18, (*_ARMS, *_LEGS, "REye", "LEye", "REar", "LEar")),
    "COCO_133": (133, (*_BODY, *_FEET)),
    "HALPE_136": (136, _HALPE),
}


class Place(NamedTuple):
    """Where the points of a frame stand: which file, and which list of points in it."""

    path: Path
    number: int


@dataclass(frozen=True, slots=True, eq=False)
class Views:
    """Keypoints of one person in the images of several cameras.

    Attributes
    ----------
    cameras : names of the cameras' folders or files
    names : of the points
    pixels : array, shape (cameras, frames, points, 2); NaN = not detected
    scores : array, shape (cameras, frames, points), from 0, not detected, to 1
    layout : one of `LAYOUTS`; empty if it is none
    first_frame : number that the files give the first frame
    places : for each camera and frame, where the points stand; None where nobody is seen
    notes : what was noticed while reading
    """

    cameras: tuple[str, ...]
    names: tuple[str, ...]
    pixels: Floats
    scores: Floats
    layout: str = ""
    first_frame: int = 0
    places: tuple[tuple[Place | None, ...], ...] = ()
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        shape = (len(self.cameras), self.pixels.shape[1], len(self.names))
        if self.pixels.shape != (*shape, 2) or self.scores.shape != shape:
            raise InvalidInput(
                f"{len(self.cameras)} cameras and {len(self.names)} points need pixels (cameras, "
                f"frames, points, 2) and scores, got {self.pixels.shape} and {self.scores.shape}"
            )

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        return int(self.pixels.shape[1])


#: Points of a person, shape (points, 3), and where they stand.
_Person = tuple[Floats, Place]
#: The number of an image, and who is seen in it.
_Image = tuple[int, list[_Person]]


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
    chosen = [[_choose(people, person) for _, people in images] for images in seen]
    names = tuple(name for name, _ in cameras)
    numbers, first, notes = _align([[number for number, _ in images] for images in seen])
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
    points = LAYOUTS[layout][1]
    pixels, scores = pixels[:, :, : len(points)], scores[:, :, : len(points)]
    of_frames = tuple(map(tuple, places))
    return Views(names, points, pixels, scores, layout, first, of_frames, tuple(notes))


def _find_cameras(folder: Path) -> list[tuple[str, list[Path]]]:
    """Names of cameras and their files, in natural sequence."""
    if not folder.is_dir():
        problem = "is no folder; give the one that holds a folder per camera"
        raise UnreadableFile(problem, file=folder)

    def files_of(place: Path) -> list[Path]:
        found = (path for path in place.iterdir() if path.suffix.lower() == ".json")
        return sorted((path for path in found if path.is_file()), key=lambda x: natural(x.name))

    inner = sorted((p for p in folder.iterdir() if p.is_dir()), key=lambda x: natural(x.name))
    cameras = [(place.name, files) for place in inner if (files := files_of(place))]
    if not cameras:
        cameras = [(path.stem, [path]) for path in files_of(folder)]
    if len(cameras) < 2:
        raise InvalidInput(
            f"holds keypoints of {'one camera' if cameras else 'no camera'}, and two are needed; "
            "expected a folder for each camera with a .json for each image, or a .json for each "
            "camera",
            file=folder,
        )
    return cameras


def _read_camera(files: Sequence[Path]) -> list[_Image]:
    images = [image for path in files for image in _read_file(path)]
    numbers = [number for number, _ in images if number is not None]
    if len(set(numbers)) == len(images):
        return list(zip(numbers, (people for _, people in images), strict=True))
    return list(enumerate(people for _, people in images))


def _read_file(path: Path) -> list[tuple[int | None, list[_Person]]]:
    content = read_json(path)
    if isinstance(content, dict) and isinstance(content.get("people"), list):
        people = [one.get(_OPENPOSE) for one in content["people"] if isinstance(one, dict)]
        return [(_number_of(path.stem), _read_people(path, list(enumerate(people))))]
    named: dict[Any, Any] = {}
    if isinstance(content, dict) and isinstance(content.get("annotations"), list):
        images = [image for image in content.get("images") or () if isinstance(image, dict)]
        named = {image.get("id"): image.get("file_name") for image in images}
        content = content["annotations"]
    if not isinstance(content, list) or not all(
        isinstance(one, dict) and "image_id" in one and _COCO in one for one in content
    ):
        raise UnreadableFile(
            f"holds no keypoints; expected OpenPose's people with {_OPENPOSE}, or "
            "annotations of COCO with image_id and keypoints",
            file=path.name,
        )
    lists: dict[Any, list[tuple[int, Any]]] = {key: [] for key in named}
    for index, one in enumerate(content):
        lists.setdefault(one["image_id"], []).append((index, one[_COCO]))
    return [
        (_number_of(named.get(key, key)), _read_people(path, own)) for key, own in lists.items()
    ]


def _number_of(name: Any) -> int | None:
    """The last whole number of an image's name."""
    if isinstance(name, int):
        return name
    found = re.findall(r"[0-9]+", Path(str(name)).name)
    return int(found[-1]) if found and len(found[-1]) < 18 else None


def _read_people(path: Path, lists: list[tuple[int, Any]]) -> list[_Person]:
    people = []
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
        people.append((points.reshape(-1, 3), Place(path, index)))
    return people


# ---- people, frames, points


def _count_points(seen: list[list[_Image]], source: str) -> int:
    sizes = {len(one) for images in seen for _, people in images for one, _ in people}
    if len(sizes) != 1:
        problem = "nobody is seen in any image; all lists of people are empty"
        if sizes:
            problem = f"people have {sorted(sizes)} points; keep one layout in a folder"
        raise InvalidInput(problem, file=source)
    return sizes.pop()


def _weight(points: Floats) -> float:
    """How well and how large a person is seen."""
    seen = points[points[:, 2] > 0]
    if not len(seen):
        return 0.0
    return float(seen[:, 2].clip(0, 1).sum() * np.linalg.norm(np.ptp(seen[:, :2], axis=0)))


def _choose(people: list[_Person], person: int | None) -> _Person | None:
    """The person in one image; None if it is not seen."""
    if person is None:
        return max(people, key=lambda one: _weight(one[0]), default=None)
    return people[person] if 0 <= person < len(people) else None


def _look_for_others(seen: list[list[_Image]], names: Sequence[str]) -> list[str]:
    """Notes on further people; refused where one is often nearly as well seen as the first."""
    notes = []
    for name, images in zip(names, seen, strict=True):
        ranked = [sorted((_weight(one) for one, _ in own), reverse=True) for _, own in images]
        often = sum(len(own) > 1 and own[1] > _RIVAL * own[0] for own in ranked)
        if often > _OFTEN * len(images):
            raise InvalidInput(
                f"sees two people in {often} of {len(images)} images; tell them apart "
                "first (Pose2Sim: personAssociation) and give that folder, or the number of "
                "the person in each list: --person 0",
                file=name,
            )
        several = sum(len(own) > 1 for own in ranked)
        seen_in = f"{name} sees several people in {several} of {len(images)} images"
        notes += [f"{seen_in}: the one that is seen best is taken"] if several else []
    return notes


def _align(numbers: list[list[int]]) -> tuple[list[list[int]], int, list[str]]:
    """Frames from 0 of each camera's images, the number of the first one, and notes."""
    first = min(min(own) for own in numbers if own)
    last = max(max(own) for own in numbers if own)
    # Numbers that are times, or that each camera counts for itself, do not join cameras.
    if last - first + 1 <= min(_MOST_FRAMES, 2 * max(map(len, numbers)) + 1):
        return [[n - first for n in own] for own in numbers], first, []
    note = "numbers of the cameras' images do not fit each other: images are joined in sequence"
    return [list(range(len(own))) for own in numbers], 0, [note]


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


# ---- writing again


def write_exchanged(views: Views, sources: Indices, folder: str | Path) -> int:
    """Write the files again, with points where others were; how many files changed.

    Only the numbers of exchanged points change; all else stays to the byte.

    Parameters
    ----------
    views : as read
    sources : array, shape (cameras, frames, points), the point that takes the place of each
    folder : to write into, with the same names of folders and files

    Raises
    ------
    UnwritableFile
        If the folder is the one that was read.
    """
    folder = check_path(folder, remedy="give a folder to write into")
    changes: dict[Path, dict[int, Indices]] = {}
    rest = np.arange(len(views.names))
    for camera, own in enumerate(views.places):
        for frame, place in enumerate(own):
            if place is not None and (sources[camera, frame] != rest).any():
                changes.setdefault(place.path, {})[place.number] = sources[camera, frame]
    for path, target in _targets(views, folder):
        if target.resolve() == path.resolve():
            raise UnwritableFile("holds the files that were read; give another folder", file=folder)
        content = read_bytes(path)
        if path in changes:
            content = _exchange(content.decode("utf-8"), changes[path], path.name).encode()
        with write_atomically(target) as beside:
            beside.write_bytes(content)
    return len(changes)


def _targets(views: Views, folder: Path) -> Iterator[tuple[Path, Path]]:
    """Every file of the cameras, those without people too, and where it goes."""
    for name, own in zip(views.cameras, views.places, strict=True):
        home = next((place.path.parent for place in own if place is not None), None)
        if home is not None and home.name == name:
            paths = (path for path in sorted(home.iterdir()) if path.suffix.lower() == ".json")
            yield from ((path, folder / name / path.name) for path in paths)
        elif home is not None:
            yield home / f"{name}.json", folder / f"{name}.json"


def _exchange(text: str, wanted: dict[int, Indices], source: str) -> str:
    """The text with numbers of points moved, each as it was written."""
    key = _OPENPOSE if f'"{_OPENPOSE}"' in text else _COCO
    lists = re.finditer(rf'"{key}"\s*:\s*\[([^\[\]]*)\]', text)
    # Names of points stand under the same key in COCO's categories.
    found = [match for match in lists if '"' not in match.group(1)]
    if max(wanted) >= len(found):
        raise UnreadableFile("has changed since it was read; read it again", file=source)
    pieces, at = [], 0
    for index in sorted(wanted):
        start, stop = found[index].span(1)
        words = list(re.finditer(r"[^\s,]+", text[start:stop]))
        moved = [word.group() for word in words]
        for point, other in enumerate(wanted[index].tolist()):
            for k in range(3):
                moved[3 * point + k] = words[3 * other + k].group()
        for word, new in zip(words, moved, strict=True):
            pieces += [text[at : start + word.start()], new]
            at = start + word.end()
    return "".join([*pieces, text[at:]])
