"""A walk tracked in views of four cameras: all passes, then with a library, then image by image.

Promised are 60 frames a second of one core with compiled kernels and 10 without. No kernel of it is
compiled: NumPy and SciPy's banded solver do it, so that both hold for the same code.
"""

import statistics
import time
from collections.abc import Callable

import numpy as np

import motionary as mo
from motionary.io.cameras import CalibratedCamera
from motionary.io.keypoints import Views
from motionary.motion import GENERIC_JOINTS
from motionary.multiview import ViewTracker, project
from motionary.samples import synthetic_motion

#: Promised frames a second.
COMPILED, NOT_COMPILED = 60, 10
N_FRAMES, RATE_HZ = 120, 60.0
_POINTS = {"Neck": "neck", "Nose": "head"} | {
    f"{side}{name}": f"{side.lower()}{name.lower()}"
    for side in "LR"
    for name in ("Shoulder", "Elbow", "Wrist", "Hip", "Knee", "Ankle")
}


def main() -> None:
    cameras = ring()
    walk = synthetic_motion("walk", seed=1, rate_hz=RATE_HZ)
    views = film(walk.generic_positions(), cameras)
    library = mo.learn({"walk": [walk.cut(0, 70), walk.cut(20, 90)]})
    n = views.n_frames

    def live() -> None:
        tracker = ViewTracker(cameras, views.names, rate_hz=RATE_HZ)
        for frame in range(n):
            tracker.track(views.pixels[:, frame], views.scores[:, frame])

    ways: dict[str, Callable[[], object]] = {
        "all passes": lambda: mo.track(views, cameras, rate_hz=RATE_HZ),
        "all passes, library": lambda: mo.track(views, cameras, rate_hz=RATE_HZ, library=library),
        "image by image": live,
    }
    print(f"{n} frames of four cameras; promised {COMPILED} a second, not compiled {NOT_COMPILED}")
    for name, call in ways.items():
        print(f"  {name:22s} {n / core_seconds(call):6.0f} frames a second of one core")


def core_seconds(call: Callable[[], object], *, runs: int = 3) -> float:
    """Median of a core's time: the promise is for each core, however busy it is."""
    call()
    seconds = []
    for _ in range(runs):
        start = time.process_time()
        call()
        seconds.append(time.process_time() - start)
    return statistics.median(seconds)


def ring() -> list[CalibratedCamera]:
    """Four cameras around the origin, y up."""
    matrix = np.array([[1200.0, 0, 960], [0, 1200, 540], [0, 0, 1]])
    cameras = []
    for number in range(4):
        angle = 0.3 + 1.6 * number
        place = np.array([5 * np.cos(angle), 1.2 + 0.3 * number, 5 * np.sin(angle)])
        ahead = np.array([0, 0.9, 0]) - place
        ahead /= np.linalg.norm(ahead)
        right = np.cross(ahead, [0, 1.0, 0]) / np.linalg.norm(np.cross(ahead, [0, 1.0, 0]))
        turn = np.stack([right, np.cross(ahead, right), ahead])
        size = (1920.0, 1080.0)
        cameras.append(
            CalibratedCamera(f"cam{number}", matrix, turn, -turn @ place, np.zeros(5), size)
        )
    return cameras


def film(joints: np.ndarray, cameras: list[CalibratedCamera]) -> Views:
    """What the cameras see of joints that go to and fro, with noise, gaps and exchanged legs."""
    rng = np.random.default_rng(0)
    points = joints[:, [GENERIC_JOINTS.index(name) for name in _POINTS.values()]]
    points = points - [points[..., 0].mean(), 0, points[..., 2].mean()]
    points = np.tile(np.concatenate([points, points[::-1]]), (3, 1, 1))[:N_FRAMES]
    pixels = np.stack([project(camera, points) for camera in cameras])
    pixels += rng.normal(0, 4, pixels.shape)
    scores = rng.uniform(0.5, 1.0, pixels.shape[:3])
    scores[rng.uniform(size=scores.shape) < 0.1] = 0.0
    names = tuple(_POINTS)
    legs = [names.index(f"{s}{part}") for s in "LR" for part in ("Hip", "Knee", "Ankle")]
    pixels[1, 40:60][:, legs] = pixels[1, 40:60][:, legs[3:] + legs[:3]]
    return Views(tuple(one.name for one in cameras), names, pixels, scores)


if __name__ == "__main__":
    main()
