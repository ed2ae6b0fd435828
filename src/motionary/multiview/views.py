"""Cameras and keypoints brought together: which is whose, in which unit, and when.

Rays of two cameras to one point meet. How far they miss each other, over pairs of cameras,
tells whether the calibration fits the images, and what would: another sequence of the cameras,
another resolution, images taken earlier or later.
"""

import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations, permutations
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.io.cameras import CalibratedCamera, read_cameras
from motionary.io.keypoints import Views, read_keypoints
from motionary.multiview.cameras import USUAL_FOCAL, Sight, see, triangulate
from motionary.recording import Recording

Floats = NDArray[np.float64]
_T = TypeVar("_T", bound=np.generic)

#: Units of calibrations in metres, and the length of an adult's thigh and shank that tells them.
UNITS = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 0.001}
_LEG_M, _LEAST_LEG_M, _MOST_LEG_M = 0.8, 0.45, 1.3
_SCALE_PX = 20.0
# Costs are from 0 to 1: half is rays that miss each other by 20 pixels.
_FITS, _BETTER, _NOTHING_TO_GAIN = 0.45, 0.75, 0.02
_RESOLUTIONS = (0.25, 1 / 3, 0.5, 2 / 3, 0.75, 4 / 3, 1.5, 2.0, 3.0, 4.0)
_MOST_CAMERAS_PERMUTED = 5
_FRAMES_TRIED = 150
# Points that tell most of it: far from each other, and fast.
_TRIED = ("Shoulder", "Elbow", "Wrist", "Hip", "Knee", "Ankle")
#: Images of one camera are looked for so much earlier or later.
MOST_OFFSET = 30


class FittedViews(NamedTuple):
    """Rays in metres, one camera for each view, at the same times.

    `unit_m` of the calibration; `offsets` (cameras,), by how many frames each camera's images
    were late, and are moved; `cameras` in the sequence of the views; `notes` for people.
    """

    sight: Sight
    unit_m: float
    offsets: NDArray[np.intp]
    cameras: tuple[CalibratedCamera, ...]
    notes: tuple[str, ...]

    def place_cameras(
        self, names: Sequence[str], upright: NDArray[np.float64]
    ) -> tuple[CalibratedCamera, ...]:
        """The cameras in metres under the names of their views, in the world turned upright."""
        return tuple(
            replace(
                one,
                name=name,
                rotation=one.rotation @ upright.T,
                translation=one.translation * self.unit_m,
            )
            for name, one in zip(names, self.cameras, strict=True)
        )


def open_views(
    keypoints: str | Path | Views,
    cameras: str | Path | Sequence[CalibratedCamera],
    *,
    rate_hz: float,
    unit: str | None = None,
    synchronise: bool = False,
) -> tuple[Views, FittedViews, Recording]:
    """Keypoints and cameras, read where they are files, their rays, and their recording."""
    if not 0 < rate_hz < np.inf:
        raise InvalidInput(f"rate_hz must be a positive number, got {rate_hz}")
    name = "keypoints"
    if not isinstance(keypoints, Views):
        name = Path(keypoints).resolve().name
        keypoints = read_keypoints(keypoints)
    if isinstance(cameras, str | Path):
        cameras = read_cameras(cameras)
    fitted = fit_views(keypoints, cameras, unit=unit, synchronise=synchronise)
    recording = Recording(
        name, rate_hz=rate_hz, n_frames=keypoints.n_frames, first_frame=keypoints.first_frame
    )
    return keypoints, fitted, recording


def fit_views(
    views: Views,
    cameras: Sequence[CalibratedCamera],
    *,
    unit: str | None = None,
    synchronise: bool = False,
) -> FittedViews:
    """The rays of all views, checked.

    Parameters
    ----------
    views : keypoints
    cameras : a calibration
    unit : one of `UNITS`; found by the length of the legs, if None
    synchronise : move images of cameras that are late or early, instead of refusing them

    Raises
    ------
    InvalidInput
        If cameras and images do not fit; says what would.
    """
    if unit is not None and unit not in UNITS:
        raise InvalidInput(f"unit: choose one of {', '.join(UNITS)}, got {unit!r}")
    cameras, notes = _match(views, cameras)
    sight = see(views, cameras)
    # Where rays meet at all does not depend on the unit.
    cost = _cost(sight)
    offsets = find_offsets(sight)
    if offsets.any():
        late = ", ".join(
            f"{name} {offset:+d}" for name, offset in zip(views.cameras, offsets, strict=True)
            if offset
        )  # fmt: skip
        if not synchronise:
            raise InvalidInput(
                f"the views fit better if images are moved: {late} frames late (+) or early (-) "
                "against the rest; --synchronise (synchronise=True) moves them, or start them "
                "together"
            )
        notes.append(f"images are moved: {late} frames late (+) or early (-)")
        sight = shift(sight, offsets)
        cost = _cost(sight)
    if cost > _FITS:
        raise InvalidInput(_explain_misses(views, cameras, cost))
    unit_m = UNITS[unit] if unit is not None else _find_unit(sight, notes)
    sight = sight._replace(origins=sight.origins * unit_m)
    return FittedViews(sight, unit_m, offsets, cameras, tuple(notes))


