"""What the rays of empty pixels meet in a lattice of occupied blocks: reference implementation of ``surround_march.comp``.

One ray a square of RAY_BLOCK pixels, through its centre.  In float32, in the shader's order, so that both agree to the bit.
"""

import numpy as np

RAY_BLOCK = 8
"""Pixels a side that share a ray.  A block of viewer/render/occupancy.py is as wide as that in a street 40 m away."""
STEP = 0.5
"""Blocks between two looks beside and in occupied ones: a corner less than that deep is missed."""
NOTHING, TOUCHED, WITHIN = 0, 1, 2
"""What a ray met: no occupied block; some; one in the middle of a surface."""
START, START_WITHIN = 3.0, 8.0
"""Blocks from the eye, along the axis that a ray follows most, from which on it is tested, and from which on the middle of a
surface decides for a ray that does not go down (the more it does, the nearer to START: the ground is under one's feet).  An eye
among leaves is in a block that holds points, and would see them whichever way it looked."""
SPARSE_SHARE = 1 / 128
"""Of the picture's longer side: where points lie at least as far apart, the picture cannot tell a gap between them from the
background (it looks for holes across 1 / 16), and the middle of a surface decides.  Nearer together it would only make outlines
thicker, by half a block."""
MOST_LOOKS = 1024
"""No lattice takes as many; far from one float32 has no steps of half a block, and a march would not end."""
_LOOSE, _INNER = 0, 255
_NEAR = np.float32(1e-12)


def sparse_depth(camera, spacing: float) -> float:
    """View-space z, file units, up to which points ``spacing`` file units apart are sparse in the picture."""
    return camera.fx * spacing / (SPARSE_SHARE * max(camera.width, camera.height))


def rays_of(camera, to_world: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(h, w, 3) float32 world directions, the largest component 1 or -1, and (h, w) float32 how long they are where z is 1.

    camera: width, height, fx, fy, cx, cy in pixels.  to_world: (3, 3), columns are the view frame's x, y, z in world axes.
    """
    f = np.float32
    i = (np.arange(-(-camera.width // RAY_BLOCK), dtype=f) + f(0.5)) * f(RAY_BLOCK)
    j = (np.arange(-(-camera.height // RAY_BLOCK), dtype=f) + f(0.5)) * f(RAY_BLOCK)
    x, y = np.meshgrid((i - f(camera.cx)) / f(camera.fx), (j - f(camera.cy)) / f(camera.fy))
    turn = to_world.astype(f)
    ray = np.stack([(turn[k, 0] * x + turn[k, 1] * y) + turn[k, 2] for k in range(3)], axis=-1)
    size = np.abs(ray).max(axis=-1)
    return ray / size[..., None], size


def march(codes: np.ndarray, eye: np.ndarray, rays: np.ndarray, sizes: np.ndarray, sparse: float) -> np.ndarray:
    """(h, w) uint8: NOTHING, TOUCHED or WITHIN.

    codes: (X, Y, Z) uint8 of viewer/render/occupancy.py.  eye: (3,) in blocks from the lattice's corner.  rays, sizes: of
    rays_of.  sparse: sparse_depth, in blocks.
    """
    extent, eye = np.array(codes.shape, np.float32), eye.astype(np.float32)
    flat = rays.reshape(-1, 3)
    away = np.where(np.abs(flat) < _NEAR, _NEAR, flat)  # parallel to a side: meets it far away
    a, b = (-eye) / away, (extent - eye) / away
    t = np.maximum(np.minimum(a, b).max(axis=1), np.float32(START))
    end = np.maximum(a, b).min(axis=1)
    since = np.float32(START_WITHIN) + np.float32(START_WITHIN - START) * np.minimum(flat[:, 2], np.float32(0))
    until = np.float32(sparse) * sizes.reshape(-1)
    found = np.zeros(len(flat), np.uint8)
    left = np.flatnonzero(t < end)
    last = np.array(codes.shape) - 1
    for _ in range(MOST_LOOKS):
        if not len(left):
            break
        at = np.clip(np.floor(eye + t[left, None] * flat[left]).astype(np.int64), 0, last)
        code = codes[tuple(at.T)]
        held = (code == _INNER) | (code == _LOOSE)
        within = (code == _INNER) & (t[left] < until[left]) & (t[left] >= since[left])
        found[left] = np.where(within, WITHIN, np.where(held, TOUCHED, found[left]))
        t[left] += np.where(held, np.float32(STEP), np.maximum(code.astype(np.float32) - np.float32(1), np.float32(STEP)))
        going = ~within & ~((found[left] == TOUCHED) & (t[left] >= until[left]))
        left = left[going & (t[left] < end[left])]
    return found.reshape(rays.shape[:2])
