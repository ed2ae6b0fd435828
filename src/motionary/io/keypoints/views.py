"""Keypoints of several cameras, and their files again with points of sides exchanged.

Points have one name in all layouts, those of BODY_25, and the middle of the hips is "Hip".
"""

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput, UnreadableFile, UnwritableFile, check_path
from motionary.files import read_bytes, write_atomically

Floats = NDArray[np.float64]

#: Keys of the lists of points in files of OpenPose, and of COCO and AlphaPose.
OPENPOSE, COCO = "pose_keypoints_2d", "keypoints"

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
    notes: tuple[str, ...] = field(default=())

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


def write_exchanged(views: Views, sources: NDArray[np.intp], folder: str | Path) -> int:
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
    changes: dict[Path, dict[int, NDArray[np.intp]]] = {}
    rest = np.arange(len(views.names))
    for camera, own in enumerate(views.places):
        for frame, place in enumerate(own):
            if place is not None:
                wanted = changes.setdefault(place.path, {})
                if (sources[camera, frame] != rest).any():
                    wanted[place.number] = sources[camera, frame]
    written = 0
    for path, wanted, target in _targets(views, changes, folder):
        if target.resolve() == path.resolve():
            raise UnwritableFile("holds the files that were read; give another folder", file=folder)
        content = read_bytes(path)
        if wanted:
            content = _exchange(content.decode("utf-8"), wanted, path.name).encode()
            written += 1
        with write_atomically(target) as beside:
            beside.write_bytes(content)
    return written


def _targets(
    views: Views, changes: dict[Path, dict[int, NDArray[np.intp]]], folder: Path
) -> list[tuple[Path, dict[int, NDArray[np.intp]], Path]]:
    """Every file of the cameras, those without people too: what changes, and where it goes."""
    result = []
    for name, own in zip(views.cameras, views.places, strict=True):
        home = next((place.path.parent for place in own if place is not None), None)
        if home is None:
            continue
        if home.name != name:
            path = home / f"{name}.json"
            result.append((path, changes.get(path, {}), folder / path.name))
            continue
        result += [
            (path, changes.get(path, {}), folder / name / path.name)
            for path in sorted(home.iterdir())
            if path.suffix.lower() == ".json"
        ]
    return result


def _exchange(text: str, wanted: dict[int, NDArray[np.intp]], source: str) -> str:
    """The text with numbers of points moved, each as it was written."""
    key = OPENPOSE if f'"{OPENPOSE}"' in text else COCO
    # Names of points stand under the same key in COCO's categories.
    found = [
        match
        for match in re.finditer(rf'"{key}"\s*:\s*\[([^\[\]]*)\]', text)
        if '"' not in match.group(1)
    ]
    pieces, at = [], 0
    for index in sorted(wanted):
        if index >= len(found):
            raise UnreadableFile("has changed since it was read; read it again", file=source)
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