def _match(
    views: Views, cameras: Sequence[CalibratedCamera]
) -> tuple[tuple[CalibratedCamera, ...], list[str]]:
    """A camera for each view: by the numbers in their names, or else in sequence."""
    numbers = [
        [int(found.group()) if (found := re.search(r"[0-9]+", name)) else -1 for name in names]
        for names in (views.cameras, [one.name for one in cameras])
    ]
    if all(len(set(own)) == len(own) for own in numbers) and set(numbers[0]) <= set(numbers[1]):
        chosen = tuple(cameras[numbers[1].index(number)] for number in numbers[0])
        extra = len(cameras) - len(chosen)
        return chosen, [f"{extra} cameras of the calibration have no keypoints"] if extra else []
    notes = []
    if len(cameras) == len(views.cameras):
        pairs = zip(views.cameras, cameras, strict=True)
        notes.append("cameras in sequence: " + ", ".join(f"{v} is {c.name}" for v, c in pairs))
    return tuple(cameras), notes


def _some(sight: Sight) -> Sight:
    """Some points of consecutive frames in which most is seen."""
    own = [k for k, name in enumerate(sight.names) if name[1:] in _TRIED]
    if own:
        sight = sight.of_points(own)
    n_frames = sight.weights.shape[1]
    if n_frames <= _FRAMES_TRIED:
        return sight
    seen = np.convolve(sight.weights.sum(axis=(0, 2)), np.ones(_FRAMES_TRIED), "valid")
    first = int(seen.argmax())
    return sight.of_frames(slice(first, first + _FRAMES_TRIED))


def _pair_cost(one: Sight, a: int, other: Sight, b: int, offset: int = 0) -> float:
    """How far rays of camera a miss those of camera b so many frames later, 0 to 1."""
    n = one.weights.shape[1]
    first, last = max(0, -offset), min(n, n - offset)
    if last <= first:
        return 1.0
    n1, w1 = one.directions[a, first:last], one.weights[a, first:last]
    n2 = other.directions[b, first + offset : last + offset]
    w2 = other.weights[b, first + offset : last + offset]
    weights = w1 * w2
    if not weights.any():
        return np.nan
    base = other.origins[b] - one.origins[a]
    normal = np.cross(n1, n2)
    sine = np.linalg.norm(normal, axis=-1)
    far = np.abs(normal @ base) / np.maximum(sine, 1e-9)
    # Depths of the nearest points of both rays: distances in the image are those by depth.
    cosine = (n1 * n2).sum(axis=-1)
    along1, along2 = n1 @ base, n2 @ base
    square = np.maximum(sine**2, 1e-12)
    depth1 = (along1 - cosine * along2) / square
    depth2 = (cosine * along1 - along2) / square
    behind = (depth1 <= 0) | (depth2 <= 0)
    depth = np.maximum(np.minimum(depth1, depth2), 1e-9)
    pixels = np.where(behind, 1e6, far / depth * USUAL_FOCAL)
    cost = pixels**2 / (pixels**2 + _SCALE_PX**2)
    return float((weights * cost).sum() / weights.sum())


def _cost(sight: Sight) -> float:
    """Mean cost of all pairs of cameras."""
    some = _some(sight)
    pairs = combinations(range(len(sight.origins)), 2)
    costs = [_pair_cost(some, a, some, b) for a, b in pairs]
    known = [cost for cost in costs if not np.isnan(cost)]
    if not known:
        raise InvalidInput(
            "no point is seen by two cameras at once; do the files belong to one recording?"
        )
    return float(np.mean(known))


