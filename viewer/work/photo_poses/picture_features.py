"""Features of pictures and their matches: SIFT of OpenCV (``pointglass[photos]``), compared as RootSIFT (Arandjelovic 2012)."""

from dataclasses import dataclass
from types import ModuleType

import numpy as np

from ...common.errors import InputError

RATIO = 0.85
"""The best match of a feature must be nearer than this share of the second best (Lowe 2004 has 0.8; the pose refuses wrong ones
later)."""
CONTRAST = 4.0
"""Limit of the local histogram equalisation, CLAHE: a usual value."""


@dataclass(frozen=True, eq=False)
class Features:
    """places: (n, 2) float64, column and row, a pixel spans [i, i + 1].  values: (n, 128) float32, unit length."""

    places: np.ndarray
    values: np.ndarray

    def chosen(self, which: np.ndarray) -> "Features":
        """Those of an index."""
        return Features(self.places[which], self.values[which])


def opencv() -> ModuleType:
    """Raises InputError where OpenCV is not installed."""
    try:
        import cv2
    except ImportError:
        raise InputError("searching where a photograph was taken needs OpenCV, which is not installed",
                         remedy="pip install 'pointglass[photos]'") from None
    return cv2


def features_of(picture: np.ndarray, most: int) -> Features:
    """The strongest features, at most ``most``.  picture: (H, W, 3) uint8 sRGB."""
    cv = opencv()
    grey = np.ascontiguousarray(picture[..., :3] @ np.array([0.299, 0.587, 0.114], np.float32)).round().astype(np.uint8)
    grey = cv.createCLAHE(CONTRAST, (8, 8)).apply(grey)  # the light of the scan may be another one
    detector = cv.SIFT_create(nfeatures=most, contrastThreshold=0.02)
    found, values = detector.detectAndCompute(grey, None)
    if values is None:
        return Features(np.empty((0, 2)), np.empty((0, 128), np.float32))
    found, values = found[:most], values[:most]
    rooted = np.sqrt(values / np.maximum(values.sum(axis=1, keepdims=True), 1e-12))
    return Features(np.array([one.pt for one in found], np.float64) + 0.5, rooted.astype(np.float32))


def matches(a: Features, b: Features, *, within: float | None = None) -> np.ndarray:
    """(n, 2) indices into a and b: of each feature of ``a`` the most similar one of ``b``, where each is the other's best and
    the second best is clearly farther.  within: pixels between their places at most; None: anywhere."""
    if len(a.values) == 0 or len(b.values) < 2:
        return np.empty((0, 2), int)
    alike = a.values @ b.values.T
    if within is not None:
        away = np.abs(a.places[:, None] - b.places[None]).max(axis=2)
        alike[away > within] = -1.0
    two = np.argpartition(-alike, 1, axis=1)[:, :2]
    scores = np.take_along_axis(alike, two, axis=1)
    best = np.where(scores[:, 0] >= scores[:, 1], two[:, 0], two[:, 1])
    first, second = scores.max(axis=1), scores.min(axis=1)
    rows = np.arange(len(best))
    apart, other = np.sqrt(np.maximum(2 - 2 * first, 0)), np.sqrt(np.maximum(2 - 2 * second, 0))
    use = (alike.argmax(axis=0)[best] == rows) & (apart < RATIO * other) & (first > 0)
    return np.stack([rows[use], best[use]], axis=1)
