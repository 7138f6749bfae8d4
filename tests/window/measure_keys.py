"""Milliseconds from a key event to the first picture on the screen that knows of it, while a long job runs:
``python measure_keys.py FOLDER SCAN JOB [SEED]`` under an X server.  JOB: none, film, publish, fit, compare, convert or align.

48 keys that change the interface, the view or the picture, .4 to 1 s apart, sent through XTEST by another process to a window
of 1280x720 pixels in its usual settings (the neural view).  The clock stops when ``glfwSwapBuffers`` returns for a frame that
was begun after the event arrived.
"""

import contextlib
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

KEYS = ["i", "Escape", "t", "Escape", "1", "2", "3", "4", "v", "v", "F1", "F1", "F3", "F3", "n", "Escape"] * 3


def start_job(app, job: str, folder: Path) -> list:
    """Starts a long job beside the window; returns its workers."""
    from pointglass.viewer.common.errors import PointglassError
    from pointglass.viewer.picture.settings import Settings
    from pointglass.viewer.window.kit.worker import BESIDE, Worker

    session, wake = app.session, app._wake_loop
    scene, document, camera = session.scene, session.document, session.camera
    if job == "film":
        from pointglass.viewer.window.interaction.film.film_job import FilmJob, film_worker

        cameras = tuple(camera for _ in range(500))
        return [film_worker(FilmJob(scene, cameras, 25.0, Settings(view="neural"), folder / "film.mp4"), wake)]
    if job == "publish":
        from pointglass.viewer.window.interaction.film.publish_plan import planned

        def plans() -> None:
            while True:
                planned(scene, document, Settings(view="neural"), 4, 1024)

        return [Worker(plans, "Publishing", wake, niceness=BESIDE)]
    if job == "fit":
        from pointglass.viewer.grid.scene import unpack
        from pointglass.viewer.work.fits.fit import fit_at

        places = np.random.default_rng(0).permutation(unpack(scene)[0])

        def fits() -> None:
            for place in places:
                with contextlib.suppress(PointglassError):
                    fit_at(scene, tuple(place.tolist()), "plane")

        return [Worker(fits, "Fitting", wake)]
    if job == "compare":
        from pointglass.viewer.grid.scene import unpack
        from pointglass.viewer.work.comparing.compare import compare
        from pointglass.viewer.work.comparing.facing import facing_of

        xyz, rng = unpack(scene)[0], np.random.default_rng(0)

        def comparisons() -> None:
            while True:
                after = xyz + rng.normal(0, 0.002, xyz.shape)
                compare(xyz, after, facing_of(xyz, np.full((1, 3), np.nan), xyz.mean(axis=0)[None]))

        return [Worker(comparisons, "Comparing", wake, niceness=BESIDE)]
    if job == "convert":
        from pointglass.viewer.window.planning.opened_ahead import open_scene

        def conversions() -> None:
            while True:
                open_scene(list(session.shown_scan.paths), cache=False)

        return [Worker(conversions, "Opening a scan", wake)]
    if job == "align":
        from pointglass.viewer.grid.scene import unpack
        from pointglass.viewer.work.registration.align_surfaces import align_surfaces

        xyz = unpack(scene)[0]

        def alignments() -> None:
            while True:
                align_surfaces(xyz[::2] + [0.05, -0.03, 0.02], xyz[1::2])

        return [Worker(alignments, "Aligning", wake, niceness=BESIDE)]
    return []


def show(ms) -> str:
    return f"p50 {np.percentile(ms, 50):.0f} p95 {np.percentile(ms, 95):.0f} max {np.max(ms):.0f}" if len(ms) else "none"


def main(folder: Path, scan: Path, job: str, seed: int = 1) -> None:
    import glfw

    from pointglass.viewer.picture.settings import Settings
    from pointglass.viewer.window.shell.app import App

    app = App(Settings(view="filled"), size=(1280, 720), folder=folder, scale=1.0)
    pressed, answered, spans = [], [], {"paint": [], "draw": [], "swap": []}
    usual_key, usual_swap, usual_draw, usual_paint = app.input.on_key, glfw.swap_buffers, app._draw, app.viewport.paint

    def on_key(window, key, scancode, action, mods):
        if action == glfw.PRESS:
            pressed.append(time.perf_counter())
        usual_key(window, key, scancode, action, mods)

    begun = [0.0]

    def draw(*a, **k):
        begun[0] = start = time.perf_counter()
        usual_draw(*a, **k)
        spans["draw"].append((start, time.perf_counter()))

    def swap(window):
        start = time.perf_counter()
        usual_swap(window)
        now = time.perf_counter()
        spans["swap"].append((start, now))
        while len(answered) < len(pressed) and pressed[len(answered)] <= begun[0]:
            answered.append(now)

    def paint(*a, **k):
        start = time.perf_counter()
        usual_paint(*a, **k)
        spans["paint"].append((start, time.perf_counter()))

    app._draw, glfw.swap_buffers, app.viewport.paint = draw, swap, paint
    glfw.set_key_callback(app.window, on_key)
    app.open([scan])
    session = app.session

    def run(condition, seconds=120.0):
        end = time.perf_counter() + seconds
        while not condition() and time.perf_counter() < end:
            app.step()

    run(lambda: session.loads.current is None and session.scene is not None and not session.shown_scan.preview)
    app.act("view_neural")
    run(lambda: not session.screen.refining)
    workers = start_job(app, job, folder)
    end = time.perf_counter() + 6
    run(lambda: time.perf_counter() > end)
    glfw.focus_window(app.window)
    load = os.getloadavg()[0]
    sender = subprocess.Popen([sys.executable, str(Path(__file__).with_name("send_keys.py")), ".4", "1", str(seed), *KEYS],
                              stdout=subprocess.PIPE, text=True)
    begin = time.perf_counter()
    run(lambda: sender.poll() is not None and len(answered) == len(KEYS), 150)
    end = time.perf_counter()
    sent = [float(line) for line in sender.stdout]
    n = min(len(sent), len(answered))
    late = 1e3 * (np.array(answered[:n]) - np.array(sent[:n]))
    arrive = 1e3 * (np.array(pressed[:n]) - np.array(sent[:n]))
    print(f"{job}: {n} keys answered in ms: {show(late)}; arrived after {show(arrive)}; "
          f"load {load:.1f} to {os.getloadavg()[0]:.1f}")
    for name, rows in spans.items():
        took = [1e3 * (b - a) for a, b in rows if a > begin and b < end]
        print(f"   {name} x{len(took)}: {show(took)}")
    worst = np.argsort(-late)[:8]
    print("   worst:", ", ".join(f"{KEYS[k]} {late[k]:.0f}({arrive[k]:.0f})" for k in worst))
    for worker in workers:
        print("   job:", worker.label, worker.done, worker.total, worker.error or "", "ended" if worker.finished else "goes on")
    sys.stdout.flush()
    os._exit(0)  # the job goes on


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3], *map(int, sys.argv[4:5]))
