"""Clips as numbers for loops over places of meshes."""

import numpy as np

from ..clip import Clip, active, group, normals


def clip_rows(clips: tuple[Clip, ...], rotation: np.ndarray, origin: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Clips as viewer.readers.meshes.ray_loops.clip_keeps reads them: (K, 3, 4) float64 and (K,) int64, in the frame of a
    (3, 3) rotation from the document's and of its origin (3,) there."""
    used = active(clips)
    rows, groups = np.zeros((len(used), 3, 4)), np.array([group(clip) for clip in used], np.int64)
    for number, clip in enumerate(used):
        planes = normals(clip)
        rows[number, :, :3] = planes @ rotation.T
        rows[number, :, 3] = planes @ (origin - np.array(clip.centre))
    return rows, groups
