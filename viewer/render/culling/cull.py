"""Frustum culling and level of detail: the cells in a camera's frustum, and for each as many layers as the picture can show.

Two levels: blocks of cells that follow each other along the Morton curve, then the cells of blocks that the frustum
touches; compiled loops (viewer.render.culling.cull_kernels) that write into arrays kept from frame to frame.  World frame: the
scan file's, float64; the result is handed to the GPU relative to the camera, in its view frame (x right, y down, z forward), so
that no large coordinate ever meets float32.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...grid.density_layers import part_extra
from .crowding import TILE, crowded, faces_of_blocks, scratch_of
from .cull_kernels import FoundCells, visible_cells
from .culled_grid import BlockedCells, FrustumArrays
from .layer_runs import CellLayers, RunLists, list_runs

if TYPE_CHECKING:
    from ...grid.scene import Scene
    from ...picture.camera import Camera

BLOCK = 64
"""Cells in a block of the upper level.  16 to 256 take 18 to 20 us for the 689 cells of studio.laz, eight views; not measured
where there are many more."""
_MARGIN = 1.0  # pixels: covers float32 rounding and the rounded pixel of the published program


@dataclass(frozen=True)
class DrawList:
    """first (R,) int64, count (R,) int64, slot (R,) int32: runs of points and the row of ``cell_view`` of their cell,
    by ascending first.  cell_view (V, 4) float32: view position of each visible cell's first step centre, w the
    box of its points: six sixteenths (viewer.grid.cell_boxes), first x, y, z and last x, y, z, four bits each from the lowest.
    axes (3, 3) float32: view rotation times the step.  cells: rows of the scene's cells (V,) int32, ascending.
    points: how many are drawn.  The arrays belong to the Culler and are valid until its next ``select``."""

    first: np.ndarray
    count: np.ndarray
    slot: np.ndarray
    cell_view: np.ndarray
    axes: np.ndarray
    cells: np.ndarray
    points: int


def frustum_arrays(camera: "Camera", scene: "Scene") -> FrustumArrays:
    """The frustum that cells of a scene are culled against, _MARGIN wider than the camera's."""
    rotation = np.ascontiguousarray(camera.view_rotation)
    left, right = camera.cx + _MARGIN, camera.width - camera.cx + _MARGIN
    top, bottom = camera.cy + _MARGIN, camera.height - camera.cy + _MARGIN
    planes = np.array([(camera.fx, 0, left), (-camera.fx, 0, right), (0, camera.fy, top), (0, -camera.fy, bottom), (0, 0, 1)])
    if camera.orthographic is not None:  # the sides are parallel to the line of sight
        planes[:4, 2] = 0.0
    return FrustumArrays(
        scene.origin - camera.position, rotation, lens=np.array([camera.fx, camera.fy, left, right, top, bottom]),
        parallel=float(camera.orthographic or 0.0), sides=np.abs(planes @ rotation),
        corner=rotation @ np.full(3, 0.5 * (scene.step - scene.cell_size)))  # fmt: skip


class Culler:
    """Selects cells and layers.  Holds data derived from the scene, and the arrays that it writes into.

    block: cells in a block.  share: (B,) float64, which share of the points wanted of each block was drawn last with a level of
    detail; (0,) where the scene has no coverage.
    """

    def __init__(self, scene: "Scene", *, block: int = BLOCK):
        self.scene = scene
        cells, coords = len(scene.cell_coords), np.ascontiguousarray(scene.cell_coords, np.int32)
        starts = np.arange(0, cells, block)
        low = np.minimum.reduceat(coords, starts).astype(np.float64)
        high = np.maximum.reduceat(coords, starts).astype(np.float64)
        self._grid = BlockedCells(
            coords, float(scene.cell_size), np.hstack([(low + high + 1) / 2, (high - low + 1) / 2]), block,
            faces=np.zeros((0, 3), np.uint8) if scene.faces is None else np.ascontiguousarray(scene.faces),
            boxes=np.zeros((0, 6), np.uint8) if scene.boxes is None else np.ascontiguousarray(scene.boxes))  # fmt: skip
        self._layers = CellLayers(np.asarray(scene.offsets, np.int64), scene.layers, cells, part_extra(scene.parts))
        self._found = FoundCells(np.empty(cells, np.int32), np.empty((cells, 4), np.float32), np.empty(cells))
        self._faces = np.empty((len(starts) if len(self._grid.faces) else 0, 3))
        faces_of_blocks(self._grid.faces, block, self._faces)
        self._crowding, self.share = scratch_of(len(self._faces)), np.ones(len(self._faces))
        self._tiles = np.empty((0, 0))
        self._scratch = np.empty(cells, np.int64), np.empty(cells, np.int32)
        self._reserve(0)
        self._run(0, 0.0)  # loads the compiled loops now, not in the first frame

    def _reserve(self, runs: int) -> None:
        """Makes the lists long enough for ``runs`` runs."""
        size = 1 << max(runs - 1, 1023).bit_length()
        self._runs = RunLists(np.empty(size, np.int64), np.empty(size, np.int64), np.empty(size, np.int32))

    def _run(self, visible: int, lod: float) -> tuple[int, int, int]:
        return list_runs(self._layers, self._found, visible, lod, self._scratch, self._runs)

    def visible(self, camera: "Camera", lod: float = 0.0) -> np.ndarray:
        """(V,) int32 rows of the cells that touch the frustum, ascending; valid until the next call.

        Conservative: a cell is left out only if the box of its points lies beyond one of the four sides, a pixel further
        out, or behind the camera.  lod: points wanted per pixel, stored for each cell; 0: all.  With it, cells so small in the
        picture that they stand for each other are left out, too (viewer.render.culling.cull_kernels.FEW).
        """
        frustum, share = frustum_arrays(camera, self.scene), self.share[:0]
        if lod > 0.0 and camera.orthographic is None and len(self._faces):
            tiles, share = (-(-camera.height // TILE), -(-camera.width // TILE)), self.share
            if self._tiles.shape != tiles:
                self._tiles = np.empty(tiles)
            crowded(self._grid, frustum, self._faces, self._tiles, self._crowding, share)
        return self._found.rows[: visible_cells(self._grid, frustum, lod, share, self._found)]

    def select(self, camera: "Camera", lod: float | None = None) -> DrawList:
        """The draw list of a camera.

        lod: points wanted per pixel that a cell's surfaces cover (its nearest corner decides); None draws all.  A cell gets the
        fewest layers that hold that many, and of the last of them the fewest parts (viewer.grid.density_layers).
        """
        wanted = 0.0 if lod is None else float(lod)
        cells = self.visible(camera, wanted)
        runs, points, room = self._run(len(cells), wanted)
        if room > len(self._runs.first):
            self._reserve(room)
            runs, points, _ = self._run(len(cells), wanted)
        return DrawList(
            first=self._runs.first[:runs],
            count=self._runs.size[:runs],
            slot=self._runs.slot[:runs],
            cell_view=self._found.cell_view[: len(cells)],
            axes=(camera.view_rotation * self.scene.step).astype(np.float32),
            cells=cells,
            points=points,
        )
