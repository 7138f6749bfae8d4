"""The six faces of a place: pictures of 90-degree cameras that meet edge to edge, with depth and provenance.

A face is what ``pointglass render`` makes of its camera with a margin, which is cut away; at its edges it is blended with its
neighbours (face_margins.py).  The raw view, depth and what was measured are those of the camera itself.

Frame: file coordinates; the cube stands upright by the document's up axis, its first face looks along the first axis of the
upright world.
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ...picture.background import composite
from ...picture.camera import Camera, from_fov, look_at
from ...picture.look import MOST_POINT_SIZE
from ...picture.point_sets import LEFT_OUT
from ...picture.spec import PictureSpec
from ...work.places.up_axis import upright_axes
from .depth_codes import DepthScale
from .face_margins import blended, with_margin

if TYPE_CHECKING:
    from ...grid.scene import Scene
    from ...picture.point_sets import PointLevels
    from ...render.described_picture import Composer
    from ...render.renderer import Renderer

FACES: dict[str, tuple[tuple[float, float, float], tuple[float, float, float]]] = {
    "east": ((1, 0, 0), (0, 0, 1)),
    "west": ((-1, 0, 0), (0, 0, 1)),
    "north": ((0, 1, 0), (0, 0, 1)),
    "south": ((0, -1, 0), (0, 0, 1)),
    "up": ((0, 0, 1), (0, -1, 0)),
    "down": ((0, 0, -1), (0, 1, 0)),
}
"""Name -> directions forward and up, in the upright world."""

_HORIZON = 15.0
"""Degrees above and below the horizon in which depths count for the first heading."""
_SECTOR = 70.0
"""Degrees of its width: of what a window shows."""
DISC, _NEAREST = 2.0, 5.0
"""Diameter of a disc in spacings: so large ones cover 1 - exp(-pi) = 96 % of a surface of random points; and the percentile of
depths at which they do."""


@dataclass(frozen=True, eq=False)
class PlaceFaces:
    """pictures: (6, S, S, 3) uint8 sRGB.  first: the same at the side of ``codes``.  second: another view at that side, None
    where none was asked for.  codes: (6, D, D) uint16, by ``scale``.  measured: (6, D, D) bool, a point lies in the pixel
    and no mesh before it."""

    pictures: np.ndarray
    first: np.ndarray
    second: np.ndarray | None
    codes: np.ndarray
    measured: np.ndarray
    scale: DepthScale


def face_cameras(position: np.ndarray, side: int, up=(0.0, 0.0, 1.0), name: str = "") -> list[Camera]:
    """The cameras of FACES at a position (3,), file coordinates.  up: of the document, unit vector."""
    axes = upright_axes(up)
    cameras = []
    for face, (forward, top) in FACES.items():
        pose = look_at(position, position + axes @ np.array(forward), axes @ np.array(top))
        cameras.append(from_fov(side, side, 90.0, pose, f"{name}-{face}"))
    return cameras


def rendered_faces(position: np.ndarray, side: int, up=(0.0, 0.0, 1.0)) -> list[Camera]:
    """The cameras that are rendered for a place: those of its faces with their margins."""
    return [with_margin(camera) for camera in face_cameras(position, side, up)]


def render_place(renderer: "Renderer", composer: "Composer", spec: PictureSpec, position: np.ndarray, *, side: int,
                 depth_side: int, second: str | None, changes: "PointLevels | None" = None) -> PlaceFaces:
    """The faces of a place.  spec: view, settings, edits and background; its camera is not looked at.  side: of ``pictures``, a
    multiple of ``depth_side``.  second: a view without the network.  changes: levels of the points, with which alone the
    second view is drawn, filtered, in discs that close the gaps between them: distances are never filled in.  Raises
    DeviceError."""
    from ...render.described_picture import render

    wide, others, depths, masks = [], [], [], []
    small, large = (face_cameras(position, size, spec.edits.up) for size in (depth_side, side))
    for camera in large:
        one = replace(spec, camera=with_margin(camera))
        wide.append(composite(composer.images(render(renderer, one), one)[0], spec.background))
    for camera in small:
        one = replace(spec, camera=camera, settings=replace(spec.settings, view="filled"), views=("filled",))
        frame = render(renderer, one, more=(second,) if second is not None and changes is None else (), filled_depth=True)
        depth, measured = composer.surface(frame, one)
        depths.append(depth)
        masks.append(measured)
        if second is not None and changes is None:
            one = replace(one, views=(second,))
            others.append(composite(composer.images(frame, one)[0], spec.background))
    stacked = np.stack(depths)
    if changes is not None:
        look = replace(spec.edits.look, point_size=_disc_size(stacked, _spacing(renderer.scene, changes)))
        edits = replace(spec.edits, changes=changes, look=look)
        for camera in small:
            one = replace(spec, camera=camera, settings=replace(spec.settings, view="filtered"), views=("filtered",),
                          edits=edits)
            others.append(composite(composer.images(render(renderer, one), one)[0], spec.background))
    scale = DepthScale.of(stacked)
    whole = blended(wide, large)
    return PlaceFaces(whole, reduced(whole, side // depth_side), np.stack(others) if others else None, scale.codes(stacked),
                      np.stack(masks), scale)


def _spacing(scene: "Scene", changes: "PointLevels") -> float:
    """File units between neighbours among the points that have a level, where the others lie on the same surfaces."""
    share = float((changes.levels != LEFT_OUT).mean())
    return scene.spacing / max(share, 1e-6) ** 0.5


def _disc_size(depths: np.ndarray, spacing: float) -> int:
    """Pixels of discs that cover a surface of points at random places, so far apart in the scan, at the nearest depths."""
    seen = depths[depths > 0]
    near = float(np.percentile(seen, _NEAREST)) if seen.size else np.inf
    return int(np.clip(np.ceil(DISC * spacing * depths.shape[1] / (2 * near)), 1, MOST_POINT_SIZE))


def open_heading(faces: PlaceFaces) -> float:
    """Degrees, counter-clockwise from the first axis of the upright world, of the middle of the _SECTOR with the greatest
    geometric mean of depth near the horizon: where most of the place is in view."""
    side = faces.codes.shape[1]
    across = (2 * np.arange(side) + 1) / side - 1
    rows = np.abs(across) < np.tan(np.radians(_HORIZON))
    yaws, reach = [], []
    for number, (forward, _) in enumerate(list(FACES.values())[:4]):
        depth = faces.scale.depths(faces.codes[number][rows])
        steps = np.log(np.where(depth > 0, depth, faces.scale.near))  # nothing there is nothing to look at
        yaws.append((np.degrees(np.arctan2(forward[1], forward[0]) - np.arctan(across))) % 360)
        reach.append(steps.mean(axis=0))
    sums, edges = np.histogram(np.concatenate(yaws), 72, (0, 360), weights=np.concatenate(reach))
    counts, _ = np.histogram(np.concatenate(yaws), 72, (0, 360))
    mean, half = sums / np.maximum(counts, 1), round(_SECTOR / 10)
    around = sum(np.roll(mean, by) for by in range(-half, half + 1))
    return float(edges[int(np.argmax(around))] + 2.5)


def reduced(pictures: np.ndarray, factor: int) -> np.ndarray:
    """(F, S / factor, S / factor, 3) uint8: the mean of each block in linear light."""
    from ..film.frames import averaged

    opaque = np.full((*pictures.shape[1:3], 1), 255, np.uint8)
    return np.stack([averaged(np.concatenate([picture, opaque], axis=2), factor)[..., :3] for picture in pictures])
