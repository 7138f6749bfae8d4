"""The Compare tool without a window: distances of synthetic changes of known size, and the levels that colour the points."""

from types import SimpleNamespace

import numpy as np
import pytest
from cloud_files import write_ply
from untyped import read_las
from window_session import until_idle

from pointglass.viewer.grid.scene import unpack
from pointglass.viewer.picture.point_sets import LEFT_OUT
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.window.interaction.comparing.compare_tool import Compare
from pointglass.viewer.window.interaction.tool import ToolContext
from pointglass.viewer.window.session.session import Session
from pointglass.viewer.work.comparing.change_levels import STEPS, UNCHANGED, UNKNOWN, level_colours, levels_of
from pointglass.viewer.work.comparing.distance_statistics import colours_of

RISE = 0.006
"""Of a third of the floor: three standard deviations of its noise."""


def floor(random, rise: float, reach: float = 3.0) -> np.ndarray:
    xyz = np.column_stack([random.uniform(0, (reach, 2), (60_000, 2)), random.normal(0, 0.002, 60_000)])
    xyz[xyz[:, 0] > 2, 2] += rise
    return xyz + (4.0e5, 5.0e6, 100.0)


class Window:
    """A session with two scans of a floor open, and the tool."""

    def __init__(self, folder, seed: int, *paths):
        random = np.random.default_rng(seed)
        grey = np.full((60_000, 3), 128, np.uint8)
        self.paths = [write_ply(folder / "last year.ply", floor(random, 0.0), grey),
                      write_ply(folder / "now.ply", floor(random, RISE, 3.4), grey)]
        self.open_only(folder, *(paths or self.paths))

    def open_only(self, folder, *paths) -> None:
        """Opens files that are there."""
        self.session = Session(Settings(view="filled"), (640, 400), load_network=lambda settings: None)
        viewport, theme = SimpleNamespace(frame=None), SimpleNamespace(scale=1.0)
        self.context = ToolContext(self.session, viewport, theme)  # type: ignore[arg-type]
        self.context.files = SimpleNamespace(open_folder=lambda purpose, title, done: done(folder))  # type: ignore[assignment]
        self.tool = Compare()
        self.session.open(list(paths))
        self.turn()

    def save(self, path):
        """Saves a project."""
        chosen = self.session.view_settings
        self.session.work.save_project(path, self.session.camera, chosen.settings, chosen.background)

    def turn(self) -> None:
        """Turns the loop until nothing goes on."""
        until_idle(self.session, lambda: self.tool.follow(self.context), lambda: any(self.tool.workers))


@pytest.fixture
def window(tmp_path, seed):
    made = Window(tmp_path, seed)
    yield made
    made.tool.close()
    made.session.close()


def test_a_change_of_known_size_is_found_and_coloured_in_the_window_and_exported(window, tmp_path):
    tool, context, session = window.tool, window.context, window.session
    tool.start(context)
    window.turn()
    assert session.notices.message is None and tool.made is not None and tool.coloured is not None
    xyz, _, _, station = unpack(session.scene)
    changes = session.work.changes
    assert changes is not None and session.view_settings.shown_settings.view == "filtered"
    assert ((changes.levels == LEFT_OUT) == (station == 0)).all(), "the scan before is not drawn over that after"
    x, levels = xyz[:, 0] - 4.0e5, changes.levels
    risen, same, beyond = (station == 1) & (x > 2.05) & (x < 2.95), (station == 1) & (x < 1.95), (station == 1) & (x > 3.1)
    limit = tool.coloured.found.limit
    shown = (levels[risen].astype(float) - STEPS) / STEPS * limit
    assert abs(np.median(shown) - RISE) < 0.04 * limit and (levels[beyond] == UNKNOWN).mean() > 0.99
    assert np.median(np.abs(levels[same].astype(int) - STEPS)) <= 0.1 * STEPS
    tool.show(context, certain=True)
    window.turn()
    now = session.work.changes.levels
    assert (now[risen] != UNCHANGED).mean() > 0.97 and (now[same] == UNCHANGED).mean() > 0.9
    tool.show_share(context, 0.5)
    window.turn()
    assert tool.coloured.found.limit < limit
    tool.show(context, shown="before")
    window.turn()
    before = session.work.changes
    assert before.colours is None and ((before.levels == LEFT_OUT) == (station == 1)).all()
    tool.export(context)
    window.turn()
    out = tmp_path / "now-compared"
    read = read_las(out / "distances.laz")
    assert len(read.points) == 60_000 and np.nanmedian(np.asarray(read["distance"])[read.x > 4.0e5 + 2.05]) > 0.8 * RISE
    assert session.notices.saved[-1] == out
    tool.put_away(context)
    assert session.work.changes is None and session.view_settings.shown_settings.view == "filled"


