"""Gaussian splats as arrays, and the frame in which a file stores them."""

from dataclasses import dataclass, replace

import numpy as np

SH0 = 0.28209479177387814
"""Value of the spherical harmonic of degree 0: colour = 0.5 + SH0 * coefficient (Kerbl et al. 2023)."""


@dataclass(frozen=True, eq=False)
class Splats:
    """Oriented Gaussians.

    xyz: (n, 3) float64, centres relative to ``origin``.  scale: (n, 3) float32, standard deviations along the axes of each,
    > 0.  rotation: (n, 4) float32, unit quaternions w, x, y, z, from the axes of each to the frame.  rgb: (n, 3) float32, sRGB
    0..1.  opacity: (n,) float32, 0..1.  points: (n,) uint32, how many measured points each stands for.
    origin: (3,) float64, file coordinates of the frame's zero.  Unit: that of the file.
    """

    xyz: np.ndarray
    scale: np.ndarray
    rotation: np.ndarray
    rgb: np.ndarray
    opacity: np.ndarray
    points: np.ndarray
    origin: np.ndarray

    def __len__(self) -> int:
        return len(self.xyz)

    @property
    def sh0(self) -> np.ndarray:
        """(n, 3) float32 coefficients of the spherical harmonic of degree 0."""
        return ((self.rgb - 0.5) / SH0).astype(np.float32)

    def normals(self, some: slice = slice(None)) -> np.ndarray:
        """(k, 3) float64 unit vectors across the planes of splats, of either sign: their third axes."""
        return matrices_of(self.rotation[some])[:, :, 2]

    def turned(self, axes: np.ndarray, factor: float = 1.0) -> "Splats":
        """The splats in another frame: coordinates are ``factor * axes @ xyz``; axes: (3, 3), a rotation.  ``origin`` stays
        that of the file."""
        turn = quaternion_of(axes)
        rotation = product(np.broadcast_to(turn, self.rotation.shape), self.rotation).astype(np.float32)
        return replace(self, xyz=factor * self.xyz @ np.asarray(axes).T, scale=(self.scale * factor).astype(np.float32),
                       rotation=rotation)


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(n, 4) products of quaternions w, x, y, z: first the rotation b, then a."""
    w, x, y, z = np.moveaxis(np.asarray(a, np.float64), -1, 0)
    p, q, r, s = np.moveaxis(np.asarray(b, np.float64), -1, 0)
    return np.stack([w * p - x * q - y * r - z * s, w * q + x * p + y * s - z * r, w * r - x * s + y * p + z * q,
                     w * s + x * r - y * q + z * p], axis=-1)  # fmt: skip


def quaternion_of(axes: np.ndarray) -> np.ndarray:
    """(4,) unit quaternion w, x, y, z of a rotation matrix (3, 3)."""
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(axes).as_quat()
    return np.array([w, x, y, z])


def matrices_of(rotation: np.ndarray) -> np.ndarray:
    """(n, 3, 3) rotation matrices of unit quaternions w, x, y, z (n, 4); their columns are the axes."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat(np.asarray(rotation, np.float64)[:, [1, 2, 3, 0]]).as_matrix()
