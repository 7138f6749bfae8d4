"""The README's animation of a published room in a browser: a turn, a hop to another place, a measurement.

Needs Chromium: ``.venv/bin/python .ci/readme_pictures.py publish``.  The page's clock is stepped, so that a slow machine shows
the same pictures as a fast one.
"""

import base64
import io
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from pointglass.model.common.files.atomic_write import write_atomic

ROOT = Path(__file__).resolve().parents[1]
WINDOW, SIZE = (800, 500), (512, 320)
"""Pixels of the window, and of the animation."""
FRAME_MS, REST_MS = 70, 1300
MOVED_MS = 300
"""Milliseconds of the page's hop (HOP in viewer/commands/publishing/web/src/view.ts)."""
COLOURS = 256
TURN, HOP, CLICK = 9, 8, 2
"""Frames of a turn and a hop, and of the pointer before a click."""
START, LOOK = (2, 10.0, -8.0), (3, 178.0, -4.0)
"""Place, from 1, heading and pitch in degrees at which it begins; the place gone to and how one looks there."""
ENDS = (0.196, 0.37), (0.484, 0.37)
"""Where the ends of the measured distance are clicked, in shares of the window."""
_CLOCK = """(() => { let now = performance.now(); performance.now = () => now; window.tick = (by) => { now += by;
  window.pointglass.view.redraw(); return new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))); };
  window.pointglass.view.pace = () => undefined; })()"""


def published(folder: Path) -> Path:
    """The demo scan, in metres, published into a folder."""
    from pointglass.viewer.cli import main
    from pointglass.viewer.commands.demo import demo_scan
    from pointglass.viewer.work.document import Document, ScanFile
    from pointglass.viewer.work.project import write_project

    scan = ScanFile(str(demo_scan()), metres_per_unit=1.0)
    write_project(folder / "demo.pointglass", Document(scans=(scan,)))
    site = folder / "site"
    if code := main(["publish", str(folder / "demo.pointglass"), "--out", str(site), "--title", "Demo room"]):
        raise SystemExit(code)
    return site


def frames_of(site: Path, profile: Path) -> Iterator[tuple[Image.Image, int]]:
    """(Picture, milliseconds that it is shown)."""
    sys.path.insert(0, str(ROOT / "tests" / "gl"))
    from chromium import Page

    place, yaw, pitch = START
    page = Page(profile, *WINDOW)

    def shot(pointer: tuple[float, float] | None = None) -> Image.Image:
        image = Image.open(io.BytesIO(base64.b64decode(page.screenshot()))).convert("RGB")
        if pointer is not None:
            _draw_pointer(image, pointer)
        return image.resize(SIZE, Image.Resampling.LANCZOS)

    try:
        page.open(f"{(site / 'index.html').as_uri()}#place={place}&yaw={yaw}&pitch={pitch}&fov=75")
        page.until("document.body && document.body.classList.contains('ready')")
        page.until("window.pointglass.view.place.whole !== null", 120)
        visits = "window.pointglass.view.visits"
        page.value(f"{visits}.get({LOOK[0] - 1}).then((place) => {visits}.full(place))")
        page.value(_CLOCK)
        yield shot(), REST_MS
        target = page.value(f"""(() => {{ const {{ view }} = window.pointglass, p = view.scene.places[{LOOK[0] - 1}].position;
            return Math.atan2(p[1] - view.eye[1], p[0] - view.eye[0]) * 180 / Math.PI; }})()""")
        away = (target - yaw + 180) % 360 - 180
        for share in _eased(TURN):
            heading = np.radians(yaw + share * away)
            page.value(f"window.pointglass.view.turn({heading}, {np.radians(pitch)}), tick({FRAME_MS})")
            yield shot(), FRAME_MS
        x, y = page.value(f"""(() => {{ const {{ view }} = window.pointglass, place = view.scene.places[{LOOK[0] - 1}];
            const on = view.project([place.position[0], place.position[1], place.floor]); return [on.x, on.y]; }})()""")
        for _ in range(CLICK):
            yield shot((x, y)), 2 * FRAME_MS
        page.value(f"void window.pointglass.view.go({LOOK[0] - 1}), tick(0)")
        page.until("window.pointglass.view.moving")
        while page.value("window.pointglass.view.going"):
            page.value(f"tick({MOVED_MS / HOP})")
            yield shot(), FRAME_MS
        away = (LOOK[1] - target + 180) % 360 - 180
        for share in _eased(TURN):
            heading, slope = np.radians([target + share * away, pitch + share * (LOOK[2] - pitch)])
            page.value(f"window.pointglass.view.turn({heading}, {slope}), tick({FRAME_MS})")
            yield shot(), FRAME_MS
        page.value("window.pointglass.measuring.turn(true)")
        for number, (across, down) in enumerate(ENDS):
            at = across * WINDOW[0], down * WINDOW[1]
            page.click(*at)
            page.until(f"(window.pointglass.measuring.made[0]?.points.length ?? 0) === {number + 1}")
            page.value(f"tick({FRAME_MS})")
            yield shot(at), REST_MS if number == 0 else 2 * REST_MS
    finally:
        page.close()


def _eased(count: int) -> np.ndarray:
    return (1 - np.cos(np.linspace(0, np.pi, count + 1)[1:])) / 2


def _draw_pointer(image: Image.Image, at: tuple[float, float]) -> None:
    """An arrow, whose tip is at a position."""
    arrow = [(0, 0), (0, 21), (5, 16), (9, 24), (13, 22), (9, 14), (16, 14)]
    points = [(at[0] + x, at[1] + y) for x, y in arrow]
    ImageDraw.Draw(image).polygon(points, fill=(255, 255, 255), outline=(20, 20, 20), width=2)


def write_publish_animation(path: Path, _quality: str = "") -> Path:
    """The page in a browser, as an endless GIF."""
    with tempfile.TemporaryDirectory() as folder:
        site = published(Path(folder))
        frames, times = zip(*frames_of(site, Path(folder) / "profile"), strict=True)
    together = Image.fromarray(np.concatenate([np.asarray(frame) for frame in frames[:: max(1, len(frames) // 6)]]))
    palette = together.quantize(COLOURS, kmeans=3)
    still = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    write_atomic(path, lambda beside: still[0].save(
        beside, format="GIF", save_all=True, append_images=still[1:], duration=list(times), loop=0, optimize=False))
    return path
