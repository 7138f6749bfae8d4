"""A mesh beside the points: which file, where it stands, and how it is shown.

Frames: the mesh file's own coordinates, and the document's (the scan file's), float64.  ``matrix`` leads from the former to the
latter: first the axes are exchanged so that the mesh's up axis is z, then its coordinates are scaled to the scan's unit of
length, then it is turned and shifted.
"""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ...common.errors import InputError
from ...common.rigid_transform import IDENTITY, Rows, check_rigid
from ..json_values import UNLESS_DEFAULT

MESH_UP_AXES: dict[str, tuple[tuple[float, float, float], ...]] = {
    "z": ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    "y": ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0)),
    "x": ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)),
}
"""Name of the axis of the mesh's file that is up -> rows of the rotation that makes it z."""
MOST_MESHES = 32
"""In one picture; each is read and drawn by itself."""


@dataclass(frozen=True)
class MeshLayer:
    """One mesh file of a document.

    path: as opened; a project stores it relative to itself.  checksum: SHA-256 of the file and of those that it names, "" where
    it is not known.  transform: rigid, of the turned and scaled mesh.  up: a key of MESH_UP_AXES.  scale: units of the document
    in a unit of the file, above 0.  colour: sRGB 0 to 255; None: the file's own.  opacity: above 0, at most 1.
    unsure: uncertainty (95 %) of its place beside the scan, the document's units; None: not known.
    Raises InputError naming a bad value.
    """

    path: str
    checksum: str = field(default="", metadata=UNLESS_DEFAULT)
    transform: Rows = field(default=IDENTITY, metadata=UNLESS_DEFAULT)
    up: str = "z"
    scale: float = 1.0
    colour: tuple[int, int, int] | None = field(default=None, metadata=UNLESS_DEFAULT)
    opacity: float = field(default=1.0, metadata=UNLESS_DEFAULT)
    visible: bool = field(default=True, metadata=UNLESS_DEFAULT)
    unsure: float | None = field(default=None, metadata=UNLESS_DEFAULT)

    def __post_init__(self) -> None:
        check_rigid(self.transform, f"{self.path}: transform")
        if self.up not in MESH_UP_AXES:
            raise InputError(f"up axis {self.up!r}: expected one of {', '.join(MESH_UP_AXES)}", file=self.path)
        if self.unsure is not None and not 0 <= self.unsure < np.inf:
            raise InputError(f"unsure {self.unsure!r}: expected a length, 0 or more", file=self.path)
        if not 1e-9 <= self.scale <= 1e9:
            raise InputError(f"scale {self.scale!r}: expected a number from 1e-9 to 1e9", file=self.path)
        if not 0.0 < self.opacity <= 1.0:
            raise InputError(f"opacity {self.opacity!r}: expected a number above 0, at most 1", file=self.path)
        if self.colour is not None and not all(0 <= value <= 255 for value in self.colour):
            raise InputError(f"colour {self.colour!r}: expected three numbers from 0 to 255", file=self.path)

    @property
    def name(self) -> str:
        """The file's name, as lists show it."""
        return Path(self.path).name

    @property
    def matrix(self) -> np.ndarray:
        """(4, 4) float64: from the file's coordinates to the document's."""
        first = np.eye(4)
        first[:3, :3] = self.scale * np.array(MESH_UP_AXES[self.up])
        return np.array(self.transform, np.float64) @ first


def shown_meshes(meshes: tuple[MeshLayer, ...]) -> tuple[MeshLayer, ...]:
    """Those that a picture shows."""
    return tuple(layer for layer in meshes if layer.visible)
