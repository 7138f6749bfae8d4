"""The README's pictures, from the demo scan: ``.venv/bin/python .ci/readme_pictures.py [picture|animation|station|publish]``.

The picture shows the first demo camera in all four views.  The animation moves a handle across the picture, from raw to neural.
"""

import sys
from functools import cache
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from pointglass.model.common.files.atomic_write import write_atomic
from pointglass.viewer.common.paths import assets_dir
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.picture.views import VIEWS

SIZE = (640, 480)
PICTURE = Path("readme") / "four-views.jpg"
ANIMATION = Path("readme") / "handle.gif"
STATION = Path("readme") / "station.gif"
PUBLISH = Path("readme") / "publish.gif"
FRAMES = 28
"""From one side to the other; the way back is the same frames."""
FRAME_MS, REST_MS = 60, 1200
COLOURS = 256
"""Of the animation's one palette, to which both pictures are dithered once: pixels that the handle has not reached stay the
same and cost nothing."""
_LINE, _SHADOW = (245, 245, 245), (20, 20, 20)


@cache
def views_of(quality: str = "balanced", size: tuple[int, int] = SIZE) -> dict[str, np.ndarray]:
    """(H, W, 3) uint8 of each view of the first demo camera, on black.  size: width, height in pixels."""
    from pointglass.viewer.commands.demo import demo_scan
    from pointglass.viewer.grid.open_scene import open_scene
    from pointglass.viewer.picture.background import composite
    from pointglass.viewer.render.device.context import create_context
    from pointglass.viewer.render.renderer import Renderer
    from pointglass.viewer.work.cameras.camera_files import read_cameras

    context = create_context()
    renderer = Renderer(context, open_scene([demo_scan()]))
    try:
        camera = read_cameras(assets_dir() / "demo_cameras.json")[0].resized(*size)
        frame = renderer.render(camera, Settings(quality=quality), views=tuple(VIEWS))
        return {view: composite(frame.image(view)).copy() for view in VIEWS}
    finally:
        renderer.release()
        context.release()


def write_picture(path: Path, quality: str = "balanced") -> Path:
    """The four views in two rows, as JPEG."""
    from pointglass.viewer.commands.demo import contact_sheet

    pictures = list(views_of(quality).values())
    sheet = Image.fromarray(contact_sheet([pictures[:2], pictures[2:]], scale=1))
    write_atomic(path, lambda beside: sheet.save(beside, format="JPEG", quality=90))
    return path


def write_animation(path: Path, quality: str = "balanced") -> Path:
    """The handle's way from the right edge to the left and back, as an endless GIF."""
    views = views_of(quality)
    width = SIZE[0]
    share = (1 - np.cos(np.linspace(0, np.pi, FRAMES))) / 2
    columns = [round(width * (0.92 - 0.84 * s)) for s in share]
    palette = Image.fromarray(np.concatenate([views["raw"], views["neural"]])).quantize(COLOURS)
    sides = [np.asarray(Image.fromarray(views[view]).quantize(palette=palette).convert("RGB")) for view in ("raw", "neural")]
    frames = [_compared(*sides, column) for column in columns]
    still = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    loop = [*still, *still[-2:0:-1]]
    times = [FRAME_MS] * len(loop)
    times[0] = times[len(still) - 1] = REST_MS
    write_atomic(path, lambda beside: loop[0].save(
        beside, format="GIF", save_all=True, append_images=loop[1:], duration=times, loop=0, optimize=False))
    return path


def _compared(left: np.ndarray, right: np.ndarray, column: int) -> Image.Image:
    """``left`` up to a column, ``right`` from there on, with the handle and the names of both."""
    picture = Image.fromarray(np.concatenate([left[:, :column], right[:, column:]], axis=1))
    draw, height = ImageDraw.Draw(picture), picture.height
    draw.line([(column, 0), (column, height)], fill=_SHADOW, width=5)
    draw.line([(column, 0), (column, height)], fill=_LINE, width=2)
    middle, radius = height // 2, 15
    draw.ellipse([column - radius, middle - radius, column + radius, middle + radius], fill=_LINE, outline=_SHADOW)
    for side in (-1, 1):
        tip = column + side * 10
        draw.polygon([(tip, middle), (column + side * 4, middle - 5), (column + side * 4, middle + 5)], fill=_SHADOW)
    font = ImageFont.load_default(18)
    for text, anchor, x, room in (("raw", "ls", 14, column), ("neural", "rs", picture.width - 14, picture.width - column)):
        if room > 90:
            draw.text((x, height - 14), text, fill=_LINE, font=font, anchor=anchor, stroke_width=2, stroke_fill=_SHADOW)
    return picture


def main(wanted: list[str]) -> int:
    from publish_animation import write_publish_animation
    from station_animation import write_station_animation

    for name, write, path in (("picture", write_picture, PICTURE), ("animation", write_animation, ANIMATION),
                              ("station", write_station_animation, STATION), ("publish", write_publish_animation, PUBLISH)):
        if not wanted or name in wanted:
            made = write(assets_dir() / path)
            print(f"{made}: {made.stat().st_size:,} bytes")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
