"""Picking: the nearest *measured* point around a position in the picture, as the grid has it; and its values in the file.

The frame's depth and keep-mask name the pixel: the one nearest to the pointer that holds points which the filter kept, never a
filled pixel or one of background.  The point is then found among the scene's packed points whose projection lies in that pixel
at that depth.  Packed coordinates are at most half a step (a 131,072nd of a cell) off along each axis and attributes have 16
bits; ``exactly`` reads those of the file.
Frame: positions in file coordinates, float64; pixels as in viewer.picture.camera.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...grid.gathered_rows import gathered
from ...grid.records.file_records import FileRecords
from ...grid.scene import attributes_of, packed, positions, unpack

if TYPE_CHECKING:
    from ...grid.scene import Scene
    from ...picture.camera import Camera

RADIUS = 8.0
"""Pixels of the picture around the pointer in which a point is looked for; the window passes its own (interaction.editing)."""
_PIXEL_SLACK = 0.02
"""Pixels of tolerance, more than the float32 rounding error of the rasteriser's projection."""
_DEPTH_SLACK = 4e-6
"""Relative tolerance of a depth, more than its float32 rounding error."""
SOFT_RELATIVE, SOFT_SPACINGS = 0.01, 1.0
"""How far behind a pixel's depth points still belong to its surface: of the depth, and point spacings; the larger counts."""
_NEIGHBOURS = 16
"""Points around, at least, from which spacing and noise are told; the ball grows until they are there."""
_FIRST_BALL, _DOUBLINGS = 3.0, 4
"""Radius of the first ball in point spacings of the scan, and how often it is doubled at most."""

