"""Gaussian splats as arrays, and the frame in which a file stores them."""

from dataclasses import dataclass, replace

import numpy as np

SH0 = 0.28209479177387814
"""Value of the spherical harmonic of degree 0: colour = 0.5 + SH0 * coefficient (Kerbl et al. 2023)."""
SH1 = 0.4886025119029199
"""Factor of the spherical harmonics of degree 1: -y, z and -x of the direction from the eye."""


@dataclass(frozen=True, eq=False)
class Splats:
    """Oriented Gaussians.

    xyz: (n, 3) float64, centres relative to ``origin``.  scale: (n, 3) float32, standard deviations along the axes of each,
    > 0.  rotation: (n, 4) float32, unit quaternions w, x, y, z, from the axes of each to the frame.  rgb: (n, 3) float32, sRGB
    0..1, of degree 0; with ``slope`` it may leave that range.  opacity: (n,) float32, 0..1.  points: (n,) uint32, how many
    measured points each stands for.  origin: (3,) float64, file coordinates of the frame's zero.  Unit: that of the file.
    slope: (n, 3, 3) float32, [axis, channel], change of rgb by the unit direction from the eye; None: there is none.
    """

    xyz: np.ndarray
    scale: np.ndarray
    rotation: np.ndarray
    rgb: np.ndarray
    opacity: np.ndarray
    points: np.ndarray
    origin: np.ndarray
    slope: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.xyz)

    @property
    def sh0(self) -> np.ndarray:
        """(n, 3) float32 coefficients of the spherical harmonic of degree 0."""
        return ((self.rgb - 0.5) / SH0).astype(np.float32)

    @property
    def degree(self) -> int:
        """Of the spherical harmonics, 0 or 1."""
        return 0 if self.slope is None else 1

    def sh1(self, some: slice = slice(None)) -> np.ndarray:
        """(k, 3, 3) float32 coefficients of degree 1, [order -1, 0, 1; channel]; zeros where there is no slope."""
        if self.slope is None:
            return np.zeros((len(self.xyz[some]), 3, 3), np.float32)
        return self.slope[some][:, [1, 2, 0]] * np.array([-1, 1, -1], np.float32)[:, None] / np.float32(SH1)

    def seen(self, eye: np.ndarray) -> np.ndarray:
        """(n, 3) colours from an eye (3,) in the frame of the splats."""
        if self.slope is None:
            return self.rgb
        way = self.xyz - eye
        way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-12)
        return np.maximum(self.rgb + np.einsum("na,nak->nk", way, self.slope), 0)

    def normals(self, some: slice = slice(None)) -> np.ndarray:
        """(k, 3) float64 unit vectors across the planes of splats, of either sign: their third axes."""
        return matrices_of(self.rotation[some])[:, :, 2]

    def turned(self, axes: np.ndarray, factor: float = 1.0) -> "Splats":
        """The splats in another frame: coordinates are ``factor * axes @ xyz``; axes: (3, 3), a rotation.  ``origin`` stays
        that of the file."""
        turn = quaternion_of(axes)
        rotation = product(np.broadcast_to(turn, self.rotation.shape), self.rotation).astype(np.float32)
        slope = None if self.slope is None else np.einsum("ab,nbk->nak", axes, self.slope).astype(np.float32)
        return replace(self, xyz=factor * self.xyz @ np.asarray(axes).T, scale=(self.scale * factor).astype(np.float32),
                       rotation=rotation, slope=slope)


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
