"""The published page in a browser, opened as a file: it draws, asks for nothing, goes from place to place, and measures
distances that are known."""

import json

import chromium
import firefox
import numpy as np
import pytest
from test_publish import EYE, OFFSET, SIZE, project, publish, room

BROWSERS = {
    name: pytest.param(module, count, id=name, marks=pytest.mark.skipif(
        module.PROGRAM is None, reason=f"no {name} on this machine (apt-get install {package})"))
    for name, module, package, count in (("chromium", chromium, "chromium", 20), ("firefox", firefox, "firefox-esr xvfb", 6))}
"""The page, and how many distances are measured in it."""
AIM = """(async () => {
  const { view } = window.pointglass, { axes, origin } = view.scene, p = %s;
  const at = [0, 1, 2].map((j) => [0, 1, 2].reduce((sum, k) => sum + axes[k][j] * (p[k] - origin[k]), 0));
  const way = at.map((v, k) => v - view.eye[k]);
  view.turn(Math.atan2(way[1], way[0]) + %f, Math.atan2(way[2], Math.hypot(way[0], way[1])) + 0.1, 60);
  await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
  const { x, y } = view.project(at);
  return [x, y];
})()"""
MADE = "window.pointglass.measuring.made.map(({ points, value, uncertainty }) => [points.length, value, uncertainty])"


def surface_point(rng):
    """A point of a wall, floor or ceiling, not beside an edge or the hole."""
    while True:
        at = 0.2 + rng.random(3) * (SIZE - 0.4)
        axis = rng.integers(0, 3)
        at[axis] = SIZE[axis] * rng.integers(0, 2)
        if axis != 0 or at[0] == 0 or (np.abs(at[1:] - (2.0, 1.3)) > 0.7).any():
            return at + OFFSET


def aimed(page, point, aside):
    """Turns so that a point, file coordinates, is in the picture, not in its middle; the pixel that shows it."""
    return [round(value) for value in page.value(AIM % (json.dumps(list(point)), aside))]


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    done = publish(project(folder, room(folder / "room.laz", 5)), "--out", folder / "site", "--view", "filled")
    assert done.returncode == 0, done.stderr
    return folder / "site"


@pytest.mark.parametrize(("browser", "distances"), BROWSERS.values())
def test_a_page_opened_as_a_file_measures_walks_and_asks_for_nothing(tmp_path, seed, site, browser, distances):
    rng = np.random.default_rng(seed)
    page = browser.Page(tmp_path / "profile")
    try:
        page.open((site / "index.html").as_uri())
        page.until("document.body && document.body.classList.contains('ready')")
        colours = page.value("(() => { const { panorama } = window.pointglass, made = document.createElement('canvas');"
                             "made.width = 64; made.height = 36; panorama.draw(-1, 0, 0); const pen = made.getContext('2d');"
                             "pen.drawImage(panorama.canvas, 0, 0, 64, 36);"
                             "return [...pen.getImageData(0, 0, 64, 36).data]; })()")
        assert np.ptp(np.reshape(colours, (-1, 4))[:, :3]) > 60  # a picture, not one colour

        page.key("m")
        page.until("window.pointglass.view.place.depth.side === window.pointglass.view.scene.small")
        hidden = "document.querySelectorAll('.note, #plan').forEach((each) => each.style.display = 'none')"
        page.value(hidden)  # they take clicks
        errors = []
        for count in range(distances):
            ends = surface_point(rng), surface_point(rng)
            for clicked, end in enumerate(ends, 1):
                page.click(*aimed(page, end, rng.uniform(-0.3, 0.3)))
                page.until(f"(({MADE})[{count}] || [0])[0] === {clicked}")
            _, value, stated = page.value(MADE)[-1]
            assert stated < 0.06
            errors.append(abs(value - np.linalg.norm(ends[1] - ends[0])) / stated)
        # 95 % of them: fewer than 17 of 20 once in 60 runs, of 6 fewer than 4 once in 450
        assert (np.array(errors) > 1).sum() <= (3 if distances == 20 else 2) and max(errors) < 3, errors
        page.click(*aimed(page, OFFSET + (6.0, 2.0, 1.3), 0.1))
        page.until("document.getElementById('message').textContent.startsWith('Nothing was measured there')")
        assert len(page.value(MADE)) == distances

        page.key("m")
        aimed(page, OFFSET + EYE + (1.6, 0.4, 0.1), 0.0)
        page.key("ArrowUp")
        page.until("window.pointglass.view.index === 1 && location.hash.startsWith('#place=2')")
        assert page.value("document.getElementById('place').textContent").startswith("</script>")
        assert page.value("document.querySelectorAll('#lists img, #overlay img, header img').length") == 0
        for shown in ("document.querySelector('#lists .given')", "document.querySelectorAll('.note')[1]"):
            page.value(f"{shown}.click()")
        page.until("document.querySelectorAll('#note-picture:not([hidden]), .length.project').length === 2")
        assert page.value("document.querySelector('.length.project').textContent").startswith("6.00")
        drawn = "document.getElementById('note-small').getContext('2d').getImageData(9, 9, 1, 1).data"
        red, _, blue = page.value(f"[...{drawn}]")[:3]
        assert red > 150 and blue < 60
        page.value("Object.assign(window.pointglass.view.scene.places[0], { around: true, yaw: 200, pitch: -40 })")
        page.value("window.pointglass.view.go(0)")  # a place around a thing: one arrives looking at it
        turned = page.value("(({ yaw, pitch }) => [Math.cos(yaw - 200 * Math.PI / 180), pitch])(window.pointglass.view)")
        assert np.allclose(turned, [1, np.radians(-40)], atol=1e-6)
        assert page.complaints == []
        folder = site.as_uri()
        outside = [address for address in page.requests if not address.startswith((folder, "data:", "blob:"))]
        assert outside == [] and (len(page.requests) >= 8 or browser is firefox)  # which names no files that it reads
    finally:
        page.close()


@pytest.mark.parametrize(("browser", "distances"), [BROWSERS["chromium"]])
def test_a_device_that_is_slow_draws_fewer_pixels_while_something_moves_and_all_at_rest(tmp_path, site, browser, distances):
    page = browser.Page(tmp_path / "profile")
    try:
        page.open((site / "index.html").as_uri())
        page.until("document.body && document.body.classList.contains('ready')")
        width = page.until("window.pointglass.panorama.canvas.width")
        page.value("(() => { const kind = WebGL2RenderingContext.prototype, draw = kind.drawElements;"
                   "kind.drawElements = function (...all) { const end = performance.now() + 300;"
                   "while (performance.now() < end); return draw.apply(this, all); }; })()")
        page.value("window.pointglass.view.speed = [0.1, 0]; window.pointglass.view.redraw()")
        page.until(f"window.pointglass.panorama.canvas.width < {0.8 * width}")
        page.value("window.pointglass.view.speed = [0, 0]")
        page.until(f"window.pointglass.panorama.canvas.width === {width}")
        page.value("new Promise((done) => setTimeout(done, 1500))")
        assert page.value("window.pointglass.panorama.canvas.width") == width, "it stays so while nothing moves"
    finally:
        page.close()