Kept = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""(n, 3) float64 positions, (n,) uint8 scan numbers and (n,) numbers in the scene -> (n,) bool: which points are drawn (clips,
and what is hidden), as Selection.keeps."""


@dataclass(frozen=True)
class Surface:
    """The surface around a point.  spacing: 1/sqrt(points per area), file units, NaN where the point is alone.  noise: standard
    deviation of the points from their plane, file units; the surface's own roughness is in it.  normal: (3,) of that plane.
    radius: of the ball that was looked at; count: points in it."""

    spacing: float
    noise: float
    normal: tuple[float, float, float]
    radius: float
    count: int

    @property
    def density(self) -> float:
        """Points per square file unit; NaN where unknown."""
        return 1.0 / self.spacing**2


@dataclass(frozen=True)
class Picked:
    """A measured point.  index: its number in the scene.  position: file coordinates.  distance: from the camera, along the
    ray, file units.  rgb: sRGB levels as drawn.  intensity: in the file's values, None where the scan has none.  scan: its
    number; station: that scan's name.  pixel: column and row of the picture in which it was found.  classification: LAS code,
    None where the scan has none.
    exact: whether position, intensity and classification are those of the file, not rounded by the grid; then ``attributes``
    are all others, by name.  note: why they cannot be read from the file, and how precise they are."""

    index: int
    position: tuple[float, float, float]
    distance: float
    rgb: tuple[int, int, int]
    intensity: float | None
    scan: int
    station: str
    pixel: tuple[int, int]
    classification: int | None = None
    exact: bool = False
    attributes: Mapping[str, Any] = field(default_factory=dict)
    note: str | None = None


def nearest_pixel(measured: np.ndarray, depth: np.ndarray, at: tuple[float, float], radius: float = RADIUS,
                  corner: tuple[int, int] = (0, 0)) -> tuple[int, int] | None:
    """The measured pixel whose centre is nearest to ``at``, of equally near ones the one with the smallest depth.

    measured: (h, w) bool and depth: (h, w) float32, the picture or a part of it whose first column and row are ``corner``.
    Returns (column, row) of the whole picture, None where there is none within ``radius`` pixels.
    """
    height, width = measured.shape
    x, y = at[0] - corner[0], at[1] - corner[1]
    left, right = max(int(np.floor(x - radius)), 0), min(int(np.ceil(x + radius)) + 1, width)
    top, bottom = max(int(np.floor(y - radius)), 0), min(int(np.ceil(y + radius)) + 1, height)
    if left >= right or top >= bottom:
        return None
    rows, columns = np.mgrid[top:bottom, left:right]
    away = (columns + 0.5 - x) ** 2 + (rows + 0.5 - y) ** 2
    there = depth[top:bottom, left:right]
    usable = measured[top:bottom, left:right] & np.isfinite(there) & (away <= radius**2)
    if not usable.any():
        return None
    order = np.lexsort((there[usable], away[usable]))[0]
    return int(columns[usable][order]) + corner[0], int(rows[usable][order]) + corner[1]


def pick(scene: "Scene", camera: "Camera", measured: np.ndarray, depth: np.ndarray, at: tuple[float, float], *,
         radius: float = RADIUS, corner: tuple[int, int] = (0, 0), kept: Kept | None = None) -> Picked | None:
    """The measured point nearest to a position in the picture, in pixels; None where none lies within ``radius``.

    camera: of the picture.  measured: (h, w) bool, ``Frame.mask``; depth: (h, w) float32, ``Frame.depth``: the picture or a
    part of it that starts at ``corner``.  kept: which points are drawn; None: all.
    Of the points in the nearest measured pixel that belong to its front surface, the one seen nearest to ``at`` is taken.
    """
    pixel = nearest_pixel(measured, depth, at, radius, corner)
    if pixel is None:
        return None
    front = float(depth[pixel[1] - corner[1], pixel[0] - corner[0]])
    index, found = _points_of_pixel(scene, camera, pixel, front)
    if kept is not None and len(index):
        words = packed(scene, index)
        left = kept(positions(scene, words, index), (words[:, 2] >> 24).astype(np.uint8), index)
        index, found = index[left], found[left]
    if len(index) == 0:
        return None
    away = (found[:, 1] - at[0]) ** 2 + (found[:, 2] - at[1]) ** 2
    best = int(np.lexsort((found[:, 0], away))[0])
    return describe(scene, camera, int(index[best]), pixel)


def surface_end(front, camera: "Camera", spacing: float):
    """How far points belong to the surface of a pixel whose depth is ``front``, a number or an array: view-space depth, file
    units.  spacing: of the scene's points."""
    return np.maximum(front + SOFT_RELATIVE * camera.divisor(front), front + SOFT_SPACINGS * spacing)


def _points_of_pixel(scene: "Scene", camera: "Camera", pixel: tuple[int, int], front: float) -> tuple[np.ndarray, np.ndarray]:
    """Running numbers of the points in a pixel from its depth to where its surface ends; (n, 3) depth and pixel position."""
    from . import pick_kernels  # numba: only once something is picked

    near = front - _DEPTH_SLACK * float(camera.divisor(front))  # of parallel rays also at depth 0: float32 loses as much
    far = surface_end(front, camera, scene.spacing)
    left, top = pixel[0] - _PIXEL_SLACK, pixel[1] - _PIXEL_SLACK
    right, bottom = pixel[0] + 1 + _PIXEL_SLACK, pixel[1] + 1 + _PIXEL_SLACK
    corners = camera.unproject([(x, y) for x in (left, right) for y in (top, bottom)] * 2, np.repeat([near, far], 4))
    low, high = (np.floor((edge - scene.origin) / scene.cell_size).astype(np.int64)
                 for edge in (corners.min(axis=0), corners.max(axis=0)))  # fmt: skip
    cells = gathered(scene, pick_kernels.cells_in_box(np.asarray(scene.cell_coords), low, high))
    index, found = pick_kernels.points_in_pixel(
        cells.points, cells.coords, cells.offsets, scene.layers, cells.rows, scene.cell_size,
        scene.origin - camera.position,
        np.ascontiguousarray(camera.view_rotation), np.array([camera.fx, camera.fy, camera.cx, camera.cy]),
        camera.orthographic or 0.0, np.array([left, right, top, bottom]), near, far,
    )  # fmt: skip
    return cells.numbers(index), found