def test_a_comparison_is_undone_saved_and_restored_and_a_changed_scan_is_told(window, tmp_path, seed):
    tool, context, session = window.tool, window.context, window.session
    tool.start(context)
    window.turn()
    tool.show(context, limit=0.01, certain=True)
    window.turn()
    levels = session.work.changes.levels
    figures = session.document.comparison.figures
    assert figures is not None and figures.points == 60_000 and figures.known > 50_000
    assert session.work.undo() is not None
    window.turn()
    assert session.document.comparison.limit is None and not np.array_equal(session.work.changes.levels, levels)
    assert session.work.undo() == "Compare"
    window.turn()
    assert session.work.changes is None and session.work.dates is None
    session.work.redo()
    session.work.redo()
    window.turn()
    assert np.array_equal(session.work.changes.levels, levels)
    session.view_settings.show("filled")
    project = tmp_path / "two dates.pointglass"
    window.save(project)
    assert not session.work.changed(session.view_settings.settings, session.view_settings.background)
    again = Window(tmp_path, seed, project)
    try:
        assert np.array_equal(again.session.work.changes.levels, levels) and again.session.notices.message is None
        assert again.session.view_settings.settings.view == "filled", "the view is the project's"
        assert not again.session.work.changed(again.session.view_settings.settings, "plain")
        assert again.tool.made is not None and again.session.work.change_legend is not None
    finally:
        again.tool.close()
        again.session.close()
    random, grey = np.random.default_rng(seed), np.full((60_000, 3), 128, np.uint8)
    for count, what in ((60_000, "another result"), (50_000, "50,000 records")):
        write_ply(window.paths[1], floor(random, 3 * RISE)[:count], grey[:count])
        other = Window.__new__(Window)
        other.open_only(tmp_path, project)
        try:
            message = other.session.notices.message
            assert message is not None and what in f"{message}"
        finally:
            other.tool.close()
            other.session.close()


def test_another_scan_or_a_moved_one_ends_a_comparison(window):
    tool, context, session = window.tool, window.context, window.session
    tool.start(context)
    window.turn()
    assert session.work.changes is not None
    session.open(window.paths[:1])
    window.turn()
    assert session.work.changes is None and tool.made is None
    tool.start(context)
    assert tool.worker is None, "one scan is not compared"


def test_levels_have_the_colours_of_the_exported_points(seed):
    random = np.random.default_rng(seed)
    distance, uncertainty = random.normal(0, 0.01, 5000), random.uniform(0, 0.02, 5000)
    distance[::7] = np.nan
    levels = levels_of(distance, uncertainty, 0.02, certain=False)
    apart = np.abs(level_colours()[levels].astype(int) - colours_of(distance, uncertainty, 0.02))
    assert apart.max() <= 6, "half a step of fifty"
    known = np.isfinite(distance)
    certain = levels_of(distance, uncertainty, 0.02, certain=True)
    assert ((certain == UNCHANGED) == (known & (np.abs(distance) <= uncertainty))).all() and (certain[~known] == UNKNOWN).all()
