"""What a tool of the window uses of it, without a window: a wall, its camera and its depth."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pointglass.viewer.grid.open_scene import scene_from_arrays
from pointglass.viewer.grid.scene import unpack
from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.preprocess.scan_description import ScanDescription
from pointglass.viewer.window.interaction.tool import PointerEvent
from pointglass.viewer.window.session.work import DocumentState


@pytest.fixture(scope="session", name="wall")
def a_wall():
    """A wall of 4 by 3 m at y = 5, in a fine regular grid."""
    x, z = np.meshgrid(np.arange(0, 4, 0.01), np.arange(0, 3, 0.01))
    xyz = np.stack([x.ravel(), np.full(x.size, 5.0), z.ravel()], axis=1)
    return scene_from_arrays(xyz, np.full((len(xyz), 3), 90, np.uint8), meta=ScanDescription(metres_per_unit=1.0))


class _Context:
    """What tools use of a window."""

    def __init__(self, scene):
        self.scene, self.camera = scene, from_fov(400, 300, 60.0, look_at((2.0, 1.0, 1.5), (2.0, 5.0, 1.5)))
        work = DocumentState()
        work.begin([])
        work.accept()
        pixels, z = self.camera.project(unpack(scene)[0])
        depth = np.full((300, 400), np.inf, np.float32)
        column, row = np.floor(pixels).astype(int).T
        inside = (column >= 0) & (column < 400) & (row >= 0) & (row < 300)
        np.minimum.at(depth, (row[inside], column[inside]), z[inside].astype(np.float32))
        arrays = {"depth": depth, "mask": np.isfinite(depth)}
        self.viewport = SimpleNamespace(frame=object(), pixels=SimpleNamespace(read=lambda _, name, wait: arrays[name]))
        self.session = SimpleNamespace(work=work, flight=SimpleNamespace(moving=False), pointer=None,
                                       view_settings=SimpleNamespace(shown_settings=Settings(), background="sky"))
        self.toasts, self.renewed = [], 0

    @property
    def document(self):
        return self.session.work.document

    def pixels(self, length):
        return length

    def tell_saved(self, path, text=""):
        self.toast(text or f"Saved {path}")

    def toast(self, text):
        self.toasts.append(text)

    def wake(self):
        pass

    def renew_picture(self):
        self.renewed += 1

    def ray(self, position):
        along = self.camera.unproject([position], 1.0)[0] - self.camera.position
        return self.camera.position, along / np.linalg.norm(along)


def context_of(scene) -> Any:
    """A window that shows the scene, for tools: a type checker is told that it has all that a ToolContext has."""
    return _Context(scene)


@pytest.fixture(name="context")
def tool_context(wall):
    return context_of(wall)


def click(tool, context, place, button: Any = "left", clicks=1):
    (pixel,), _ = context.camera.project([place])
    for kind in ("press", "release"):
        tool.pointer(PointerEvent(kind, tuple(pixel), button=button, clicks=clicks if kind == "release" else 0), context)
