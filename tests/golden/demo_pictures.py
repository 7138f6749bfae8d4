"""Golden pictures: the demo scan from two of its cameras in all views, as software OpenGL draws them.

    make golden        renders them again into tests/golden; look at them before they are committed

tests/gl/test_golden.py compares with them.
"""

from pathlib import Path

import numpy as np
from PIL import Image

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
SIZE = (200, 150)
CAMERAS = 2


def render(context) -> dict[str, np.ndarray]:
    """Name of a golden picture -> (H, 4 W, 4) uint8: raw, filtered, filled and neural, side by side."""
    from pointglass.viewer.grid.open_scene import open_scene
    from pointglass.viewer.picture.settings import Settings
    from pointglass.viewer.picture.views import VIEWS
    from pointglass.viewer.render.renderer import Renderer
    from pointglass.viewer.work.cameras.camera_files import read_cameras

    cameras = read_cameras(ROOT / "assets" / "demo_cameras.json", size=SIZE)
    renderer = Renderer(context, open_scene([ROOT / "assets" / "demo.laz"]))
    try:
        made = {}
        for camera in cameras[:: max(1, len(cameras) // CAMERAS)][:CAMERAS]:
            frame = renderer.render(camera, Settings(device="cpu", precision="fp32"), views=tuple(VIEWS))
            made[f"demo-{camera.name}.png"] = np.concatenate([frame.image(view) for view in VIEWS], axis=1)
        return made
    finally:
        renderer.release()


def difference(made: np.ndarray, golden: np.ndarray) -> np.ndarray:
    """Absolute difference, eight times as strong, under what was made and what was expected: (3 H, W, 3) uint8."""
    strong = np.clip(8 * np.abs(made[..., :3].astype(int) - golden[..., :3]), 0, 255).astype(np.uint8)
    return np.concatenate([made[..., :3], golden[..., :3], strong])


def main() -> None:
    from pointglass.viewer.render.device.context import create_context

    for name, picture in render(create_context()).items():
        Image.fromarray(picture).save(HERE / name, optimize=True)
        print(HERE / name)


if __name__ == "__main__":
    main()
