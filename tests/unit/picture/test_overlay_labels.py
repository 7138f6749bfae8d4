"""Labels over the picture: none lies over another."""

from types import SimpleNamespace

import numpy as np

from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.window.kit.overlay import OverlayCanvas

SIZE = (64.0, 20.0)
"""Pixels of every plate."""


class Plates(OverlayCanvas):
    """Keeps the plates instead of drawing them; needs no imgui."""

    def __init__(self):
        self.camera = from_fov(640, 400, 60.0, look_at(np.zeros(3), np.array([0.0, 1.0, 0.0])))
        self.theme = SimpleNamespace(px=float)  # type: ignore[assignment]
        self.area = (0.0, 0.0, 640.0, 400.0)
        self.plates = {}

    def place(self, points):
        pixels, depths = self.camera.project(points)
        return pixels, depths > 0

    def _plate(self, at, text, align):
        return at[0] - align[0] * SIZE[0], at[1] - align[1] * SIZE[1], *SIZE

    def text(self, at, text, colour="text", *, align=(0.0, 0.0)):
        self.plates[text] = self._plate(at, text, align)


def test_labels_never_cover_each_other_and_the_nearest_point_has_one(seed):
    rng = np.random.default_rng(seed)
    for spread in (0.02, 0.2, 1.0):
        overlay, points = Plates(), np.array([0.0, 3.0, 0.0]) + rng.normal(0.0, spread, (12, 3)).clip(-2.5, 2.5)
        overlay.labels(points, [str(number) for number in range(12)])
        plates = list(overlay.plates.values())
        pixels = overlay.place(points)[0]
        seen = np.flatnonzero(((pixels >= 0) & (pixels <= (640, 400))).all(axis=1))
        assert not len(seen) or str(seen[points[seen, 1].argmin()]) in overlay.plates
        for number, (x, y, _, _) in enumerate(plates):
            assert all(abs(x - a) >= SIZE[0] or abs(y - b) >= SIZE[1] for a, b, _, _ in plates[:number])
        if spread == 1.0:
            assert len(plates) >= min(len(seen), 4), "points that lie apart have theirs"
