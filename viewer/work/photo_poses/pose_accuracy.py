"""How accurately the matches of a photograph fix its pose: the errors of place and direction that 95 of 100 poses stay below.

The covariance of the least-squares fit (Triggs et al. 2000, "Bundle Adjustment"), at its solution, by the residuals themselves.
Matches near each other err alike, as a lens or a sparse surface bends them: the residuals are also summed over parts of the
picture, each taken as one observation (Liang and Zeger 1986), and the larger of both errors counts.
View frame: x right, y down, z forward.
"""

import numpy as np

CONFIDENCE = 0.95
CELLS = 4
"""Parts of a picture along each side in which residuals may err alike."""
DEPENDENT = 2.0
"""How many times as far off poses are as matches with independent errors would make them: features lie at one place, and
both pictures show one surface of sparse points.  44 fits to rendered views of living-room and dining-room, half of them with
the focal length stated: 95 % of the places lie within twice the radius, half within it.  So do 92 of 95 fits in four rooms in
which it was not chosen, but those of which few matches agree (pose_search.AGREEING)."""
STATED = 0.05
"""Standard deviation of a stated focal length, as a share of it."""


def pose_within(points: np.ndarray, rotation: np.ndarray, shift: np.ndarray, focal: float, apart: np.ndarray,
                places: np.ndarray, *, stated: bool) -> tuple[float, float]:
    """The distance of the place (file units) and the angle of the direction (radians) within which the truth lies with a
    probability of CONFIDENCE; infinite where the matches do not fix the pose.

    points: (n, 3) of the matches that agree.  rotation (3, 3), shift (3,): point to view frame.  apart: (n, 2) residuals,
    pixels.  places: (n, 2) in the picture, 0..1.  stated: whether the focal length is kept to STATED.
    """
    slopes = _slopes(points @ rotation.T + shift, rotation, focal)
    variance = float((apart**2).sum()) / max(apart.size - 7, 1)
    prior = np.zeros((7, 7))
    prior[6, 6] = variance / STATED**2 if stated else 0.0
    normal = np.einsum("nka,nkb->ab", slopes, slopes) + prior
    try:
        inverse = np.linalg.inv(normal)
    except np.linalg.LinAlgError:
        return np.inf, np.inf
    column, row = np.clip((places * CELLS).astype(np.intp), 0, CELLS - 1).T
    cell = row * CELLS + column
    pulls = np.zeros((CELLS * CELLS, 7))
    np.add.at(pulls, cell, np.einsum("nk,nka->na", apart, slopes))
    used = len(np.unique(cell))
    together = inverse @ (pulls.T @ pulls * (used / max(used - 1, 1)) + prior * variance) @ inverse
    place, turn = (max(_radius(each[part, part]) for each in (inverse * variance, together))
                   for part in (slice(3, 6), slice(0, 3)))  # fmt: skip
    return DEPENDENT * place, DEPENDENT * turn


def _slopes(seen: np.ndarray, rotation: np.ndarray, focal: float) -> np.ndarray:
    """(n, 2, 7): of a point's pixel by a rotation in the view frame, the place of the camera and the logarithm of the focal
    length.  seen: (n, 3), view frame."""
    x, y, z = seen.T
    none = np.zeros_like(z)
    turned = np.stack([np.stack([none, z, -y], 1), np.stack([-z, none, x], 1), np.stack([y, -x, none], 1)], 1)
    moved = np.concatenate([turned, np.broadcast_to(-rotation, (len(z), 3, 3))], axis=2)  # (n, 3, 6) of the point
    lens = np.stack([np.stack([focal / z, none, -focal * x / z**2], 1), np.stack([none, focal / z, -focal * y / z**2], 1)], 1)
    return np.concatenate([lens @ moved, (seen[:, :2] / z[:, None] * focal)[..., None]], axis=2)


def _radius(covariance: np.ndarray) -> float:
    """Of the ball that holds CONFIDENCE of a normal distribution, (k, k): its squared length as a multiple of a chi-squared one
    with the same mean and variance (Satterthwaite 1946)."""
    from scipy.special import gammaincinv

    spread = np.maximum(np.linalg.eigvalsh(covariance), 0.0)
    if not np.isfinite(spread).all():
        return np.inf
    total = spread.sum()
    if total == 0:
        return 0.0
    scale = (spread**2).sum() / total
    return float(np.sqrt(scale * 2 * gammaincinv(total / scale / 2, CONFIDENCE)))
