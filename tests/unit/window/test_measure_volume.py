"""Volumes and profiles in the window, without a window: found beside the frame, one step, given up by Esc."""

import csv
from time import monotonic, sleep
from typing import Any

import numpy as np
import pytest
from tool_window import click, context_of

from pointglass.viewer.grid.open_scene import open_scene, scene_from_arrays
from pointglass.viewer.picture.clip import Box, vector
from pointglass.viewer.preprocess.scan_description import ScanDescription
from pointglass.viewer.window.interaction.clipping.clip_tool import ClipTool
from pointglass.viewer.window.interaction.measuring.measure import Measure
from pointglass.viewer.window.interaction.measuring.profile_graph import write_profile
from pointglass.viewer.window.interaction.measuring.volumes import DATES, FITTED, MEAN, TYPED
from pointglass.viewer.window.interaction.tool import KeyEvent
from pointglass.viewer.work.measuring.measure_table import csv_text
from pointglass.viewer.work.measuring.measure_text import value_text, volume_text

HEAP = 0.5**2 * 0.3
"""Of a block of half a metre, 30 cm high, on the ground."""
CORNERS = ((1.2, 5.0, 0.8), (2.8, 5.0, 0.8), (2.8, 5.0, 2.2), (1.2, 5.0, 2.2))


@pytest.fixture(scope="module")
def block():
    """Ground at y = 5 with a block that rises to y = 4.7: the up axis is -y."""
    x, z = (each.ravel() for each in np.meshgrid(np.arange(0, 4, 0.01), np.arange(0, 3, 0.01)))
    top = (np.abs(x - 2) < 0.25) & (np.abs(z - 1.5) < 0.25)
    xyz = np.column_stack([x, 5.0 - 0.3 * top, z])
    return scene_from_arrays(xyz, np.full((len(xyz), 3), 90, np.uint8), meta=ScanDescription(metres_per_unit=1.0))


def measuring(block) -> tuple[Any, Measure]:
    context, tool = context_of(block), Measure()
    context.session.work.edit("Up", up=vector((0.0, -1.0, 0.0)))
    tool.kind = "volume"
    return context, tool


def polygon(context, tool) -> None:
    for corner in CORNERS:
        click(tool, context, corner)
    assert len(tool.points) == 4
    tool.key_event(KeyEvent("ENTER", "press"), context)
    assert tool.points == [] and tool.answering and tool.workers[0] is not None


def ended(tool, context) -> None:
    end = monotonic() + 60
    while tool._volumes.points and monotonic() < end:
        tool.follow(context)
        sleep(0.01)
    tool.follow(context)


@pytest.mark.parametrize("base", [FITTED, MEAN, TYPED])
def test_the_volume_inside_a_polygon_is_one_step_and_says_what_it_is_made_of(block, base):
    context, tool = measuring(block)
    tool._volumes.base = base
    tool._volumes.height = -5.1 if base == TYPED else None
    polygon(context, tool)
    assert "Esc gives up" in tool.hint(context) and context.document.measurements == ()
    ended(tool, context)
    assert not tool.answering
    (made,) = context.document.measurements
    assert made.kind == "volume" and made.volume is not None
    more = 0.1 * made.volume.area if base == TYPED else 0.0
    assert abs(made.volume.net - HEAP - more) <= made.volume.uncertainty < 0.2 * HEAP
    text = volume_text(made, "m")
    assert value_text(made, "m").endswith(" m³") and f"base at height {-5.1 if base == TYPED else -5.0:.3f} m, level" in text
    assert "cut (above)" in text and "fill (below)" in text
    assert context.session.work.undo() == "Measure volume" and context.document.measurements == ()


