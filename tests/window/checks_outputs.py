"""Checks of what is assigned to a scan and of what is saved from the window: reference system, films, pictures, sheets."""

from pathlib import Path

from driver import SIZE, Driver
from imgui_bundle import imgui
from items import Items

from pointglass.viewer.window.interaction.tool import KeyEvent


def typed(d: Driver, text: str) -> None:
    """Types into the field that has the keyboard."""
    for character in text:
        imgui.get_io().add_input_character(ord(character))
    d.settle()


def check_a_reference_system_is_chosen_by_its_code_and_by_its_name(d: Driver) -> None:
    d.resize(1280, 720)
    d.drop(Path("room7"))
    d.until(lambda: d.session.loads.current is None and d.session.scene is not None and not d.session.shown_scan.preview)
    d.rest()
    items = Items(d)
    d.app.toolbox.select("scene", d.app.tools)
    panel = d.app.toolbox.active.reference
    before = d.session.document
    items.click("##crs")
    typed(d, "999999")
    d.key("ENTER")
    assert "epsg.io" in panel._problem and d.session.document == before
    d.key("ESCAPE")
    items.click("##crs")
    typed(d, "25833")
    d.key("ENTER")
    assert {scan.crs for scan in d.session.document.scans} == {"EPSG:25833"} and d.session.facts.units == "metre"
    items.click("##crs")
    typed(d, "etrs89 / utm zone 32n")
    d.until(lambda: panel._systems.finished)
    items.click("EPSG:25832  ETRS89 / UTM zone 32N")
    assert d.session.facts.crs == "EPSG:25832"
    d.picture("reference")
    for _ in range(2):
        d.session.work.undo()
    assert d.session.document.scans == before.scans and d.session.facts.crs is None
    d.app.toolbox.select("scene", d.app.tools)
    d.resize(*SIZE)
    d.rest()


def check_the_film_panel_makes_a_film_cancels_it_and_goes_on(d: Driver) -> None:
    """Driven by clicks: keyframes, their lens, the timeline, PNGs that are cancelled and continued, and the same bytes anew."""
    d.resize(1280, 720)
    d.rest()
    d.key("K")
    items, film, context = Items(d), d.app.toolbox.active, d.app.tools
    for turn in (0, 90, 90):
        d.session.flight.look(turn, 0)
        d.rest()
        items.click("Add keyframe here")
    assert [key.time for key in d.session.document.path.keyframes] == [0.0, 3.0, 6.0]
    (left, top), (right, _) = items.find("##timeline")
    margin = d.app.theme.px(8)
    d.click((left + right) / 2, top + margin)
    assert film.path.timeline.selected == 1 and abs(film.path.at - 3.0) < 0.2
    film.path.change_lens(context, 35.0)
    d.rest()
    d.picture("film panel")
    d.click(left + margin + 0.25 * (right - left - 2 * margin), top + margin)
    assert abs(film.path.at - 1.5) < 0.1
    assert 35.0 < d.session.camera.vertical_fov < 60.0, "the lens follows the path"
    items.click("Play")
    d.until(lambda: film.path.at > 1.6)
    items.click("Pause")
    film.path.set_length(context, 0.4)
    film.change_format(context, size=(160, 90), view="filled", supersample=2)
    frames = d.folder / "panel frames"
    film.start(context, frames)
    d.until(lambda: film.worker is None or film.worker.done >= 2)
    if film.worker is not None:
        film.worker.cancel()
    d.until(lambda: film.worker is None)
    before = {path.name: (path.read_bytes(), path.stat().st_mtime_ns) for path in frames.glob("*.png")}
    film.start(context, frames)
    d.until(lambda: film.worker is None, 60.0)
    assert d.session.notices.message is None and len(list(frames.glob("*.png"))) == 12
    assert all((frames / name).stat().st_mtime_ns == made for name, (_, made) in before.items()), "frames are kept"
    film.start(context, d.folder / "panel again")
    d.until(lambda: film.worker is None, 60.0)
    for path in frames.glob("*.png"):
        assert (d.folder / "panel again" / path.name).read_bytes() == path.read_bytes()
    d.app.toolbox.key_event(delete := KeyEvent("DELETE", "press"), context)
    assert delete and len(d.session.document.path.keyframes) == 2
    for _ in range(7):
        d.session.work.undo()
    assert not d.session.document.path.keyframes
    d.session.flight.go_home()
    d.key("ESCAPE")
    d.resize(*SIZE)
    d.rest()


