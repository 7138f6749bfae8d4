"""``info --plan``: the index page of several files: outlines where the points are, in the scale that it states."""

import os
import re
from datetime import datetime
from html import unescape
from pathlib import Path

import numpy as np
from cloud_files import write_las
from command_line import run_here

from pointglass.viewer.commands.publishing.overview_page import overview_page
from pointglass.viewer.commands.publishing.places import Place
from pointglass.viewer.grid.open_scene import open_scene

ROOT = Path(__file__).resolve().parents[3]
HOSTILE = "</title><script>alert(1)<"


def floor(folder, name, inside, rng, number=30_000):
    """A flat file of points of 8 x 8 units at (4e5, 5e6) for which ``inside`` holds."""
    flat = rng.random((number, 2)) * 8
    flat = flat[inside(*flat.T)]
    return write_las(folder / name, np.column_stack([flat, np.zeros(len(flat))]) + [4e5, 5e6, 100.0],
                     rng.integers(1, 256, (len(flat), 3)))


def info(*arguments):
    return run_here("info", *arguments)


def found(pattern: str, page: str) -> re.Match[str]:
    match = re.search(pattern, page)
    assert match is not None, pattern
    return match


def rings_of(page: str, number: int) -> list[np.ndarray]:
    path = found(rf'id="file{number}"><path d="([^"]+)"', page)
    return [np.array([pair.split(" ") for pair in ring.split("L")], float) for ring in path[1].strip("MZ").split("ZM")]


def area(ring: np.ndarray) -> float:
    """With a sign: rings around holes turn the other way."""
    x, y = ring.T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def test_outlines_names_and_dates_are_those_of_the_files(tmp_path, monkeypatch, seed):
    monkeypatch.setenv("POINTGLASS_CACHE", str(tmp_path / "cache"))
    rng = np.random.default_rng(seed)
    files = [floor(tmp_path, "square.laz", lambda x, y: (x < 3) & (y < 3), rng),
             floor(tmp_path, "ring.laz", lambda x, y: (np.maximum(x, y) > 4) & ~((abs(x - 6.5) < 1) & (abs(y - 6.5) < 1)), rng),
             floor(tmp_path, "a&b.laz", lambda x, y: (x > 7) & (y < 1), rng)]
    os.utime(files[0], (1e9, 1e9))
    plan = tmp_path / "plan.html"
    done = info(*files, "--plan", plan)
    assert done.returncode == 0 and "points" in done.stdout, done.stderr
    page = plan.read_text("utf-8")
    end, length = found(r'd="M14 [\d.]+H([\d.]+)"/><text[^>]+>([\d.]+) units<', page).groups()
    scale = (float(end) - 14) / float(length)
    corner = None
    for number, truth in enumerate((9.0, 48 - 4.0, 1.0)):
        rings = rings_of(page, number)
        covered = abs(sum(map(area, rings))) / scale**2
        assert abs(covered - truth) < 0.12 * truth + 0.02, (number, covered, truth)
        assert len(rings) == (2 if number == 1 else 1)
        low = np.array([min(ring[:, 0].min() for ring in rings), max(ring[:, 1].max() for ring in rings)])
        corner = low if corner is None else corner
        offset = (low - corner) / scale * [1, -1]
        np.testing.assert_allclose(offset, ((0, 0), (0, 0), (7, 0))[number], atol=0.3)
    assert [unescape(name) for name in re.findall(r'href="#file\d+">([^<]+)<', page)] == ["square", "ring", "a&b"]
    dates = re.findall(r"<td>(\d{4}-\d\d-\d\d)</td>", page)
    assert dates[0] == datetime.fromtimestamp(1e9).strftime("%Y-%m-%d") != dates[1] and len(dates) == 3
    again = info(*files, "--plan", plan)
    assert again.returncode == 0 and again.stderr == f"pointglass: replaces {plan}\n"
    refused = info(*files, "--plan", files[0])
    assert refused.returncode == 2 and refused.stderr.count("\n") == 1 and "ends in .html" in refused.stderr
    scene = open_scene(files)
    page = overview_page(scene, HOSTILE, places=[Place(HOSTILE, np.array([4e5 + 3.5, 5e6 + 3.5, 101.0]))])
    assert "<script" not in page and page.count('href="index.html#place=1"') == 1
    x, y = map(float, found(r'cx="([\d.]+)" cy="([\d.]+)"', page).groups())
    np.testing.assert_allclose((np.array([x, y]) - corner) / scale * [1, -1], [3.5, 3.5], atol=0.2)
