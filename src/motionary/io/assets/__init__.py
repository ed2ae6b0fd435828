"""Files that ship with the package: the body's mesh, with licence and origin beside it."""

from importlib.resources import files
from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray


def read_body(*, fine: bool = False) -> dict[str, NDArray[Any]]:
    """Arrays of the body that ships, by name; some 6000 vertices if `fine`, else 1200."""
    return _read("body", "body_fine.npz" if fine else "body.npz")


def read_poses() -> dict[str, NDArray[Any]]:
    """Arrays of the pose database that ships, by name."""
    return _read("poses", "poses.npz")


def _read(folder: str, name: str) -> dict[str, NDArray[Any]]:
    content = files("motionary.io.assets").joinpath(folder, name).read_bytes()
    with np.load(BytesIO(content), allow_pickle=False) as arrays:
        return {key: arrays[key] for key in arrays.files}
