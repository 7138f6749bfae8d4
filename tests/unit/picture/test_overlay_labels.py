"""Labels over the picture: none lies over another."""

from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np

from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.window.kit import overlay as kit_overlay
from pointglass.viewer.window.kit.overlay import OverlayCanvas

SIZE = (64.0, 20.0)
"""Pixels of every plate."""


class Plates(OverlayCanvas):
    """Keeps the plates instead of drawing them; needs no imgui."""

    def __init__(self):
        camera = from_fov(640, 400, 60.0, look_at(np.zeros(3), np.array([0.0, 1.0, 0.0])))
        super().__init__(Mock(), camera, SimpleNamespace(px=float), (0.0, 0.0, 640.0, 400.0))  # type: ignore[arg-type]
        self.plates = {}

    def _plate(self, at, text, align):
        return at[0] - align[0] * SIZE[0], at[1] - align[1] * SIZE[1], *SIZE

    def text(self, at, text, colour="text", *, align=(0.0, 0.0)):
        self.plates[text] = self._plate(at, text, align)
        self._taken.append(self.plates[text])


def test_labels_never_cover_each_other_or_a_mark_and_the_nearest_point_has_one(seed, monkeypatch):
    """Those of measurements and of notes are asked for apart, before the marks of the notes are drawn."""
    for name in ("_shade", "packed"):
        monkeypatch.setattr(kit_overlay, name, lambda *_: 0)  # imgui's colours need its context
    rng = np.random.default_rng(seed)
    for spread in (0.02, 0.2, 1.0):
        overlay, points = Plates(), np.array([0.0, 3.0, 0.0]) + rng.normal(0.0, spread, (12, 3)).clip(-2.5, 2.5)
        pixels, seen = overlay.place(points)
        overlay.labels(points, [str(number) for number in range(12)])
        overlay.labels(points[:4], [f"note {number}" for number in range(4)])
        for number in np.flatnonzero(seen[:4]).tolist():
            overlay.mark(pixels[number], "warn", 6.0, "block")
        assert not overlay.plates
        overlay.end()
        plates = list(overlay.plates.values())
        for number, (x, y, _, _) in enumerate(plates):
            assert all(abs(x - a) >= SIZE[0] or abs(y - b) >= SIZE[1] for a, b, _, _ in plates[:number])
            for a, b in pixels[:4][seen[:4]]:
                assert not (x - 6 < a < x + SIZE[0] + 6 and y - 6 < b < y + SIZE[1] + 6), "no mark is covered"
        if spread == 1.0:
            assert len(plates) >= min(seen.sum(), 4), "points that lie apart have theirs"
            if seen.any():
                assert str(np.flatnonzero(seen)[points[seen, 1].argmin()]) in overlay.plates
