"""Which nodes of an octree a camera looks at, in the order in which they should be read.

A node is worth reading as long as the points of its parent are further apart on the screen than FINEST_PX.  First come the
nodes in the picture, the coarsest on the screen first; then, coarser, those around the camera, so that turning shows something
at once.  No OpenGL and no reading.  Frame: the file's.
"""

from typing import TYPE_CHECKING

import numpy as np

from ..picture.camera import Camera

if TYPE_CHECKING:
    from ..readers.remote.octree_view import OctreeNodes

FINEST_PX = 0.7
"""Pixels between the points of a parent below which its children are left out: the picture has two points a pixel then."""
AROUND_PX = 8.0
"""The same outside the picture, of a camera of 90 degrees where the picture shows less: a zoom does not make what is around it
larger.  About a hundredth of the points that the picture has."""
MOST_POINTS = 6_000_000
"""Points that are read for a view: 6.5 for each pixel of 1280x720, and 0.4 GB of memory with those kept of other views."""


def nodes_in_view(nodes: "OctreeNodes", camera: Camera, *, points: int = MOST_POINTS) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the nodes in the picture and of those around it, each in the order in which they should be read; together
    they hold about ``points`` points at most."""
    size = 2 * nodes.spacing * max(camera.fx, camera.fy) / distance(nodes, camera)
    seen = _in_frustum(nodes, camera)
    groups = []
    zoom = 1.0 if camera.orthographic is not None else max(1.0, 2 * camera.fx / camera.width, 2 * camera.fy / camera.height)
    for these, least in ((seen, FINEST_PX), (~seen, AROUND_PX * zoom)):
        chosen = np.flatnonzero(these & ((size > least) | (nodes.levels == 0)))
        chosen = chosen[np.argsort(-size[chosen], kind="stable")]
        chosen = chosen[np.argsort(nodes.levels[chosen] > 0, kind="stable")]  # the root before all
        within = np.cumsum(nodes.points[chosen]) <= points
        groups.append(chosen[within])
        points -= int(nodes.points[chosen[within]].sum())
    return groups[0], groups[1]


def distance(nodes: "OctreeNodes", camera: Camera) -> np.ndarray:
    """(n,) float64 file units: from the camera to the nearest point of each cube, a thousandth of its side at least; of an
    orthographic camera the depth at which its scale holds."""
    if camera.orthographic is not None:
        return np.full(len(nodes.sides), camera.orthographic)
    off = np.maximum(nodes.low - camera.position, camera.position - nodes.low - nodes.sides[:, None])
    return np.maximum(np.linalg.norm(np.maximum(off, 0.0), axis=1), nodes.sides * 1e-3)


def _in_frustum(nodes: "OctreeNodes", camera: Camera) -> np.ndarray:
    """(n,) bool: whether the sphere around each cube touches the picture's frustum.  That of a parent does where that of a
    child does."""
    radius = nodes.sides * np.sqrt(0.75)
    x, y, z = camera.view_rotation @ (nodes.low + nodes.sides[:, None] / 2 - camera.position).T
    inside = z > -radius
    for across, focal, centre, side in ((x, camera.fx, camera.cx, camera.width), (y, camera.fy, camera.cy, camera.height)):
        for edge, sign in ((-centre / focal, 1.0), ((side - centre) / focal, -1.0)):
            if camera.orthographic is None:
                inside &= sign * (across - edge * z) > -radius * np.hypot(1.0, edge)
            else:
                inside &= sign * (across - edge * camera.orthographic) > -radius
    return inside
