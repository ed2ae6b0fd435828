"""Windows of joint positions around each frame, of fixed length.

The features of Arikan, Forsyth and O'Brien (2003), who classify frames one by one:
positions around a frame, seen from the body at that frame.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evidence.baselines.frames import body_axes, body_size, to_body
from motionary.errors import InvalidInput
from motionary.features import SEQUENCE_HZ
from motionary.motion import GENERIC_JOINTS, Motion, resample

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Window:
    """How much around a frame is looked at.

    Attributes
    ----------
    length_s : from the first to the last pose
    poses : how many, evenly spread
    """

    length_s: float = 1.0
    poses: int = 7

    def __post_init__(self) -> None:
        if not self.length_s > 0 or self.poses < 1:
            raise InvalidInput(
                f"a window needs a length above 0 s and at least one pose, got {self}"
            )


def position_windows(motion: Motion, *, window: Window | None = None) -> Floats:
    """Places of the joints around each frame at 30 Hz, shape (frames, poses * 72).

    Origin, heading and size are those of the body at the frame itself; beyond the ends of
    the recording its first or last pose stands; joints that are not seen are 0, at the root.

    Raises
    ------
    InvalidInput
        If no frame shows what gives the size of the body.
    """
    chosen = window or Window()
    places = resample(motion.generic_positions(), rate_hz=motion.rate_hz, to_hz=SEQUENCE_HZ)
    half = chosen.length_s * SEQUENCE_HZ / 2
    offsets = np.rint(np.linspace(-half, half, chosen.poses)).astype(np.intp)
    around = np.clip(np.arange(len(places))[:, np.newaxis] + offsets, 0, len(places) - 1)
    seen = to_body(
        places[around],
        centre=places[:, GENERIC_JOINTS.index("root")],
        axes=body_axes(places, removed="heading"),
        size=body_size(places),
    )
    return np.nan_to_num(seen.reshape(len(places), -1), nan=0.0)
