"""Viewpoints for evaluation and training on a scan: the benches' named views and path, and the scanner positions.

Frame: file coordinates, world up = +z.
"""

from typing import TYPE_CHECKING

import numpy as np

from ....model.common.scanner_positions import stations_differ
from ....model.data.dataset import MemoryPicture, MergedScan
from ....model.evaluation.heldout import Viewpoint
from ...picture.camera import Camera, from_fov, look_at
from ...work.places.standing_place import FIELD_OF_VIEW

if TYPE_CHECKING:
    from ...grid.scene import Scene

STATIONS = 4
"""Number of stations that are withheld, one at a time: those with the most points.  For each the grid of the
scan is built once more."""
LEAST_SHARE = 0.02
"""Least share of the points that a withheld station must have, and that must remain without it.  Chosen by hand."""


def picture_of(camera: Camera) -> MemoryPicture:
    """The camera as a black picture.  Raises ValueError if its pixels are not square."""
    if camera.fx != camera.fy:
        raise ValueError(f"camera {camera.name!r}: its pixels are not square")
    empty = np.broadcast_to(np.zeros(3, np.uint8), (camera.height, camera.width, 3))
    return MemoryPicture(empty, camera.fx, np.array(camera.camera_to_world), centre=(camera.cx, camera.cy))


def judged_viewpoints(scene: "Scene", size: tuple[int, int], count: int) -> list[Viewpoint]:
    """``count`` evenly spaced cameras: the benches' eight named views, and for more than eight also cameras of their path."""
    from ...work.places.viewpoints import camera_path, named_views

    cameras = named_views(scene, size)
    if count > len(cameras):
        cameras += camera_path(scene, size, count - len(cameras))
    chosen = np.unique(np.linspace(0, len(cameras) - 1, count).round().astype(int))
    return [Viewpoint(cameras[int(n)].name, picture_of(cameras[int(n)])) for n in chosen]


def station_viewpoints(scan: MergedScan, size: tuple[int, int]) -> list[Viewpoint]:
    """Four horizontal directions from each withheld station; empty if the scan has no distinct scanner positions."""
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
