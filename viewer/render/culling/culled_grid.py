"""What the compiled loops of culling are given: a scene's cells in blocks, and the frustum that they are culled against."""

from typing import NamedTuple

import numpy as np

from ....model.common.jit import compiled

Vector = tuple[float, float, float]


class BlockedCells(NamedTuple):
    """A scene's cells, and blocks of ``per`` of them that follow each other along the Morton curve.

    coords: (C, 3) int32.  size: of a cell, file units.  blocks: (B, 6) float64, middle and half extent, in cells.
    faces: (C, 3) uint8 as in Scene, or (0, 3): each cell is taken for a wall across all of it, seen at a right angle.
    boxes: (C, 6) uint8 as in Scene, or (0, 6): the cells'.
    """

    coords: np.ndarray
    size: float
    blocks: np.ndarray
    per: int
    faces: np.ndarray
    boxes: np.ndarray


class Frustum(NamedTuple):
    """What cells are culled against.  Plain numbers, which compiled code keeps in registers: with arrays in their place its
    loops took seven times as long.

    shift: from the camera to the grid's origin, world axes.  rotation: rows of world to view.
    fx, fy, left, right, top, bottom: focal lengths and the distances of the picture's sides from its middle, pixels.
    parallel: of an orthographic camera, the depth at which fx and fy are its scale; 0 of a pinhole.
    sides: change of the distance to the left, right, top and bottom, and of depth, per unit along x, y and z; absolute values.
    corner: view vector from a cell's middle to its first step's.
    """

    shift: Vector
    rotation: tuple[Vector, Vector, Vector]
    fx: float
    fy: float
    left: float
    right: float
    top: float
    bottom: float
    parallel: float
    sides: tuple[Vector, Vector, Vector, Vector, Vector]
    corner: Vector


@compiled(inline="always")
def turned(rotation, vector):
    """A vector in world axes, in the view's axes."""
    x, y, z = vector
    return (
        rotation[0][0] * x + rotation[0][1] * y + rotation[0][2] * z,
        rotation[1][0] * x + rotation[1][1] * y + rotation[1][2] * z,
        rotation[2][0] * x + rotation[2][1] * y + rotation[2][2] * z,
    )


@compiled(inline="always")
def block_middle(blocks, block, size, shift):
    """The middle of a block, from the camera, in world axes.  size: of a cell."""
    return blocks[block, 0] * size + shift[0], blocks[block, 1] * size + shift[1], blocks[block, 2] * size + shift[2]


@compiled(inline="always")
def cell_middle(coords, row, size, shift):
    """The middle of a cell, from the camera, in world axes."""
    return (
        (coords[row, 0] + 0.5) * size + shift[0],
        (coords[row, 1] + 0.5) * size + shift[1],
        (coords[row, 2] + 0.5) * size + shift[2],
    )


class FrustumArrays(NamedTuple):
    """A Frustum as Python hands it over: arrays are taken apart in a tenth of the time of so many numbers (4 us a frame).
    shift, corner: (3,) float64.  rotation: (3, 3).  lens: (6,), fx to bottom.  sides: (5, 3)."""

    shift: np.ndarray
    rotation: np.ndarray
    lens: np.ndarray
    parallel: float
    sides: np.ndarray
    corner: np.ndarray


@compiled(inline="always")
def _vector(row):
    return row[0], row[1], row[2]


@compiled(inline="always")
def frustum_of(arrays):
    """The Frustum of FrustumArrays."""
    lens, turn, sides = arrays.lens, arrays.rotation, arrays.sides
    rotation = _vector(turn[0]), _vector(turn[1]), _vector(turn[2])
    reaches = _vector(sides[0]), _vector(sides[1]), _vector(sides[2]), _vector(sides[3]), _vector(sides[4])
    return Frustum(_vector(arrays.shift), rotation, lens[0], lens[1], lens[2], lens[3], lens[4], lens[5], arrays.parallel,
                   reaches, _vector(arrays.corner))
