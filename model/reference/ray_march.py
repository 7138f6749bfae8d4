"""Ray marching of empty pixels through a lattice of occupied blocks: reference implementation of ``hole_march.comp``.

One ray for each square of RAY_BLOCK pixels, through its centre.  Computed in float32, in the shader's order, so that both
agree to the bit.
"""

import numpy as np

RAY_BLOCK = 8
"""Side, pixels, of the squares that share a ray.  A block of viewer/render/culling/occupancy.py has that size in a street 40 m
away."""
STEP = 0.5
"""Blocks from one sample to the next beside and inside occupied blocks: corners less deep than that are missed."""
NOTHING, TOUCHED, IN_SURFACE = 0, 1, 2
"""What a ray met: no occupied block; some; one in the middle of a surface."""
START, START_IN_SURFACE = 3.0, 8.0
"""Distance from the camera, in blocks along the ray's major axis, from which a ray is tested, and from which the middle of a
surface decides.  The latter falls to START for rays that go straight down, because the ground is close.  A camera among
leaves is itself in an occupied block, and would find occupied blocks in every direction.  Both chosen by hand."""
SPARSE_SHARE = 1 / 128
"""Point spacing, as a share of the picture's longer side, from which points are sparse: the picture then cannot tell a gap
between points from the background (its test reaches 1 / 16 of the side), and the middle of a surface decides.  Where points are
denser that rule would only thicken outlines by half a block."""
MAX_STEPS = 1024
"""Samples along a ray, more than any lattice needs; a guard, because far from the origin float32 cannot represent half a block
and the march would not end."""
LOOSE, INNER = 0, 255
"""Codes of a block with points, and of one in the middle of a surface.  Any other code is of an empty block: its Chebyshev
distance, in blocks, to the nearest block with points."""
_EVERYWHERE = 1e9
"""Times a depth: beyond any scene."""
_NEAR = np.float32(1e-12)
"""Smallest divisor of a ray's component: a ray parallel to a side meets it far away."""


def sparse_depth(camera, spacing: float) -> float:
    """View-space z, file units, up to which points ``spacing`` file units apart are sparse in the picture."""
    sparse = camera.fx * spacing / (SPARSE_SHARE * max(camera.width, camera.height))
    parallel = getattr(camera, "orthographic", None)  # of one scale everywhere: all depths are sparse, or none
    return sparse if parallel is None else _EVERYWHERE * sparse if parallel <= sparse else 0.0


def rays_of(camera, to_world: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(h, w, 3) float32 world directions whose largest component is 1 or -1, and (h, w) float32 their length where z is 1.

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


def parallel_rays_of(camera, to_world: np.ndarray, eye: np.ndarray, side: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of an orthographic camera: (h, w, 3) float32 where each ray begins, in blocks; and as :func:`rays_of`.

    eye: (3,) camera position in blocks from the lattice's corner.  side: of a block, file units.
    """
    f = np.float32
    i = (np.arange(-(-camera.width // RAY_BLOCK), dtype=f) + f(0.5)) * f(RAY_BLOCK)
    j = (np.arange(-(-camera.height // RAY_BLOCK), dtype=f) + f(0.5)) * f(RAY_BLOCK)
    x, y = np.meshgrid((i - f(camera.cx)) / f(camera.fx), (j - f(camera.cy)) / f(camera.fy))
    turn, parallel = to_world.astype(f), f(camera.orthographic / side)
    begins = np.stack([f(eye[k]) + (turn[k, 0] * x + turn[k, 1] * y) * parallel for k in range(3)], axis=-1)
    size = np.abs(turn[:, 2]).max()
    ray = np.broadcast_to(turn[:, 2] / size, begins.shape)
    return begins, ray, np.full(x.shape, size, f)


def march(codes: np.ndarray, eye: np.ndarray, rays: np.ndarray, sizes: np.ndarray, sparse: float) -> np.ndarray:
    """(h, w) uint8: NOTHING, TOUCHED or IN_SURFACE.

    codes: (X, Y, Z) uint8 of viewer/render/culling/occupancy.py.  eye: (3,) camera position in blocks from the lattice's
    corner, or (h, w, 3) where each ray begins.  rays, sizes: of :func:`rays_of`.  sparse: :func:`sparse_depth`, in blocks.
    """
    extent, flat = np.array(codes.shape, np.float32), rays.reshape(-1, 3)
    eye = np.broadcast_to(eye.astype(np.float32), rays.shape).reshape(-1, 3)
    away = np.where(np.abs(flat) < _NEAR, _NEAR, flat)
    a, b = (-eye) / away, (extent - eye) / away
    t = np.maximum(np.minimum(a, b).max(axis=1), np.float32(START))
    end = np.maximum(a, b).min(axis=1)
    since = np.float32(START_IN_SURFACE) + np.float32(START_IN_SURFACE - START) * np.minimum(flat[:, 2], np.float32(0))
    until = np.float32(sparse) * sizes.reshape(-1)
    found = np.zeros(len(flat), np.uint8)
    left = np.flatnonzero(t < end)
    last = np.array(codes.shape) - 1
    for _ in range(MAX_STEPS):
        if not len(left):
            break
        at = np.clip(np.floor(eye[left] + t[left, None] * flat[left]).astype(np.int64), 0, last)
        code = codes[tuple(at.T)]
        held = (code == INNER) | (code == LOOSE)
        within = (code == INNER) & (t[left] < until[left]) & (t[left] >= since[left])
        found[left] = np.where(within, IN_SURFACE, np.where(held, TOUCHED, found[left]))
        t[left] += np.where(held, np.float32(STEP), np.maximum(code.astype(np.float32) - np.float32(1), np.float32(STEP)))
        going = ~within & ~((found[left] == TOUCHED) & (t[left] >= until[left]))
        left = left[going & (t[left] < end[left])]
    return found.reshape(rays.shape[:2])
