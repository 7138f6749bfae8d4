"""The README's animation of a station photograph: it slides into the neural view, and the camera walks away from the tripod.

The demo scan is drawn, and the photograph is traced in the place that the scan was made from:
``.venv/bin/python .ci/readme_pictures.py station``.
"""

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from pointglass.model.common.files.atomic_write import write_atomic
from pointglass.viewer.picture.settings import Settings

SIZE = (480, 320)
PHOTO = (1024, 512)
"""Pixels of the spherical photograph."""
SLIDE, WALK = 14, 22
"""Frames of the line's way across the picture, and of the walk."""
AWAY = np.array([1.3, -0.9, 0.05])
"""Metres walked from the tripod."""
TARGET = np.array([1.25, 1.0, 0.92])
FRAME_MS, REST_MS = 90, 1300
COLOURS = 128
_LINE, _SHADOW = (245, 245, 245), (20, 20, 20)


def photograph():
    """The spherical photograph of the demo's first station, two rays a pixel side, as viewer.readers gives it."""
    from pointglass.model.common.linear_light import to_linear, to_srgb
    from pointglass.model.synth.demo import STATIONS
    from pointglass.model.synth.place import Place
    from pointglass.viewer.readers.photographs.posed_photograph import PosedPhotograph

    place, (width, height) = Place(1), PHOTO
    light = np.zeros((height, width, 3))
    for du, dv in ((0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)):
        azimuth = (width / 2 - np.arange(width) - du) * 2 * np.pi / width
        elevation = (height / 2 - np.arange(height) - dv) * np.pi / height
        level = np.cos(elevation)[:, None]
        rays = np.stack(np.broadcast_arrays(level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)[:, None]), -1)
        rays = rays.reshape(-1, 3)
        light += to_linear(place.trace(np.broadcast_to(STATIONS[0], rays.shape).copy(), rays).rgb).reshape(height, width, 3)
    picture = np.round(to_srgb(light / 4) * 255).astype(np.uint8)
    pose = np.eye(4)
    pose[:3, 3] = STATIONS[0]
    lens = width / (2 * np.pi), height / np.pi, width / 2, height / 2
    return PosedPhotograph("station 1", "spherical", width, height, lens, True, pose, lambda _: (picture, None))


def write_station_animation(path: Path, quality: str = "balanced") -> Path:
    """Photograph, line across, neural view, walk: as an endless GIF."""
    from pointglass.viewer.commands.demo import demo_scan
    from pointglass.viewer.grid.open_scene import open_scene
    from pointglass.viewer.picture.background import composite
    from pointglass.viewer.picture.camera import from_fov, look_at
    from pointglass.viewer.preprocess.closed_depth import filled_depth
    from pointglass.viewer.render.device.context import create_context
    from pointglass.viewer.render.photographs.lone_photograph import photograph_alone
    from pointglass.viewer.render.renderer import Renderer
    from pointglass.viewer.window.viewport.photo_blend import blended, strength

    photo, context = photograph(), create_context()
    scene = open_scene([demo_scan()])
    renderer = Renderer(context, scene)
    pool = renderer.photographs.alone(photo, wait=True)
    assert pool is not None
    frames: list[Image.Image] = []
    try:
        for share in (1 - np.cos(np.linspace(0, np.pi, WALK))) / 2:
            eye = photo.position + share * AWAY
            camera = from_fov(*SIZE, 64.0, look_at(eye, TARGET))
            frame = renderer.render(camera, Settings(quality=quality), views=("neural",))
            view, depth = frame.image("neural"), filled_depth(frame.depth())
            shown = photograph_alone(depth, camera, pool, 0, hides=share > 0)
            if share == 0:
                for column in np.linspace(SIZE[0], SIZE[0] * 0.5, SLIDE).round().astype(int):
                    picture = composite(blended(view, shown, 1.0, split=int(column)))
                    frames.append(_labelled(picture, int(column), "neural view"))
            column = round(SIZE[0] * (0.5 - 0.5 * min(2 * share, 1.0)))
            kept = strength(float(np.linalg.norm(eye - photo.position)), 1.0, 1.0)
            picture = composite(blended(view, shown, kept, split=column))
            frames.append(_labelled(picture, column, "neural view, walking away"))
    finally:
        renderer.release()
        context.release()
    palette = Image.fromarray(np.concatenate([np.asarray(frames[k]) for k in (0, SLIDE, -1)])).quantize(COLOURS)
    made = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    times = [FRAME_MS] * len(made)
    times[0] = times[SLIDE] = times[-1] = REST_MS
    write_atomic(path, lambda beside: made[0].save(
        beside, format="GIF", save_all=True, append_images=made[1:], duration=times, loop=0, optimize=False))
    return path


def _labelled(picture: np.ndarray, column: int, right: str) -> Image.Image:
    """The line at a column, and the names of both sides where there is room."""
    made = Image.fromarray(picture)
    draw, height, font = ImageDraw.Draw(made), made.height, ImageFont.load_default(15)
    if 0 < column < made.width:
        draw.line([(column, 0), (column, height)], fill=_SHADOW, width=4)
        draw.line([(column, 0), (column, height)], fill=_LINE, width=2)
    for text, anchor, x, room in (("photograph", "ls", 10, column), (right, "rs", made.width - 10, made.width - column)):
        if room > draw.textlength(text, font) + 16:
            draw.text((x, height - 10), text, fill=_LINE, font=font, anchor=anchor, stroke_width=2, stroke_fill=_SHADOW)
    return made
