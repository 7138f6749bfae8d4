"""Points of a slab as an orthographic picture to scale.

Each point is a disc as wide as the spacing of the points around it, so that surfaces close at scales finer than the spacing;
of overlapping discs those near the foremost surface are averaged, weighted towards their centres.  Nothing is filled where no
disc lies, and no network runs.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ...common.errors import InputError
from ...picture.camera import MAX_SIDE
from ...picture.clip import Slab, vector
from ...work.selection import Block, Selection
from .cut import Cut

if TYPE_CHECKING:
    from ...grid.scene import Scene

CLOSES = 1.2
"""Radius of a disc in point spacings: discs at random places, one per spacing squared, leave exp(-pi * 1.2**2) = 1 % open."""
WIDEST = 24.0
"""Pixels: the largest radius.  At a scale so fine, points are seen apart."""
SPREAD = 2.0
"""A cell's own spacing is used up to so many times the scan's, or less than it."""
TOLERANCE = 2.0
"""Point spacings behind the foremost one that still count as the same surface."""
BORDER = 36
"""Pixels around the points: 3 mm at 300 dpi, and wider than the widest disc."""
MOST_PIXELS = 120_000_000
"""Of a drawing; 5 GB of depths and sums while it is made."""


@dataclass(frozen=True, eq=False)
class Drawing:
    """image: (H, W, 4) uint8, alpha 0 where no point lies, else 255.  left, top: paper coordinates of its top left corner, file
    units; a pixel is ``pixel`` file units wide.  count: points of the slab."""

    image: np.ndarray
    left: float
    top: float
    pixel: float
    count: int
    cut: Cut

    def pixel_of(self, paper: np.ndarray) -> np.ndarray:
        """(n, 2) float64: column and row of (n, 2 or 3) paper coordinates."""
        paper = np.asarray(paper, np.float64)
        return np.stack([(paper[:, 0] - self.left) / self.pixel, (self.top - paper[:, 1]) / self.pixel], axis=1)


Extent = tuple[np.ndarray, np.ndarray, int]
"""Lowest and highest paper coordinates and depth of points, (3,) each, and how many there are."""


def slab_extent(selection: Selection, cut: Cut) -> Extent:
    """Of the points of a selection that lie in a cut.  Raises InputError where there is none."""
    return _Points(selection, cut).extent()


def slab_points(selection: Selection, cut: Cut) -> np.ndarray:
    """(n, 2) float64: paper coordinates of the points of a selection that lie in a cut; 16 bytes a point."""
    parts = [paper[:, :2].copy() for _, _, paper in _Points(selection, cut).blocks("collecting the slab")]
    return np.concatenate(parts) if parts else np.empty((0, 2))


def draw(selection: Selection, cut: Cut, pixel: float, extent: Extent | None = None, *, picture: bool = True) -> Drawing:
    """The points of a selection that lie in a cut.

    pixel: file units.  extent: of :func:`slab_extent`, where it is known.  picture: False leaves the drawing empty.  In an
    elevation, points whose colour is missing (viewer.preprocess.point_colour) hide what lies behind them and stay empty: they
    are no black wall.  Raises InputError where there is no point, or the drawing would be larger than MAX_SIDE or MOST_PIXELS.
    """
    from . import splat_kernels

    points = _Points(selection, cut)
    low, high, count = extent or points.extent()
    border = BORDER * pixel
    left, top = np.floor((low[0] - border) / pixel) * pixel, np.ceil((high[1] + border) / pixel) * pixel
    width, height = int((high[0] + border - left) / pixel) + 1, int((top - low[1] + border) / pixel) + 1
    if max(width, height) > MAX_SIDE or width * height > MOST_PIXELS:
        raise InputError(f"the drawing would be {width:,}x{height:,} pixels; at most {MAX_SIDE:,} a side and {MOST_PIXELS:,} "
                         "in all can be drawn", remedy="choose a smaller scale (such as 1:200), fewer --dpi or a shorter line")
    if not picture:
        return Drawing(np.zeros((height, width, 4), np.uint8), float(left), float(top), pixel, count, cut)
    colourless = cut.kind == "elevation" and selection.scene.unlit
    nearest = np.full((height, width), np.inf)
    for columns, rows, depths, radii, _, _ in points.discs(left, top, pixel, "drawing depth"):
        splat_kernels.nearest_depths(nearest, columns, rows, depths, radii)
    sums = np.zeros((height, width, 4), np.int64)
    for columns, rows, depths, radii, tolerances, colours in points.discs(left, top, pixel, "drawing colour"):
        if colourless and len(known := np.flatnonzero(colours.any(axis=1))) < len(colours):
            columns, rows, depths, radii, tolerances, colours = (each[known] for each in (columns, rows, depths, radii,
                                                                                          tolerances, colours))
        splat_kernels.add_colours(sums, nearest, columns, rows, depths, radii, tolerances, colours)
    weight = sums[..., 3:]
    image = np.zeros((height, width, 4), np.uint8)
    image[..., :3] = (sums[..., :3] + weight // 2) // np.maximum(weight, 1)
    image[..., 3] = np.where(weight[..., 0] > 0, 255, 0)
    return Drawing(image, float(left), float(top), pixel, count, cut)


class _Points:
    """The points of a cut, block by block, with the spacing around each."""

    def __init__(self, selection: Selection, cut: Cut):
        self._cut = cut
        self._selection = replace(selection, within=(*selection.within, *_around(cut)))
        self._spacings = CellSpacings(selection.scene)

    def blocks(self, label: str) -> Iterator[tuple[Block, np.ndarray, np.ndarray]]:
        """Each block, which of its points (n,) bool belong to the cut, and these in paper coordinates."""
        for block in self._selection.blocks(label):
            paper = self._cut.paper(block.xyz)
            kept = self._cut.contains(paper)
            if kept.any():
                yield block, kept, paper[kept]

    def extent(self) -> Extent:
        """Raises InputError where there is no point."""
        low, high, count = np.full(3, np.inf), np.full(3, -np.inf), 0
        for _, _, paper in self.blocks("finding the slab"):
            low, high = np.minimum(low, paper.min(axis=0)), np.maximum(high, paper.max(axis=0))
            count += len(paper)
        if not count:
            bounds = self._selection.scene.bounds
            corners = [",".join(f"{value:.3f}" for value in corner) for corner in bounds]
            raise InputError(f"the {self._cut.kind} {self._cut.text} holds no point; the scan lies between {corners[0]} and "
                             f"{corners[1]} (file coordinates)")
        return low, high, count

    def discs(self, left: float, top: float, pixel: float, label: str) -> Iterator[tuple[np.ndarray, ...]]:
        """columns, rows, depths, radii (pixels), tolerances (n,) float64 and colours (n, 3) uint8 of each block."""
        for block, kept, paper in self.blocks(label):
            spacing = self._spacings.at(block.xyz[kept])
            radii = np.clip(CLOSES * spacing / pixel, 0.0, WIDEST)
            columns, rows = (paper[:, 0] - left) / pixel, (top - paper[:, 1]) / pixel
            yield columns, rows, paper[:, 2].copy(), radii, TOLERANCE * spacing, np.ascontiguousarray(block.rgb[kept])


def _around(cut: Cut) -> tuple[Slab, ...]:
    """A slab a little thicker than the cut, by which cells are skipped; none where the cut has no two planes."""
    if not np.isfinite([cut.near, cut.far]).all():
        return ()
    middle = np.array(cut.origin) + (cut.near + cut.far) / 2 * np.array(cut.forward)
    reach = float(np.abs(middle).max())
    return (Slab(vector(middle), cut.forward, (cut.far - cut.near) * (1 + 1e-6) + 1e-9 * reach),)


class CellSpacings:
    """The point spacing of each cell of a grid: the square root of the surface in it over its points.

    The surface is that of a plane whose shadows along x, y and z are the cell's covered shares (Scene.faces).
    """

    def __init__(self, scene: "Scene"):
        coords = np.asarray(scene.cell_coords, np.int64)
        cells = len(coords)
        counts = np.diff(np.asarray(scene.offsets)).reshape(scene.layers, cells).sum(axis=0)
        shares = np.full((cells, 3), 255.0) if scene.faces is None else np.asarray(scene.faces, np.float64)
        area = np.clip(np.linalg.norm(shares / 255.0, axis=1), 1 / 256, np.sqrt(3.0)) * scene.cell_size**2
        usual = scene.spacing or scene.cell_size / 16
        spacing = np.clip(np.sqrt(area / np.maximum(counts, 1)), usual / SPREAD, usual * SPREAD)
        self._low, self._shape = coords.min(axis=0), np.ptp(coords, axis=0) + 1
        keys = self._key(coords)
        order = np.argsort(keys)
        self._keys, self._spacing = keys[order], spacing[order]
        self._origin, self._size = scene.origin, scene.cell_size

    def _key(self, coords: np.ndarray) -> np.ndarray:
        x, y, z = (coords - self._low).T
        return (x * self._shape[1] + y) * self._shape[2] + z

    def at(self, xyz: np.ndarray) -> np.ndarray:
        """(n,) float64 file units, around points (n, 3) of the grid."""
        keys = self._key(np.floor((xyz - self._origin) / self._size).astype(np.int64))
        return self._spacing[np.minimum(np.searchsorted(self._keys, keys), len(self._keys) - 1)]
