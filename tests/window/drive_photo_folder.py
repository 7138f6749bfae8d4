"""``pointglass SCAN --photos FOLDER`` in a real window: a folder with cameras, one without."""

import json
import sys
from pathlib import Path
from time import perf_counter
from unittest.mock import patch

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "unit"))

from e57_photo_files import pinhole, room_points, turn, write_photos

from pointglass.viewer.cli import main
from pointglass.viewer.window.flight.navigation import view_along
from pointglass.viewer.window.interaction.film.film_job import FilmJob, film_worker
from pointglass.viewer.window.interaction.stations.photo_placer import PhotoPlacer
from pointglass.viewer.window.interaction.stations.stations_tool import Stations
from pointglass.viewer.window.shell import run_window

SECONDS = 200.0


def opened(arguments, steps) -> int:
    """The exit code of the command.  steps: a generator function of the App, which waits by yielding until a thing is true; the
    window is closed at its end."""

    class Driven(run_window.App):
        def step(self):
            super().step()
            if not hasattr(self, "steps"):
                self.steps, self.wanted, self.begun = steps(self), None, perf_counter()
            assert perf_counter() - self.begun < SECONDS, "nothing more happens"
            self.wake()
            if self.wanted is None or self.wanted():
                self.wanted = next(self.steps, None)
                if self.wanted is None:
                    self.glfw.set_window_should_close(self.window, True)

    with patch.object(run_window, "App", Driven):
        return main([*map(str, arguments), "--view", "filled"])


def run(folder: Path) -> None:
    scan = write_photos(folder / "room.e57", [], *room_points(80_000))
    taken, plain, seen = folder / "taken", folder / "plain", []
    for inside in (taken, plain):
        inside.mkdir()
    frames = []
    for number in range(2):
        photo = pinhole((0.4, -0.3, 0.2), 0.6 + number, size=(480, 360), fl=290.0, coding="jpeg")
        data = next(iter(photo.blobs.values()))
        (taken / f"{number}.jpg").write_bytes(data)
        (plain / f"{number}.jpg").write_bytes(data)
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = turn(0.6 + number)[0], photo.translation
        frames.append({"file_path": f"{number}.jpg", "w": 480, "h": 360, "fl_x": 290.0, "transform_matrix": pose.tolist()})
    (taken / "transforms.json").write_text(json.dumps({"frames": frames}))

    def with_cameras(app):
        session = app.session
        yield lambda: session.scene is not None and session.loads.current is None and app.viewport.frame is not None
        stations = next(tool for tool in app.toolbox.tools if isinstance(tool, Stations))
        app.toolbox.select("stations", app.tools)
        yield lambda: len(stations.photos) == 2
        session.flight.go(view_along(stations.photos[0].position, stations.photos[0].forward, 1.0))
        yield lambda: bool(app.viewport.frame.facts.photographs)
        assert session.notices.message is None
        cameras, settings = (session.screen.camera.resized(160, 90),) * 2, session.view_settings.settings
        job = film_worker(FilmJob(session.scene, cameras, 2.0, settings, folder / "film.mp4"), lambda: None)
        yield lambda: job.finished
        assert job.error is None and (folder / "film.mp4").is_file(), job.error
        session.view_settings.show_photographs(False)
        yield lambda: not app.viewport.frame.facts.photographs
        session.view_settings.show_photographs(True)
        yield lambda: bool(app.viewport.frame.facts.photographs)
        seen.append("photographs")

    assert opened([scan, "--photos", taken], with_cameras) == 0

    def without_cameras(app):
        yield lambda: seen[1:] and app.viewport.frame is not None
        assert app.session.notices.message is None

    with patch.object(PhotoPlacer, "search", lambda _self, _context, found: seen.extend(photo.path for photo in found())):
        assert opened([scan, "--photos", plain], without_cameras) == 0
    assert seen == ["photographs", str(plain / "0.jpg"), str(plain / "1.jpg")]
    assert main([str(scan), "--photos", str(folder / "nowhere")]) == 2


if __name__ == "__main__":
    run(Path(sys.argv[1]))