def check_large_pictures_and_panoramas_are_rendered_beside_the_window(d: Driver) -> None:
    """F12 at twice the size is what ``render --like`` draws; a panorama is what the views along the axes are."""
    import numpy as np
    from PIL import Image

    from pointglass.viewer.render.described_picture import picture_of
    from pointglass.viewer.work.pictures.shot_metadata import read_shot

    d.rest()
    saves, work = d.app.save_actions, d.session.work
    work.shot_scale = 2
    turns = 0
    path = saves.screenshot()
    assert path is not None and saves.still is not None
    assert saves.screenshot() is None, "one at a time"
    while saves.still is not None:
        d.session.flight.look(1, 0)
        d.app.step(wait=False)
        turns += 1
    work.shot_scale = 1
    image = np.asarray(Image.open(path))
    width, height = d.session.area.size
    assert turns > 1 and image.shape[:2] == (2 * height, 2 * width)
    assert np.array_equal(image, picture_of(d.app.viewport.renderer, read_shot(path).spec))
    panorama = saves.panorama((256, 128))
    d.until(lambda: saves.still is None, 60.0)
    assert np.asarray(Image.open(panorama)).shape == (128, 256, 3)
    d.session.flight.go_home()
    d.session.picture.dirty = True
    d.rest()


def check_pictures_are_saved_with_measurements_over_them_where_that_is_chosen(d: Driver) -> None:
    import numpy as np
    from PIL import Image

    from pointglass.viewer.picture.clip import vector
    from pointglass.viewer.work.measuring.measurement import MeasuredPoint, Measurement

    d.rest()
    saves, work, view = d.app.save_actions, d.session.work, d.session.camera
    width, height = d.session.area.size
    ends = view.unproject(np.array([[0.2 * width, 0.7 * height], [0.8 * width, 0.6 * height]]), np.full(2, 2.0))
    made = Measurement("distance", tuple(MeasuredPoint(vector(end)) for end in ends), "Distance")
    work.edit("Measure", measurements=(*work.document.measurements, made))
    pictures = []
    for measured in (False, True):
        work.shot_measured = measured
        d.rest()
        path = saves.screenshot()
        assert path is not None
        pictures.append(np.asarray(Image.open(path)).astype(int))
    assert "with 1 measurement" in d.session.notices.toasts[-1].text
    work.shot_scale = 2
    large = saves.screenshot()
    d.until(lambda: saves.still is None, 60.0)
    work.shot_scale, work.shot_measured = 1, False
    work.undo()
    plain, over = pictures
    changed = (plain != over).any(axis=2)
    rows, columns = np.nonzero(changed)
    assert 0.001 < changed.mean() < 0.1 and rows.min() > height / 2
    assert columns.min() > 0.15 * width and columns.max() < 0.85 * width
    accent = np.array([92, 196, 192])
    twice = np.asarray(Image.open(large)).astype(int)
    assert twice.shape[:2] == (2 * height, 2 * width)
    small_marks, large_marks = ((np.abs(picture - accent).max(axis=2) < 30).sum() for picture in (over, twice))
    assert small_marks > 50 and large_marks > 2 * small_marks
    d.rest()


def check_passers_by_are_dimmed_hidden_and_shown_again(d: Driver) -> None:
    d.resize(1280, 720)
    d.drop(Path("passer1"))
    d.until(lambda: d.session.loads.current is None and d.session.scene is not None and d.session.shown_scan.title == "passer1")
    d.rest()
    d.key("P")
    items, plain = Items(d), d.session.scene
    pictures = {"shown": d.bare()}
    for choice in ("dimmed", "hidden"):
        items.click("##ghosts")
        items.click(choice)
        d.until(lambda: d.session.scene is not plain, 60.0)
        d.rest()
        assert d.session.document.ghosts == choice and len(d.session.scene.marked.numbers) > 300
        pictures[choice] = d.bare()
        d.picture(f"passers-by {choice}")
    assert not (pictures["shown"] == pictures["dimmed"]).all() and not (pictures["hidden"] == pictures["dimmed"]).all()
    for _ in range(2):
        d.session.work.undo()
    d.until(lambda: d.session.scene is plain)
    assert (d.bare() == pictures["shown"]).all()
    stood = []
    for key in ("PAGE_DOWN", "PAGE_DOWN", "PAGE_UP", "PAGE_UP"):  # of two stations; it may have begun at one
        d.key(key)
        stood += [abs(plain.scan_places - d.session.camera.position).max(axis=1).tolist().index(0.0)]
    assert stood in ([0, 1, 0, 1], [1, 0, 1, 0])
    d.key("ESCAPE")
    d.drop(Path("room7"))
    d.until(lambda: d.session.loads.current is None and d.session.shown_scan.title == "room7")
    d.resize(*SIZE)
    d.rest()


