"""Faces of a cube without seams: rendered with a margin, which is cut away, and blended at the edges.

Fill and network see nothing beyond a picture's border, so that two 90-degree pictures that meet at an edge of the cube have
other colours there wherever no point was measured: a straight line through ceilings and skies.  With the margin both see the
surroundings of the edge.  What still differs, by the pyramids' own grid, is blended over a narrow band.

Frame: faces are in the order of cube_faces.FACES; pixels of a face count from its upper left corner, also those of the margin.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from ...picture.camera import Camera

MARGIN = 3 / 32
"""Of a face's side, on each side of it.  Filled faces of 1024 pixels at the first planned place: levels between neighbouring
pixels across an edge, mean of the worst of the twelve edges, without margin, with this one, and blended; in the faces the
means are 1.2 to 2.0: plant_room.laz 15.2, 6.4, 3.8; demo.laz 19.4, 6.9, 4.7; a scan of living-room-2 27.2, 5.5, 4.2; studio.laz
27.2, 6.8, 4.3.  With 2/32: 11.4, 6.9, 5.4, 7.0 before blending; with 4/32: 5.2, 6.9, 5.4, 7.0.  Neural, studio.laz at 512: 28.3
without, 5.7 with 2/32 and with 4/32.  Run time grows with the pixels, 1.41 times."""
BAND = 1 / 32
"""Of a face's side: how far from an edge a face is blended with its neighbour.  Both count half at the edge."""


def with_margin(camera: Camera) -> Camera:
    """The camera of a face, (S, S), with margins: (S + 2M, S + 2M); the pixels of the face are the same ones."""
    more = margin_of(camera.width)
    return replace(camera, width=camera.width + 2 * more, height=camera.height + 2 * more, cx=camera.cx + more,
                   cy=camera.cy + more)


def margin_of(side: int) -> int:
    """Pixels of the margin of a face with ``side`` pixels."""
    return round(MARGIN * side)


def without_margin(picture: np.ndarray) -> np.ndarray:
    """(S, S, ...) of (S + 2M, S + 2M, ...): a view of the middle."""
    more = round(picture.shape[0] * MARGIN / (1 + 2 * MARGIN))
    return picture[more:picture.shape[0] - more, more:picture.shape[1] - more]


@dataclass(frozen=True, eq=False)
class _Blend:
    """Of one face, the pixels of its bands, (n,) rows and columns, with the share of its own picture, (n, 1), and for each
    neighbour its number, which of the pixels it shows, and where (columns and rows in its picture with margins, from the centre
    of the first pixel) with its share."""

    rows: np.ndarray
    columns: np.ndarray
    share: np.ndarray
    others: list[tuple[int, np.ndarray, np.ndarray, np.ndarray, np.ndarray]]


def blended(wide: Sequence[np.ndarray], cameras: Sequence[Camera]) -> np.ndarray:
    """(6, S, S, 3) uint8: the faces of pictures with margins, blended at their edges.  wide: six of (S + 2M, S + 2M, 3) uint8
    sRGB.  cameras: six, without margins."""
    faces = np.stack([without_margin(picture) for picture in wide])
    directions = tuple(camera.view_rotation.round(9).tobytes() for camera in cameras)
    for number, blend in enumerate(_blends(cameras[0].width, directions)):
        colours = faces[number, blend.rows, blend.columns] * blend.share
        for other, shown, columns, rows, share in blend.others:
            colours[shown] += _bilinear(wide[other], columns, rows) * share
        faces[number, blend.rows, blend.columns] = np.rint(colours).astype(np.uint8)
    return faces


@lru_cache(2)
def _blends(side: int, rotations: tuple[bytes, ...]) -> list[_Blend]:
    """rotations: of each face, (3, 3) float64 from world to view axes, as bytes."""
    views = [np.frombuffer(data).reshape(3, 3) for data in rotations]
    middle = np.arange(side) + 0.5
    across, down = np.meshgrid(middle, middle)
    rows, columns = np.nonzero(_inside(across, down, side) < BAND * side)
    x, y = across[rows, columns], down[rows, columns]
    made, own = [], _weight(_inside(x, y, side), side)
    for number, view in enumerate(views):
        rays = np.stack([2 * x / side - 1, 2 * y / side - 1, np.ones_like(x)], axis=-1) @ view
        total, others = own.copy(), []
        for other in set(range(len(views))) - {number}:
            seen = rays @ views[other].T
            ahead = np.flatnonzero(seen[:, 2] > 0)
            u, v = ((seen[ahead, axis] / seen[ahead, 2] + 1) * side / 2 for axis in (0, 1))
            weight = _weight(_inside(u, v, side), side)
            there = weight > 0
            shown = ahead[there]
            total[shown] += weight[there]
            more = margin_of(side) - 0.5
            others.append((other, shown, u[there] + more, v[there] + more, weight[there]))
        made.append(_Blend(rows, columns, (own / total)[:, None].astype(np.float32), [
            (other, shown, u, v, (weight / total[shown])[:, None].astype(np.float32))
            for other, shown, u, v, weight in others if len(shown)
        ]))
    return made


def _inside(x: np.ndarray, y: np.ndarray, side: int) -> np.ndarray:
    """Pixels from a point to the nearest edge of the face, below 0 outside."""
    return np.minimum(np.minimum(x, side - x), np.minimum(y, side - y))


def _weight(inside: np.ndarray, side: int) -> np.ndarray:
    """1/2 at the edge, 1 from BAND inside, 0 from BAND outside."""
    return np.clip(0.5 + inside / (2 * BAND * side), 0.0, 1.0)


def _bilinear(picture: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(n, 3) float32 colours between pixels, at columns x and rows y."""
    column, row = x.astype(int), y.astype(int)
    a, b = (x - column)[:, None].astype(np.float32), (y - row)[:, None].astype(np.float32)
    above = picture[row, column] * (1 - a) + picture[row, column + 1] * a
    below = picture[row + 1, column] * (1 - a) + picture[row + 1, column + 1] * a
    return above * (1 - b) + below * b