def find_offsets(sight: Sight) -> NDArray[np.intp]:
    """By how many frames each camera's images are late; the first camera that fits is not.

    A camera is taken for late only where that makes a plain difference.
    """
    some = _some(sight)
    n_cameras = len(sight.origins)
    most = min(MOST_OFFSET, some.weights.shape[1] // 3)
    steps = np.arange(-most, most + 1)
    together = np.zeros((n_cameras, n_cameras))
    for a, b in combinations(range(n_cameras), 2):
        together[a, b] = together[b, a] = np.nan_to_num(_pair_cost(some, a, some, b))
    if (together.sum(axis=1) <= _NOTHING_TO_GAIN * (n_cameras - 1)).all():
        return np.zeros(n_cameras, dtype=np.intp)
    costs = np.zeros((n_cameras, n_cameras, len(steps)))
    for a, b in combinations(range(n_cameras), 2):
        row = [_pair_cost(some, a, some, b, int(step)) for step in steps]
        costs[a, b], costs[b, a] = np.nan_to_num(row), np.nan_to_num(row)[::-1]
    offsets = np.zeros(n_cameras, dtype=np.intp)
    for _ in range(2 * n_cameras):
        # The camera that gains most by moving against all others moves.
        gains = []
        for camera in range(n_cameras):
            others = [other for other in range(n_cameras) if other != camera]
            total = np.sum([_moved(costs[o, camera], int(offsets[o])) for o in others], axis=0)
            now, best = total[most + offsets[camera]], int(total.argmin())
            fits = total[best] < _BETTER * now and now > _NOTHING_TO_GAIN * len(others)
            gains.append((now - total[best] if fits else 0.0, camera, best - most))
        gain, camera, offset = max(gains)
        if gain <= 0 or abs(offset) > most:
            break
        offsets[camera] = offset
    moved, counts = np.unique(offsets, return_counts=True)
    return np.asarray(offsets - moved[counts.argmax()])


def _moved(costs: Floats, offset: int) -> Floats:
    """Costs by offset against a camera that is late itself."""
    most = costs.max() if costs.size else 1.0
    moved: Floats = move_frames(costs[None], np.array([-offset]), empty=most)[0]
    return moved


def shift(sight: Sight, offsets: NDArray[np.intp]) -> Sight:
    """The sight with each camera's frames taken so many frames later."""
    return sight._replace(
        directions=move_frames(sight.directions, offsets),
        weights=move_frames(sight.weights, offsets),
    )


def move_frames(
    values: NDArray[_T], offsets: NDArray[np.intp], *, empty: float = 0.0
) -> NDArray[_T]:
    """Values (cameras, frames, ...) of each camera so many frames later; `empty` where none is."""
    result = np.full_like(values, empty)
    n = values.shape[1]
    for camera, offset in enumerate(offsets.tolist()):
        to = slice(max(0, -offset), n - max(0, offset))
        here = slice(max(0, offset), n - max(0, -offset))
        result[camera, to] = values[camera, here]
    return result


def _explain_misses(views: Views, cameras: Sequence[CalibratedCamera], cost: float) -> str:
    """What is wrong with cameras that do not fit: their sequence, the resolution, or all."""
    told = (
        f"the cameras do not fit the images: rays of two cameras to one point miss each other "
        f"(cost {cost:.2f}, at most {_FITS} is usual)"
    )
    enough = min(_FITS, _BETTER * cost)
    if len(cameras) <= _MOST_CAMERAS_PERMUTED:
        orders = permutations(range(len(cameras)))
        least, best = min((_try(views, cameras, own), own) for own in orders)
        if least < enough:
            right = ", ".join(
                f"{view} by {cameras[k].name}" for view, k in zip(views.cameras, best, strict=True)
            )
            return f"{told}; they fit in another sequence: {right}; rename folders or cameras"
    every = range(len(cameras))
    least, factor = min((_try(views, cameras, every, own), own) for own in _RESOLUTIONS)
    if least < enough:
        return (
            f"{told}; they fit if pixels are multiplied by {factor:.3g}: keypoints and calibration "
            "are of images of different resolution; scale the keypoints or calibrate anew"
        )
    return f"{told}; is it the calibration of this recording?"


def _try(
    views: Views, cameras: Sequence[CalibratedCamera], order: Sequence[int], factor: float = 1.0
) -> float:
    """The cost of other cameras for the views, or of pixels times a factor."""
    every = slice(None, None, max(1, views.n_frames // 40))
    scaled = replace(
        views, pixels=views.pixels[:, every] * factor, scores=views.scores[:, every], places=()
    )
    try:
        return _cost(see(scaled, [cameras[k] for k in order]))
    except InvalidInput:
        return 1.0


def _find_unit(sight: Sight, notes: list[str]) -> float:
    """The unit in metres by which thigh and shank have a person's length."""
    sight = _some(sight)
    points = triangulate(sight).points
    lengths = []
    for side in "LR":
        names = [f"{side}{part}" for part in ("Hip", "Knee", "Ankle")]
        if all(name in sight.names for name in names):
            hip, knee, ankle = (points[:, sight.names.index(name)] for name in names)
            both = np.linalg.norm(hip - knee, axis=1) + np.linalg.norm(knee - ankle, axis=1)
            lengths.append(both[~np.isnan(both)])
    seen = np.concatenate(lengths) if lengths else np.zeros(0)
    if not len(seen):
        notes.append("no leg is seen whole: the calibration's unit is taken for metres")
        return 1.0
    leg = float(np.median(seen))
    name = min(UNITS, key=lambda one: abs(np.log(leg * UNITS[one] / _LEG_M)))
    if not _LEAST_LEG_M <= leg * UNITS[name] <= _MOST_LEG_M:
        raise InvalidInput(
            f"a leg from hip to ankle is {leg:.3g} long in the calibration's unit, which fits none "
            f"of {', '.join(UNITS)}; name the unit (--unit), or calibrate with the right length "
            "of the board"
        )
    notes.append(f"unit of the calibration: {name} (a leg is {leg * UNITS[name]:.2f} m)")
    return UNITS[name]
