"""Where do the joints of a tree lie, given quaternions for hours of frames?"""

import numpy as np
from numpy.typing import NDArray

from motionary.errors import UnreadableFile
from motionary.motion import Skeleton, forward_kinematics
from motionary.rotations import quaternions_to_matrices

Floats = NDArray[np.float64]

# Matrices of this many frames stay in the processor's cache, and memory stays flat.
BLOCK = 512

# No unit is so small that a person is this many of them away.
_FARTHEST = 1e9


def place_joints(
    skeleton: Skeleton,
    quaternions: Floats,
    root_positions: Floats,
    *,
    translations: dict[int, Floats],
    source: str,
) -> Floats:
    """Joint positions, shape (frames, joints, 3), metres.

    Parameters
    ----------
    skeleton : Skeleton
    quaternions : array, shape (frames, joints, 4), local rotations wxyz
    root_positions : array, shape (frames, 3), metres
    translations : per joint index, (frames, 3), metres, in place of the offset
    source : name of the file, for the error

    Raises
    ------
    UnreadableFile
        If numbers are so large that no body can be meant.
    """
    n_frames, n_joints = quaternions.shape[:2]
    positions = np.empty((n_frames, n_joints, 3))
    with np.errstate(all="ignore"):
        for start in range(0, n_frames, BLOCK):
            part = slice(start, start + BLOCK)
            positions[part] = forward_kinematics(
                skeleton,
                quaternions_to_matrices(quaternions[part]),
                root_positions[part],
                {joint: moved[part] for joint, moved in translations.items()},
            )
    possible = np.abs(positions).max(axis=(1, 2)) < _FARTHEST
    if not possible.all():
        frame = 1 + int(np.flatnonzero(~possible)[0])
        raise UnreadableFile(f"{source}: frame {frame} from the start has impossibly large numbers")
    return positions
