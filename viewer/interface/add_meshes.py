"""Meshes beside a scan, for Python."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..common.rigid_transform import rows_of
from ..picture.edits import NO_EDITS, Edits
from .arguments import PathLike, path_of, python_names

if TYPE_CHECKING:
    from ..grid.scene import Scene
    from ..picture.meshes.mesh_layer import MeshLayer


class BesideMeshes:
    """The part of :class:`Scan` that lays meshes beside the points."""

    _meshes: tuple[MeshLayer, ...]

    @property
    def _open(self) -> Scene:
        raise NotImplementedError

    @property
    def _edits(self) -> Edits:
        return replace(NO_EDITS, meshes=self._meshes) if self._meshes else NO_EDITS

    @property
    def meshes(self) -> tuple[str, ...]:
        """The mesh files beside the scan, as :meth:`remove_mesh` takes them."""
        return tuple(layer.path for layer in self._meshes)

    def add_mesh(
        self, path: PathLike, *, up: str | None = None, scale: float | None = None, colour: tuple[int, int, int] | None = None,
        opacity: float = 1.0, transform: npt.ArrayLike | None = None,
    ) -> str:  # fmt: skip
        """Lays a mesh beside the scan: pictures show it shaded where it is nearer than what the scan shows there.

        path: a glTF (.glb, .gltf), OBJ, STL or PLY file; of files that it names only those in its folder are read.
        up: axis of the file that is up: x, y or z; None: y of glTF, else z.  scale: units of the scan in a unit of the file;
        None: metres of glTF where the scan's unit is known, else 1.  colour: sRGB, 0 to 255, in place of the file's.
        opacity: above 0, at most 1.  transform: (4, 4) rigid, applied last, in the scan's coordinates.
        Returns the path as ``meshes`` has it.  Raises InputError, one line, where the file is no mesh or a value is bad.
        """
        from ..work.meshes.laid_meshes import new_layer

        with python_names():
            layer = new_layer(path_of(path), self._open.meta.metres_per_unit)
            given = {"up": up, "scale": scale, "transform": None if transform is None else rows_of(np.asarray(transform))}
            layer = replace(layer, colour=colour, opacity=opacity,
                            **{name: value for name, value in given.items() if value is not None})
            self._meshes = (*self._meshes, layer)
        return layer.path

    def remove_mesh(self, path: PathLike | None = None) -> None:
        """Takes a mesh away again; None: all of them."""
        self._meshes = () if path is None else tuple(
            layer for layer in self._meshes if layer.path != str(path_of(path).absolute()))
