"""The demo: the shipped scan in a window where there is a display, else pictures of it in all four views."""

import os
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..common.errors import InputError
from ..common.files import out_folder, write_png
from ..common.paths import assets_dir
from ..picture.settings import Settings
from ..picture.views import VIEWS

if TYPE_CHECKING:
    from ..picture.camera import Camera


def demo_scan() -> Path:
    """The shipped scan.  Raises InputError where it is missing."""
    path = assets_dir() / "demo.laz"
    if not path.is_file():
        raise InputError("the demo scan is not there", file=path, remedy="make it with `make assets`")
    return path


def demo_camera() -> "Camera":
    """The first of the shipped cameras, the start viewpoint of the demo."""
    from ..work.cameras.camera_files import read_cameras

    return read_cameras(assets_dir() / "demo_cameras.json")[0]


def has_display() -> bool:
    """Whether a window can be expected to open."""
    return sys.platform in ("darwin", "win32") or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def contact_sheet(rows: list[list[np.ndarray]], scale: int = 2, gap: int = 4) -> np.ndarray:
    """Pictures (H, W, 3) uint8 side by side and in rows, each reduced ``scale`` times by averaging blocks of pixels."""

    def small(image: np.ndarray) -> np.ndarray:
        h, w = image.shape[0] // scale * scale, image.shape[1] // scale * scale
        blocks = image[:h, :w, :3].reshape(h // scale, scale, w // scale, scale, 3)
        return blocks.mean(axis=(1, 3)).round().astype(np.uint8)

    tiles = [[small(image) for image in row] for row in rows]
    height, width = tiles[0][0].shape[:2]
    sheet = np.full((len(rows) * (height + gap) + gap, len(rows[0]) * (width + gap) + gap, 3), 24, np.uint8)
    for r, row in enumerate(tiles):
        for c, tile in enumerate(row):
            y, x = gap + r * (height + gap), gap + c * (width + gap)
            sheet[y : y + height, x : x + width] = tile
    return sheet


def demo_pictures(out: Path, settings: Settings) -> list[Path]:
    """Renders the shipped cameras in every view into ``out``, with one contact sheet.  Returns the files, it first."""
    from ..common.progress import progress
    from ..grid.open_scene import open_scene
    from ..picture.spec import PictureSpec
    from ..render.device.context import create_context
    from ..render.renderer import Renderer
    from ..work.cameras.camera_files import read_cameras
    from ..work.pictures.shot_metadata import KEY, cannot_repeat, describe_shot

    scene = open_scene([demo_scan()])
    cameras = read_cameras(assets_dir() / "demo_cameras.json")
    renderer = Renderer(create_context(), scene)
    files, rows = [], []
    try:
        with out_folder(out), progress(len(cameras), "rendering the demo", "camera") as meter:
            for camera in cameras:
                frame = renderer.render(camera, settings, views=tuple(VIEWS))
                pictures = [frame.image(view)[..., :3] for view in VIEWS]
                for view, picture in zip(VIEWS, pictures, strict=True):
                    named = replace(camera, name=f"{camera.name}-{view}")
                    spec = PictureSpec(named, settings, (view,), background="black")
                    shot = describe_shot(scene, spec, exposures="matched").drawn_with(renderer.choice.timed)
                    files.append(out / f"{named.name}.png")
                    write_png(files[-1], picture, {KEY: shot.text()})
                rows.append(pictures)
                meter.update(1)
    finally:
        renderer.release()
    sheet = out / "contact-sheet.png"
    write_png(sheet, contact_sheet(rows), cannot_repeat("a sheet of several pictures"))
    return [sheet, *files]
