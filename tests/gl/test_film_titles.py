"""Titles over films: by the command line, in any letters that a font has, with the same bytes when resumed."""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from command_line import run_here
from dated_scans import dates_in_colour
from PIL import Image

from pointglass.viewer.cli import main
from pointglass.viewer.commands.film.resumed_video import frames_beside
from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.work.cameras.camera_files import write_camera_path
from pointglass.viewer.work.document import FilmTitle

SIZE = (480, 270)


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """(scan, camera path of two keyframes, with a title and a caption at the second)."""
    folder = tmp_path_factory.mktemp("film")
    scan, path = dates_in_colour(folder, 5)[0], folder / "path.json"
    keys = [from_fov(*SIZE, 70, look_at((x, -1.0, 2.5), (2.0, 2.0, 1.0)), f"{x}") for x in (0.5, 3.5)]
    write_camera_path(path, keys, fps=10, seconds=6.0, title=FilmTitle("Halle 7\nNordflügel Ω", 2.0),
                      captions=[None, FilmTitle("<b>The end</b>", 1.5)])
    write_camera_path(folder / "plain.json", keys, fps=10, seconds=6.0)
    return scan, path


def run(*line, **environment):
    return subprocess.run([sys.executable, "-m", "pointglass.viewer", *map(str, line)], capture_output=True, text=True,
                          timeout=300, env=os.environ | environment)


def frames(folder):
    return [np.asarray(Image.open(path).convert("RGB")).astype(int) for path in sorted(folder.glob("*.png"))]


def test_titles_of_a_path_are_drawn_when_they_are_to_be_seen_and_only_there(place, tmp_path):
    scan, path = place
    for name, camera_path in (("titled", path), ("plain", path.with_name("plain.json"))):
        done = run_here("video", scan, "--path", camera_path, "--out", tmp_path / name, "--view", "raw")
        assert done.returncode == 0, done.stderr
    changed = [np.abs(one - other).max(axis=2) for one, other in
               zip(frames(tmp_path / "titled"), frames(tmp_path / "plain"), strict=True)]
    seen = [number for number, difference in enumerate(changed) if difference.any()]
    assert set(range(2, 19)) <= set(seen) <= set(range(20)) | set(range(46, 60)) and set(range(47, 59)) <= set(seen)
    rows, columns = np.nonzero(changed[10] > 60)
    assert abs(columns.mean() - SIZE[0] / 2) < 12 and abs(rows.mean() - SIZE[1] / 2) < 25, "an opening title is in the middle"
    rows, columns = np.nonzero(changed[53] > 60)
    assert rows.min() > 0.75 * SIZE[1] and columns.min() > 5 and columns.max() < 0.7 * SIZE[0], "a caption at the lower left"
    assert changed[2].max() < changed[5].max() < changed[9].max(), "it fades in"


def test_titles_of_the_command_line_replace_those_of_the_path_and_letters_without_a_font_are_named(place, tmp_path, capsys):
    scan, path = place
    line = ("video", scan, "--path", path.with_name("plain.json"), "--view", "raw", "--caption", "1=漢字 한글")
    none = run(*line, "--out", tmp_path / "none", POINTGLASS_FONTS=str(tmp_path))
    assert none.returncode == 2 and not (tmp_path / "none").exists()
    assert none.stderr.strip().splitlines()[-1].startswith("pointglass: a title cannot be drawn: no font on this machine has "
                                                           "漢 字 한 글; install a font")
    for *wrong, said in (("--caption", "3=x", "'3=x': expected N=TEXT, N from 1 to 2"), ("--caption", "²=x", "N from 1 to 2"),
                         ("--caption", "1=", "--caption: title of 0 letters"),
                         ("--title", "a", "--title-seconds", "-1", "0.1 to 600 seconds")):
        words = [*map(str, (*line[:6], "--out", tmp_path / "none")), *wrong]
        assert main(words) == 2 and said in capsys.readouterr().err
    if run_here(*line, "--out", tmp_path / "some").returncode == 0:  # a font with these letters is here
        first = frames(tmp_path / "some")[15]
        assert (first.min(axis=2) > 200).sum() > 100, "white letters"


def test_a_titled_video_that_was_killed_has_the_bytes_of_one_that_was_not_also_from_workers(place, tmp_path):
    scan, path = place

    def line(out, *more):
        return ("video", scan, "--path", path, "--out", tmp_path / out, "--view", "raw", *more)

    out = tmp_path / "film.mp4"
    process = subprocess.Popen([sys.executable, "-m", "pointglass.viewer", *map(str, line("film.mp4", "--resume"))],
                               stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    end = time.monotonic() + 120
    while len(list(frames_beside(out).glob("*.png"))) < 8:
        assert process.poll() is None and time.monotonic() < end, "it ended before it could be killed"
        time.sleep(0.005)
    process.send_signal(signal.SIGKILL)
    process.wait()
    done = run_here(*line("film.mp4", "--resume"))
    assert done.returncode == 0 and " kept" in done.stdout, done.stderr
    shared = run(*line("shared.mp4", "--workers", "2"))
    assert shared.returncode == 0, shared.stderr
    assert (tmp_path / "shared.mp4").read_bytes() == out.read_bytes()
