"""``video --resume``: a video that was killed goes on, and has the bytes of one that was not interrupted."""

import signal
import subprocess
import sys
import time

from command_line import run_here
from dated_scans import dates_in_colour

from pointglass.viewer.commands.film.resumed_video import frames_beside
from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.work.cameras.camera_files import write_camera_path

FRAMES = 40


def test_a_video_that_was_killed_goes_on_with_the_same_line(tmp_path, seed):
    scan, path = dates_in_colour(tmp_path, seed)[0], tmp_path / "path.json"
    write_camera_path(path, [from_fov(320, 240, 70, look_at((x, -1.0, 2.5), (2.0, 2.0, 1.0)), f"{x}") for x in (0.5, 3.5)])

    def line(out):
        return ["video", str(scan), "--path", str(path), "--out", str(out), "--view", "filled", "--seconds", str(FRAMES / 10),
                "--fps", "10", "--resume"]

    out = tmp_path / "film.mp4"
    process = subprocess.Popen([sys.executable, "-m", "pointglass.viewer", *line(out)], stdout=subprocess.DEVNULL,
                               stderr=subprocess.DEVNULL)
    end = time.monotonic() + 120
    while len(list(frames_beside(out).glob("*.png"))) < 3:
        assert process.poll() is None and time.monotonic() < end, "it ended before it could be killed"
        time.sleep(0.005)
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert not out.exists() and frames_beside(out).is_dir()
    done = run_here(*line(out))
    assert done.returncode == 0, done.stderr
    assert " kept" in done.stdout and not frames_beside(out).exists()
    whole = tmp_path / "whole.mp4"
    plain = [word for word in line(whole) if word != "--resume"]
    assert run_here(*plain).returncode == 0
    assert out.read_bytes() == whole.read_bytes()
    other = [*line(out)[:-1], "--background", "sky", "--resume"]
    assert run_here(*other).returncode == 0, "a finished video is made anew"
    assert out.read_bytes() != whole.read_bytes()