def check_a_closed_scan_is_freed(d: Driver) -> None:
    """Whatever tools were used on it: a scan may take gigabytes."""
    import gc
    import weakref

    from driver import middle

    from pointglass.viewer.window.interaction.editing import edit

    d.resize(1280, 720)
    d.drop(Path("passer2"))
    d.until(lambda: d.session.loads.current is None and d.session.shown_scan.title == "passer2")
    d.rest()
    section = next(tool for tool in d.app.toolbox.tools if tool.name == "section")
    for key in ("I", "T", "N", "C", "P", "M", "K", "B"):
        d.key(key)
        d.click(*middle(d))
        if key == "N":
            section.preview.shown = True
            d.until(lambda: section.preview.image is not None, 60.0)
        d.rest()
    plain = weakref.ref(d.session.scene)
    edit(d.app.tools, "hide", ghosts="hidden")
    d.until(lambda: d.session.scene is not plain(), 60.0)
    d.rest()
    d.key("ESCAPE")
    d.key("G")
    d.until(lambda: "Finding" not in " ".join(toast.text for toast in d.session.notices.toasts), 60.0)
    marked = weakref.ref(d.session.scene)
    d.app.act("close_scan")
    d.settle(6)
    gc.collect()
    left = [name for name, scene in (("plain", plain()), ("marked", marked())) if scene is not None]
    holders = [type(one).__name__ for scene in (plain(), marked()) if scene is not None for one in gc.get_referrers(scene)]
    assert not left, f"{left} kept by {holders}"
    d.drop(Path("room7"))
    d.until(lambda: d.session.loads.current is None and d.session.shown_scan.title == "room7")
    d.resize(*SIZE)
    d.rest()


def check_one_of_two_files_is_hidden_and_shown(d: Driver) -> None:
    """Files without scanner positions are in the list, too."""
    d.resize(1280, 720)
    d.drop(Path("pair1"))
    d.until(lambda: d.session.loads.current is None and d.session.shown_scan.title == "left.laz and 1 more")
    d.rest()
    d.key("P")
    both, items = d.bare(), Items(d)
    items.click("##visible")  # the last one drawn: the right half
    d.rest()
    assert d.session.document.hidden_stations == (1,)
    d.picture("file hidden")
    assert (d.bare() != both).any()
    d.session.work.undo()
    assert d.session.document.hidden_stations == ()
    d.key("ESCAPE")
    d.drop(Path("room7"))
    d.until(lambda: d.session.loads.current is None and d.session.shown_scan.title == "room7")
    d.resize(*SIZE)
    d.rest()


def check_a_sheet_is_previewed_over_the_picture_and_drawn_anew_when_the_cut_changes(d: Driver) -> None:
    d.resize(1280, 720)
    d.rest()
    d.key("N")
    items, tool = Items(d), d.app.toolbox.active
    items.click("Preview")
    d.until(lambda: tool.preview.image is not None, 60.0)
    d.picture("sheet preview")
    plan = tool.preview.image
    tool.sheet.scale = 100
    d.until(lambda: tool.preview.image is not plan and tool.preview.image is not None, 60.0)
    assert tool.preview.image.shape != plan.shape
    tool.kind = "line"
    tool.ends = []
    d.settle()
    items.click("Close preview")
    assert not tool.preview.shown
    tool.kind, tool.sheet.scale = "plan", 50
    d.key("ESCAPE")
    d.resize(*SIZE)
    d.rest()


def check_pictures_are_saved_with_the_legend_of_what_points_are_coloured_by(d: Driver) -> None:
    from dataclasses import replace

    import numpy as np
    from PIL import Image

    from pointglass.viewer.render.described_picture import picture_of
    from pointglass.viewer.window.session.colour_legend import shown_legend
    from pointglass.viewer.work.pictures.picture_legend import with_legend
    from pointglass.viewer.work.pictures.shot_metadata import read_shot

    d.rest()
    saves, work = d.app.save_actions, d.session.work
    work.edit("Colour", look=replace(work.document.look, colour_by="height"))
    d.session.view_settings.show_points()
    d.rest()
    pictures = []
    for legend in (False, True):
        work.shot_legend = legend
        path = saves.screenshot()
        assert path is not None
        pictures.append(np.asarray(Image.open(path)).astype(int))
    assert "with its legend" in d.session.notices.toasts[-1].text
    work.shot_scale = 2
    large = saves.screenshot()
    d.until(lambda: saves.still is None, 60.0)
    work.shot_scale, work.shot_legend = 1, False
    legend, twice = shown_legend(d.session), np.asarray(Image.open(large))
    assert legend is not None and twice.shape[:2] == (2 * len(pictures[0]), 2 * pictures[0].shape[1])
    assert np.array_equal(twice, with_legend(picture_of(d.app.viewport.renderer, read_shot(large).spec), legend))
    work.undo()
    d.session.view_settings.show_colours()
    d.rest()
    height, width = pictures[0].shape[:2]
    rows, columns = np.nonzero((pictures[0] != pictures[1]).any(axis=2))
    assert 0.6 * height < rows.min() and rows.max() > 0.95 * height and columns.max() < 0.7 * width