def test_what_was_added_and_taken_away_between_two_dates_is_measured(block, tmp_path, seed):
    random, paths = np.random.default_rng(seed), []
    for name, top in (("before", 0.0), ("after", 0.3)):
        xz = random.uniform((0, 0), (4, 3), (120_000, 2))
        inside = (np.abs(xz - (2, 1.5)) < 0.25).all(axis=1)
        y = 5.0 - 0.02 * xz[:, 0] - top * inside + random.normal(0, 0.002, len(xz))
        paths.append(tmp_path / f"{name}.xyz")
        np.savetxt(paths[-1], np.column_stack([xz[:, 0], y, xz[:, 1], np.full((len(xz), 3), 90)]), "%.4f %.4f %.4f %d %d %d")
    context, tool = measuring(open_scene(paths, cache=False))
    tool._volumes.base = DATES
    polygon(context, tool)
    ended(tool, context)
    (made,) = context.document.measurements
    assert made.volume is not None and made.volume.dates == ("before.xyz", "after.xyz")
    assert abs(made.volume.fill - HEAP) <= made.volume.fill_uncertainty < 0.3 * HEAP
    assert made.volume.cut <= made.volume.cut_uncertainty
    assert "fill (added)" in volume_text(made, "m") and "from before.xyz to after.xyz" in volume_text(made, "m")
    context, tool = measuring(block)
    tool._volumes.base = DATES
    for corner in CORNERS:
        click(tool, context, corner)
    tool.key_event(KeyEvent("ENTER", "press"), context)
    assert "needs two scans" in context.toasts[-1] and len(tool.points) == 4 and not tool.answering


def test_a_volume_is_given_up_by_esc_and_a_polygon_without_area_is_refused(block):
    context, tool = measuring(block)
    polygon(context, tool)
    assert tool.key_event(KeyEvent("ESCAPE", "press"), context) and not tool._volumes.points
    ended(tool, context)
    assert context.document.measurements == ()
    context.session.work.edit("Up", up=vector((0.0, 0.0, 1.0)))
    polygon(context, tool)
    ended(tool, context)
    assert context.document.measurements == () and context.toasts[-1].startswith("These corners lie in one line")
    assert len(tool.points) == 4 and not tool.answering, "its corners stay, to be corrected"


def test_a_profile_is_one_step_over_the_block_and_its_stations_are_saved(block, tmp_path):
    context, tool = measuring(block)
    tool.kind = "profile"
    click(tool, context, (1.2, 5.0, 1.5))
    click(tool, context, (2.8, 5.0, 1.5))
    assert tool.answering and "Measuring the profile" in tool.hint(context)
    ended(tool, context)
    (made,) = context.document.measurements
    assert made.kind == "profile" and made.profile is not None and value_text(made, "m").startswith("1.60")
    write_profile(tmp_path / "p.csv", made)
    rows = [{name: float(value) for name, value in row.items()} for row in csv.DictReader((tmp_path / "p.csv").open())]
    assert len(rows) == len(made.profile.stations) > 40
    for row in rows:
        on_block = abs(row["x"] - 2) < 0.25
        if abs(abs(row["x"] - 2) - 0.25) > 0.03:
            assert row["height"] == pytest.approx(-4.7 if on_block else -5.0, abs=1e-3)
        assert row["y"] == pytest.approx(-row["height"]) and row["z"] == pytest.approx(1.5, abs=0.02)
    assert context.session.work.undo() == "Measure profile" and context.document.measurements == ()


def test_the_volume_in_a_clip_box_is_a_measurement_of_the_list(block):
    """The box is active, so that the points beneath it are not drawn; they tell where nothing lies in it."""
    context, tool = context_of(block), ClipTool()
    box = Box((2.0, 4.8, 1.5), (0.7, 0.195, 0.6))  # from 5 mm above the ground on
    context.session.work.edit("Up", up=vector((0.0, -1.0, 0.0)), clips=(box,))
    tool.volume.start(context, box)
    end = monotonic() + 60
    while tool.volume.worker is not None and monotonic() < end:
        tool.follow(context)
        sleep(0.01)
    (made,) = context.document.measurements
    assert made.kind == "volume" and made.name == "Volume in Box" and made.volume is not None
    truth = HEAP * 295 / 300
    assert abs(made.volume.cut - truth) <= made.volume.cut_uncertainty < 0.2 * HEAP and made.volume.fill == 0
    assert "in the box" in volume_text(made, "m") and "fill" not in volume_text(made, "m")
    row = next(csv.DictReader(csv_text([made], 1.0).splitlines()))
    assert float(row["cut"]) == pytest.approx(made.volume.cut, rel=1e-11) and float(row["base_height"]) == pytest.approx(-4.995)
    context.session.work.history.undo()
    assert context.document.measurements == ()
