"""Poses of scans and photographs of an E57 that a project has moved: the file's pose, and then the motion.

A pose of E57 leads from the scan's or the photograph's own frame to that of the file, in metres: ``x' = R x + t``, R as a unit
quaternion w, x, y, z.
"""

from typing import Any

import numpy as np

from ....common.rigid_transform import Rows, combined, rigid
from ....readers.e57.e57_nodes import library, pose_of


def moved_pose_node(image: Any, node: Any, transform: Rows) -> Any:
    """The pose of a copy of ``node``, a scan or a photograph, in the file ``image``.  Without a pose it is in the file's
    frame."""
    from scipy.spatial.transform import Rotation

    libe57, placed = library(), pose_of(node)
    matrix = np.array(transform if placed is None else combined(transform, rigid(*placed)))
    x, y, z, w = Rotation.from_matrix(matrix[:3, :3]).as_quat().tolist()
    pose = libe57.StructureNode(image)
    shift = dict(zip("xyz", matrix[:3, 3].tolist()))
    for name, values in (("rotation", {"w": w, "x": x, "y": y, "z": z}), ("translation", shift)):
        part = libe57.StructureNode(image)
        for key, value in values.items():
            part.set(key, libe57.FloatNode(image, value, libe57.E57_DOUBLE))
        pose.set(name, part)
    return pose