def describe(scene: "Scene", camera: "Camera", index: int, pixel: tuple[int, int]) -> Picked:
    """What the grid holds of a point by its number in the scene."""
    xyz, rgb, _, _ = unpack(scene, slice(index, index + 1))
    x, y, z = (float(value) for value in xyz[0])
    red, green, blue = (int(value) for value in rgb[0])
    distance = float(np.linalg.norm(camera.sight_of(xyz[0])))
    known, number = attributes_of(scene, slice(index, index + 1)), int(FileRecords(scene).stations(slice(index, index + 1))[0])
    intensity, classes = known.intensity, known.classification
    level = None if intensity is None else scene.attributes.in_file(int(intensity[0]))
    return Picked(index, (x, y, z), distance, (red, green, blue), level, number,
                  station_name(scene, number), pixel, None if classes is None else int(classes[0]))


def is_quick(scene: "Scene", index: int) -> bool:
    """Whether :func:`exactly` takes less than about 0.1 s for a point."""
    return FileRecords(scene).is_quick(index)


def exactly(scene: "Scene", camera: "Camera", picked: Picked) -> Picked:
    """A picked point with the values of its file; where these cannot be read, with a ``note`` that says why."""
    values = FileRecords(scene).of(np.array([picked.index]))
    if not values.exact:
        return replace(picked, note=values.note)
    x, y, z = values.xyz[0].tolist()
    columns = {name: column[0].tolist() for name, column in values.columns.items()}
    intensity, classes = columns.pop("intensity", None), columns.pop("classification", None)
    if values.rgb is not None and picked.rgb != tuple(values.rgb[0].tolist()):
        columns["colour in the file"] = values.rgb[0].tolist()
    return replace(picked, position=(x, y, z), distance=float(np.linalg.norm(camera.sight_of(values.xyz[0]))),
                   intensity=intensity, classification=classes, exact=True, attributes=columns)


def station_name(scene: "Scene", scan: int) -> str:
    """The name of a scan number; its number where it has none."""
    scans = scene.meta.scans
    return (scans[scan].name if scan < len(scans) else "") or f"scan {scan + 1}"


def surface_around(scene: "Scene", position) -> Surface:
    """Spacing and noise of the measured points around a place, (3,) file coordinates."""
    from ..point_moments import mean_and_covariance
    from . import pick_kernels  # numba: only once something is picked

    place = np.asarray(position, np.float64) - scene.origin
    radius = _FIRST_BALL * (scene.spacing or scene.cell_size / 16)
    sums = np.zeros(10)
    for doubling in range(_DOUBLINGS + 1):
        radius *= 2.0 if doubling else 1.0
        low, high = (np.floor((place + sign * radius) / scene.cell_size).astype(np.int64) for sign in (-1, 1))
        cells = gathered(scene, pick_kernels.cells_in_box(np.asarray(scene.cell_coords), low, high))
        sums = pick_kernels.neighbourhood(cells.points, cells.coords, cells.offsets, scene.layers, cells.rows, scene.cell_size,
                                          place, radius)
        if sums[0] >= _NEIGHBOURS:
            break
    count = int(sums[0])
    if count < 2:
        return Surface(float("nan"), 0.0, (0.0, 0.0, 1.0), radius, count)
    spacing = float(np.sqrt(np.pi * radius**2 / (count - 1)))
    variance, axes = np.linalg.eigh(mean_and_covariance(sums)[1])
    noise = float(np.sqrt(max(variance[0], 0.0) * count / (count - 3))) if count > 3 else 0.0
    a, b, c = (float(value) for value in axes[:, 0])
    return Surface(spacing, noise, (a, b, c), radius, count)
