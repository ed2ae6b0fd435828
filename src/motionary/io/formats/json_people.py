"""People in JSON of keypoints: whose points a frame holds, and where they are.

A frame is an object or a list: of points by name, of points, or of people. What is in two
dimensions is told from what is in three: by names, by points of two numbers, by a third number
that is none or a score, and by the hips of MediaPipe's landmarks.
"""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple, NoReturn

import numpy as np

from motionary.errors import NotAMotion, UnreadableFile
from motionary.files import most_unpacked
from motionary.io.formats.content import FARTHEST
from motionary.rotations import Floats

Points = dict[str | int, Any]

PEOPLE = ("people", "persons", "bodies", "instances", "skeletons", "subjects", "annotations")
_IDS = ("id", "body_id", "track_id", "person_id", "instance_id")
WORLD = ("pose_world_landmarks", "poseWorldLandmarks", "world_landmarks", "worldLandmarks")
POINTS = (
    *WORLD, "keypoints3d", "keypoints_3d", "joints3d", "joints_3d", "joint_positions",
    "positions", "joints", "keypoints", "landmarks", "landmark", "points", "markers",
)  # fmt: skip
FLAT = (
    "pose_landmarks", "poseLandmarks", "pose_keypoints_2d", "keypoints_2d", "keypoints2d",
    "joints2d", "joints_2d", "bbox",
)  # fmt: skip
# Third numbers that are scores: none beyond one, beside pixels.
_PIXELS = 20.0
_MOST_PEOPLE = 1000
MEDIAPIPE = 33
_MEDIAPIPE_HIPS = [23, 24]


class Person(NamedTuple):
    """Points of a person by frame, and under which name they stood."""

    frames: dict[int, Points]
    key: str


def find_people(frames: Sequence[Any]) -> dict[str, Person]:
    """People by what the file calls them, else by their number in a frame."""
    people: dict[str, Person] = {}
    for number, frame in enumerate(frames):
        for index, (who, key, points) in enumerate(_people_of(frame, "")):
            if points is None:
                refuse_flat()
            name = who or str(index + 1)
            person = people.setdefault(name, Person({}, key))
            person.frames.setdefault(number, points)
            if len(people) > _MOST_PEOPLE:
                raise UnreadableFile(
                    f"holds more than {_MOST_PEOPLE} people; are their ids those of a "
                    "frame? leave ids out, or save one file for each person"
                )
    if not people:
        raise NotAMotion(
            f"holds no motion; none of {len(frames)} frames has points with x, y and z"
        )
    return people


def _people_of(value: Any, key: str) -> Iterator[tuple[str, str, Points | None]]:
    """Name, key and points of each person of a frame; None for points of an image."""
    if isinstance(value, dict) and not _is_point(value):
        yield from _people_of_object(value, key)
    elif isinstance(value, list) and value:
        if any(_is_point(point) for point in value if point is not None):
            yield "", key, _number(value)
        elif all(is_number(number) for number in value):
            # One list of x, y and score after the other: what OpenPose and COCO write of images.
            yield "", key, None
        else:
            for person in value:
                yield from _people_of(person, key)


def _people_of_object(value: dict[str, Any], key: str) -> Iterator[tuple[str, str, Points | None]]:
    people = next((value[name] for name in PEOPLE if isinstance(value.get(name), list)), None)
    if people is not None:
        for person in people:
            who = _name_of(person)
            yield from (
                (who or own, inner, points) for own, inner, points in _people_of(person, key)
            )
        return
    place = next((name for name in POINTS if isinstance(value.get(name), dict | list)), None)
    named: Points = {name: point for name, point in value.items() if _is_point(point)}
    if place is not None:
        yield from _people_of(value[place], key if place == "landmark" else place)
    elif any(name in value for name in FLAT):
        yield "", key, None
    elif named:
        yield "", key, named


def _name_of(person: Any) -> str:
    if not isinstance(person, dict):
        return ""
    return next((str(person[name])[:40] for name in _IDS if name in person), "")


def _number(points: list[Any]) -> Points:
    """Points of a list by their names if they have any, else by their numbers."""
    named = [p["name"] for p in points if isinstance(p, dict) and isinstance(p.get("name"), str)]
    if len(set(named)) == len(points):
        return dict(zip(named, points, strict=True))
    return dict(enumerate(points))


def is_number(value: Any) -> bool:
    """Whether a value of JSON is a number."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def _is_point(value: Any) -> bool:
    if isinstance(value, dict):
        return {"x", "y"} <= value.keys() or _is_point(value.get("position"))
    return (
        isinstance(value, list)
        and 2 <= len(value) <= 4
        and all(number is None or is_number(number) for number in value)
    )


def _place(point: Any) -> tuple[float, float, float]:
    """Coordinates of a point, NaN where it was not seen."""
    if isinstance(point, dict):
        if "position" in point:
            return _place(point["position"])
        if "z" not in point:
            refuse_flat()
        point = [point.get(axis, "") for axis in "xyz"]
    if point is None:
        return (np.nan,) * 3
    if not isinstance(point, list) or not all(n is None or is_number(n) for n in point):
        raise UnreadableFile(f"expected a point [x, y, z], got {str(point)[:60]}")
    if len(point) < 3:
        refuse_flat()
    x, y, z = (np.nan if number is None else number for number in point[:3])
    # Whole numbers may have thousands of digits.
    return (
        (float(x), float(y), float(z)) if max(abs(x), abs(y), abs(z)) < FARTHEST else (np.nan,) * 3
    )


def fill_positions(person: Person, n_frames: int, size: int) -> tuple[list[str | int], Floats]:
    """Names or numbers of a person's points, and their places (frames, points, 3)."""
    columns: dict[str | int, int] = {}
    for points in person.frames.values():
        for key in points:
            columns.setdefault(key, len(columns))
    if 24 * n_frames * len(columns) > most_unpacked(size):
        raise UnreadableFile(f"has {len(columns)} names of points in {n_frames} frames")
    positions = np.full((n_frames, len(columns), 3), np.nan)
    for number, points in person.frames.items():
        for key, point in points.items():
            positions[number, columns[key]] = _place(point)
    positions[np.isnan(positions).any(axis=2)] = np.nan
    return list(columns), positions


# ---- two dimensions


def refuse_flat() -> NoReturn:
    """Say what to do about keypoints of an image."""
    raise NotAMotion(
        "holds keypoints of an image, in two dimensions, and features need places in "
        "space; lift them (MotionBERT, VideoPose3D, MMPose), or take a tracker's 3-D output: "
        "pose_world_landmarks of MediaPipe"
    )


def refuse_image(positions: Floats, key: str) -> None:
    """Refuse points whose third number is none, or a score, or MediaPipe's guess of a depth."""
    seen = positions[~np.isnan(positions).any(axis=2)]
    if len(seen) < 2 or positions.shape[1] < 2:
        return
    wide = float(np.ptp(seen[:, :2], axis=0).max())
    third = seen[:, 2]
    is_score = wide > _PIXELS and (third >= 0).all() and (third <= 1).all()
    if is_score or (wide > 0 and not np.ptp(third)):
        refuse_flat()
    if positions.shape[1] == MEDIAPIPE and key not in WORLD:
        hips = np.abs(positions[:, _MEDIAPIPE_HIPS, :2].mean(axis=1))
        inside = (seen[:, :2] > -0.5).all() and (seen[:, :2] < 1.5).all()
        # In the world the hips are the origin, in an image nobody stands in its corner.
        if inside and not np.nanmedian(hips.max(axis=1)) < 0.1:
            refuse_flat()
