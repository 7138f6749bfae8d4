"""From scan files to a packed grid of points; no OpenGL here.

    viewer.readers -> chunks -> grid: cells, density layers, 12-byte points -> Scene -> memory-mapped cache

Frame: the file's own coordinates, float64, in the file's own units.  Importing this package is cheap: file libraries
and compiled kernels load when a scan has to be read, so a cached scene opens without them.
"""

from viewer.cloud.build import open_scene, scene_from_arrays
from viewer.cloud.scene import Scene, unpack

__all__ = ["Scene", "open_scene", "scene_from_arrays", "unpack"]
