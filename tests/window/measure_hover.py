"""Milliseconds of the main thread a frame while the pointer moves over a picture at rest, with readings of the picture that are
waited for and with those that are not, in turns: ``python measure_hover.py FOLDER`` under an X server."""

import sys
import time
from pathlib import Path

import numpy as np
from driver import Driver, middle

TURNS, MOVES = 6, 30


def main(folder: Path) -> None:
    from pointglass.viewer.window.interaction.inspect_point import UnderPointer

    d = Driver(folder)
    d.resize(1280, 720)
    d.drop(Path("room7"))
    d.until(lambda: d.session.loads.current is None and d.session.scene is not None and not d.session.shown_scan.preview)
    d.rest()
    reader, spent = d.app.viewport.pixels, []
    usual, follow = reader.read, UnderPointer.follow

    def timed(self, context):
        start = time.perf_counter()
        follow(self, context)
        spent.append(1e3 * (time.perf_counter() - start))

    UnderPointer.follow = timed
    rng = np.random.default_rng(1)
    found: dict[str, list] = {"waits": [], "waits not": []}
    for turn in range(2 * TURNS):
        kind = list(found)[turn % 2]
        reader.read = (lambda *a, wait=False, **k: usual(*a, wait=True, **k)) if kind == "waits" else usual
        for _ in range(MOVES):
            d.session.picture.dirty = True  # each pointer movement meets a new picture
            d.app.step(wait=False)
            for _ in range(3):
                x, y = middle(d, *rng.uniform(-0.4, 0.4, 2))
                d.app.input.on_enter(d.app.window, 1)
                d.app.input.on_pointer(d.app.window, x, y)
                spent.clear()
                start = time.perf_counter()
                d.app.step(wait=False)
                found[kind].append((1e3 * (time.perf_counter() - start), sum(spent), d.session.point is not None))
    for kind, rows in found.items():
        whole, tool, there = np.array(rows, float).T
        print(f"{kind}: frame median {np.median(whole):.2f} p95 {np.percentile(whole, 95):.2f}; point under the pointer median "
              f"{np.median(tool):.3f} p95 {np.percentile(tool, 95):.3f} max {tool.max():.3f} ms; found {there.mean():.2f}")
    d.app.close()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
