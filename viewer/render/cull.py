"""What a camera needs of a scene: the cells in its frustum, as many layers of each as the picture can show.

Everything is an array operation over cells.  World frame: the scan file's, float64; the result is handed to the GPU
relative to the camera, in its view frame (x right, y down, z forward), so that no large coordinate ever meets float32.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from viewer.camera import Camera
    from viewer.cloud.scene import Scene

_MARGIN = 1.0  # pixels: covers float32 rounding and the rounded pixel of the published program


@dataclass(frozen=True)
class DrawList:
    """first (R,) int64, count (R,) int64, slot (R,) int64: runs of points and the row of ``cell_view`` of their cell,
    by ascending first.  cell_view (V, 4) float32: view position of each visible cell's first step centre, w unused.
    axes (3, 3) float32: view rotation times the step.  cells: rows of the scene's cells (V,)."""

    first: np.ndarray
    count: np.ndarray
    slot: np.ndarray
    cell_view: np.ndarray
    axes: np.ndarray
    cells: np.ndarray

    @property
    def points(self) -> int:
        """How many points are drawn."""
        return int(self.count.sum())


class Culler:
    """Selects cells and layers.  Holds only what depends on the scene."""

    def __init__(self, scene: "Scene"):
        self.scene = scene
        cells, layers = len(scene.cell_coords), scene.layers
        counts = np.diff(scene.offsets).reshape(layers, cells)
        self._cumulative = np.cumsum(counts, axis=0)  # (L, C): points of layers 0..k
        self._coords = np.asarray(scene.cell_coords, np.float64)
        self._starts = np.asarray(scene.offsets[:-1]).reshape(layers, cells)
        self._counts = counts

    def visible(self, camera: "Camera") -> tuple[np.ndarray, np.ndarray]:
        """Rows of the cells that touch the frustum, and the view position of their centres (V, 3) float64.

        Conservative: a cell is left out only if all of it lies beyond one of the four sides, a pixel further out, or
        behind the camera.
        """
        size = self.scene.cell_size
        rotation = camera.view_rotation
        centres = (self._coords + 0.5) * size + (self.scene.origin - camera.position)
        view = centres @ rotation.T
        left, right = camera.cx + _MARGIN, camera.width - camera.cx + _MARGIN
        top, bottom = camera.cy + _MARGIN, camera.height - camera.cy + _MARGIN
        planes = np.array(
            [(camera.fx, 0, left), (-camera.fx, 0, right), (0, camera.fy, top), (0, -camera.fy, bottom), (0, 0, 1)]
        )
        reach = np.abs(planes @ rotation).sum(axis=1) * (0.5 * size * (1 + 1e-9))
        inside = ((view @ planes.T) + reach >= 0).all(axis=1)
        rows = np.nonzero(inside)[0]
        return rows, view[rows]

    def select(self, camera: "Camera", lod: float | None = None) -> DrawList:
        """The draw list of a camera.

        lod: points wanted per pixel a cell covers (its nearest corner decides); None draws all.  A cell gets the
        fewest layers that hold that many.
        """
        scene = self.scene
        rows, view = self.visible(camera)
        counts = self._counts[:, rows]
        if lod is not None:
            reach = 0.5 * scene.cell_size * np.abs(camera.view_rotation[2]).sum()
            nearest = np.maximum(view[:, 2] - reach, 1e-9 * scene.cell_size)
            area = (scene.cell_size * camera.fx / nearest) * (scene.cell_size * camera.fy / nearest)
            held = self._cumulative[:, rows]
            enough = np.vstack([np.zeros((1, len(rows)), bool), held[:-1] >= lod * area])
            counts = np.where(enough, 0, counts)
        layer, slot = np.nonzero(counts)
        step = scene.cell_size / 65536.0
        cell_view = np.zeros((len(rows), 4), np.float32)
        corner = 0.5 * (step - scene.cell_size)
        cell_view[:, :3] = view + camera.view_rotation @ np.full(3, corner)
        return DrawList(
            first=self._starts[layer, rows[slot]],
            count=counts[layer, slot],
            slot=slot,
            cell_view=cell_view,
            axes=(camera.view_rotation * step).astype(np.float32),
            cells=rows,
        )


def split_runs(first: np.ndarray, count: np.ndarray, size: int, *, aligned: bool) -> tuple[np.ndarray, ...]:
    """Cuts runs into pieces of at most ``size`` points.

    aligned: cut at multiples of ``size`` instead of counting from each run's start.  Returns (first, count, run): int64
    arrays, ``run`` the row of the run each piece is from, in order.
    """
    lead = first % size if aligned else np.zeros_like(first)
    pieces = (lead + count + size - 1) // size
    run = np.repeat(np.arange(len(first)), pieces)
    number = np.arange(len(run)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    offset = np.maximum(number * size - lead[run], 0)
    end = np.minimum((number + 1) * size - lead[run], count[run])
    return first[run] + offset, end - offset, run
