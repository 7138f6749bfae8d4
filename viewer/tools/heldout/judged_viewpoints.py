"""Where a scan is judged from, and learned from: the benches' named views and path, and the scanners' own places.

Frame: file coordinates, world up = +z.
"""

from typing import TYPE_CHECKING

import numpy as np

from model.common.scanner_positions import stations_differ
from model.data.dataset import MemoryPicture, Scan
from model.evaluation.heldout import Viewpoint
from viewer.camera import Camera, from_fov, look_at

if TYPE_CHECKING:
    from viewer.grid.scene import Scene

STATIONS = 4
"""Scanner positions that are left out, each in its turn: those with the most points."""
FIELD_OF_VIEW = 60.0
"""Degrees, vertical, from a scanner's place."""
LEAST_SHARE = 0.02
"""Of the points, that a station must have to be left out, and that must be left without it."""


def picture_of(camera: Camera) -> MemoryPicture:
    """The camera as a picture without pixels.  Raises ValueError where its pixels are not square."""
    if camera.fx != camera.fy:
        raise ValueError(f"camera {camera.name!r}: its pixels are not square")
    empty = np.broadcast_to(np.zeros(3, np.uint8), (camera.height, camera.width, 3))
    return MemoryPicture(empty, camera.fx, np.array(camera.camera_to_world), centre=(camera.cx, camera.cy))


def judged_viewpoints(scene: "Scene", size: tuple[int, int], count: int) -> list[Viewpoint]:
    """``count`` of the benches' eight named views, evenly chosen; where more are wanted, places on the benches' path too."""
    from viewer.tools.viewpoints import camera_path, named_views

    cameras = named_views(scene, size)
    if count > len(cameras):
        cameras += camera_path(scene, size, count - len(cameras))
    chosen = np.unique(np.linspace(0, len(cameras) - 1, count).round().astype(int))
    return [Viewpoint(cameras[int(n)].name, picture_of(cameras[int(n)])) for n in chosen]


def station_viewpoints(scan: Scan, size: tuple[int, int]) -> list[Viewpoint]:
    """Four directions from each of the scanners that are left out; none where the scan does not tell its stations apart."""
    if scan.places is None or not stations_differ(scan.places):
        return []
    counts = np.bincount(scan.station, minlength=len(scan.places))[: len(scan.places)]
    share = counts / max(len(scan.station), 1)
    known = np.isfinite(scan.places).all(axis=1) & (share >= LEAST_SHARE) & (share <= 1.0 - LEAST_SHARE)
    numbers = sorted(np.flatnonzero(known).tolist(), key=lambda n: -counts[n])[:STATIONS]
    found = []
    for number in numbers:
        place = scan.places[number]
        for turn, ahead in enumerate(((1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0))):
            name = f"station-{number + 1}-{'xyXY'[turn]}"
            camera = from_fov(*size, FIELD_OF_VIEW, look_at(place, place + np.array(ahead, float)), name)
            found.append(Viewpoint(name, picture_of(camera), number))
    return found
