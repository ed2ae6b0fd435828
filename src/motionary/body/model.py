"""A body: a skinned mesh of a person, its joints, and how its shape may vary.

Conventions: metres, y up, facing +z, its left side at +x. At rest the arms hang at 45 degrees.
Joints lie where their bone starts; parents come before children.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.io.assets import read_body

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

#: Ends of the body that have no joint, in the sequence of `Body.ends`.
ENDS = ("headtop", "lfingers", "rfingers", "ltoes", "rtoes")
#: Beyond these a shape is no person's: the directions are linear and add up.
MOST_SHAPE = {"gender": 1.0, "muscle": 1.0, "weight": 1.0, "height": 0.6, "age": 1.0}


class Points(NamedTuple):
    """Points that move with bones: what skinning and its derivatives need of each.

    `rest` (points, 3) in metres, `bones` and `weights` (points, influences), `shapes`
    (directions, points, 3).
    """

    rest: Floats
    bones: Indices
    weights: Floats
    shapes: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """A skinned mesh at rest; equal to itself only, as arrays have no one equality.

    Attributes
    ----------
    names, parents : of the joints; the parent's index, -1 for the root
    joints : array, shape (joints, 3), metres
    surface : the vertices
    faces : array, shape (triangles, 3), counter-clockwise seen from outside
    shape_names : of the directions in which the shape may vary
    joint_shapes : array, shape (directions, joints, 3), what one of each does to the joints
    ends : vertices of `ENDS`
    """

    names: tuple[str, ...]
    parents: Indices
    joints: Floats
    surface: Points
    faces: Indices
    shape_names: tuple[str, ...]
    joint_shapes: Floats
    ends: Indices

    def __post_init__(self) -> None:
        n, n_vertices = len(self.names), len(self.surface.rest)
        if self.parents[0] != -1 or not np.all(
            (self.parents[1:] >= 0) & (self.parents[1:] < np.arange(1, n))
        ):
            raise InvalidInput(
                "joints of a body need one root, first, and parents before children, got parents "
                f"{self.parents.tolist()}; a cycle or a second root is none"
            )
        if self.joints.shape != (n, 3) or not np.isfinite(self.joints).all():
            raise InvalidInput(
                f"{n} joints need finite places ({n}, 3), got {self.joints.shape}"
                + (" with NaN" if np.isnan(self.joints).any() else "")
            )
        sums = self.surface.weights.sum(axis=1)
        if not np.all(np.abs(sums - 1) <= 1e-6):
            worst = int(np.argmax(np.abs(sums - 1)))
            raise InvalidInput(
                f"weights of each vertex must sum to 1, those of vertex {worst} sum to "
                f"{sums[worst]:.6g}; divide them by their sum"
            )
        for what, index, most in (
            ("bones", self.surface.bones, n),
            ("faces", self.faces, n_vertices),
        ):
            if index.size and not 0 <= index.min() <= index.max() < most:
                raise InvalidInput(
                    f"{what} must be between 0 and {most - 1}, got {index.min()} to {index.max()}"
                )

    def __repr__(self) -> str:
        return f"Body({len(self.surface.rest)} vertices, {len(self.names)} joints)"

    @property
    def vertices(self) -> Floats:
        """Places of the vertices at rest, shape (vertices, 3)."""
        return self.surface.rest

    def index(self, joint: str) -> int:
        """Index of a joint by its name."""
        if joint not in self.names:
            raise InvalidInput(f"the body has no joint {joint!r}; it has {', '.join(self.names)}")
        return self.names.index(joint)

    def shaped(self, shape: Mapping[str, float]) -> "Body":
        """The body with another shape, told from the mean adult, such as {"height": 0.3}."""
        for name, amount in shape.items():
            if name not in self.shape_names:
                raise InvalidInput(
                    f"the body has no shape {name!r}; it has {', '.join(self.shape_names)}"
                )
            if not abs(amount) <= MOST_SHAPE.get(name, 1.0):
                raise InvalidInput(
                    f"{name} must be within ±{MOST_SHAPE.get(name, 1.0):g}, got {amount:g}: beyond "
                    "that nobody is built like it"
                )
        amounts = np.array([shape.get(name, 0.0) for name in self.shape_names])
        return replace(
            self,
            joints=self.joints + np.tensordot(amounts, self.joint_shapes, 1),
            surface=self.surface._replace(
                rest=self.surface.rest + np.tensordot(amounts, self.surface.shapes, 1)
            ),
        )

    def points(self, vertices: Indices | None = None) -> Points:
        """Some vertices, or all of them, as points."""
        if vertices is None:
            return self.surface
        rest, bones, weights, shapes = self.surface
        return Points(rest[vertices], bones[vertices], weights[vertices], shapes[:, vertices])

    def joint_points(self) -> Points:
        """The joints as points: each moves with the bone of its parent."""
        bones = np.maximum(self.parents, 0)[:, None]
        return Points(self.joints, bones, np.ones((len(bones), 1)), self.joint_shapes)


def load_body(*, fine: bool = False) -> Body:
    """The body that ships, a mean adult of 1.66 m; some 6000 vertices if `fine`, else 1200."""
    arrays = read_body(fine=fine)
    return Body(
        names=tuple(map(str, arrays["names"])),
        parents=arrays["parents"].astype(np.intp),
        joints=arrays["joints"],
        surface=Points(
            arrays["vertices"].astype(np.float64),
            arrays["bones"].astype(np.intp),
            arrays["weights"],
            arrays["shapes"].astype(np.float64),
        ),
        faces=arrays["faces"].astype(np.intp),
        shape_names=tuple(map(str, arrays["shape_names"])),
        joint_shapes=arrays["joint_shapes"],
        ends=arrays["ends"].astype(np.intp),
    )
