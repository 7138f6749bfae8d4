"""Checks of the tools: each is driven by events, and the picture it leaves is compared with the reference implementation's."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from driver import SIZE, Driver, middle
from items import Items

ROOM = np.array([8.0, 6.0, 3.0])


def shown(d: Driver) -> np.ndarray:
    """The picture alone: the middle of the canvas, where no panel lies, interface hidden."""
    return d.bare()


def chord(d: Driver, name: str, *, shift: bool = False) -> None:
    """A key with Ctrl held."""
    glfw = d.glfw
    key, mods = getattr(glfw, f"KEY_{name}"), glfw.MOD_CONTROL | (glfw.MOD_SHIFT if shift else 0)
    d.app.input.on_key(d.app.window, key, glfw.get_key_scancode(key), glfw.PRESS, mods)
    d.app.input.on_key(d.app.window, key, glfw.get_key_scancode(key), glfw.RELEASE, 0)
    d.settle()


def on_a_wall(position) -> bool:
    return bool(np.minimum(np.abs(np.array(position)), np.abs(np.array(position) - ROOM)).min() < 1e-3)


def check_inspect_shows_a_measured_point(d: Driver) -> None:
    d.resize(*SIZE)
    d.drop(Path("room7"))
    d.until(lambda: d.session.loads.current is None and d.session.scene is not None and not d.session.shown_scan.preview)
    d.key("3")
    d.rest()
    d.key("I")
    d.click(*middle(d))
    tool = d.app.toolbox.active
    assert tool.name == "inspect" and tool.picked is not None and on_a_wall(tool.picked.position)
    pixels, _ = d.session.camera.project([tool.picked.position])
    where = np.array(middle(d)) - d.session.area.origin
    assert np.linalg.norm(pixels[0] - where) < 11
    assert d.session.point is not None and on_a_wall(d.session.point)
    d.key("ESCAPE")
    assert d.app.toolbox.active is d.app.toolbox.fly and not d.app.closing


def check_measuring_is_stored_and_undone_by_key(d: Driver) -> None:
    d.rest()
    d.key("T")
    d.click(*middle(d, -0.12))
    assert len(d.app.toolbox.active.points) == 1
    assert d.app.toolbox.active.hint(d.app.tools).startswith("Click the second point")
    d.click(*middle(d, 0.15, 0.1))
    (made,) = d.session.document.measurements
    assert all(on_a_wall(point.position) and 0 < point.spacing < 0.3 for point in made.points)
    chord(d, "Z")
    assert d.session.document.measurements == ()
    chord(d, "Y")
    assert d.session.document.measurements == (made,)
    d.key("T")
    with_it = d.canvas()
    chord(d, "Z")
    assert not np.array_equal(with_it, d.canvas()), "a stored measurement is drawn with every tool"


def check_a_volume_and_a_profile_are_measured_by_clicks(d: Driver) -> None:
    before = d.session.document.measurements
    d.key("T")
    tool = d.app.toolbox.active
    tool.kind = "volume"
    d.session.flight.look(0, 150)
    d.rest()
    for turn in np.arange(8) * np.pi / 4:  # around; a click on a pixel without points sets none
        d.click(*middle(d, 0.15 * np.cos(turn), 0.15 * np.sin(turn)))
    assert len(tool.points) >= 3
    d.key("ENTER")
    d.until(lambda: not tool.answering)
    (made,) = d.session.document.measurements[len(before):]
    assert made.kind == "volume" and made.volume is not None and made.volume.area > 0.1 and made.volume.count > 100
    assert abs(made.volume.net) <= made.volume.uncertainty < 0.01, "a level floor"
    d.canvas()
    chord(d, "Z")
    assert d.session.document.measurements == before
    tool.kind = "profile"
    for across in np.linspace(-0.2, 0.2, 9):  # the first and the second pixel with points
        if len(d.session.document.measurements) == len(before) and not tool.answering:
            d.click(*middle(d, across, 0.05))
    d.until(lambda: not tool.answering)
    (made,) = d.session.document.measurements[len(before):]
    assert made.kind == "profile" and made.profile is not None and np.abs(made.profile.heights).max() < 0.01
    d.canvas()
    chord(d, "Z")
    tool.points.clear()
    tool.kind = "distance"
    d.key("T")
    d.session.flight.look(0, -150)
    d.rest()


def check_the_tint_is_the_reference_and_its_shares_are_counted(d: Driver) -> None:
    from PIL import Image

    from pointglass.viewer.picture.background import composite
    from pointglass.viewer.picture.provenance_tint import shares, tinted
    from pointglass.viewer.window.session.colour_legend import shown_legend
    from pointglass.viewer.work.pictures.picture_legend import with_legend

    before = shown(d)
    d.key("M")
    found = shown(d)
    session = d.session
    camera = session.camera.resized(*session.area.window_size)
    frame = d.app.viewport.renderer.render(camera, session.view_settings.settings, views=("filled", "filtered"))
    image, mask = frame.image("filled"), frame.mask()
    assert np.array_equal(found, composite(tinted("filled", image, mask, frame.image("filtered"))))
    session.picture.dirty = True
    d.rest()
    d.settle()
    frame = d.app.viewport.frame
    told = d.app.toolbox.active.shares
    assert told == shares("filled", frame.image("filled"), frame.mask(), frame.image("filtered"))
    work, saves, pictures = session.work, d.app.save_actions, []
    for legend in (False, True):
        work.shot_legend = legend
        path = saves.screenshot()
        assert path is not None
        pictures.append(np.asarray(Image.open(path)))
        path.unlink()
    work.shot_legend = False
    legend = shown_legend(session)
    assert legend is not None and len(legend.rows) >= 2 and "with its legend" in session.notices.toasts[-1].text
    assert np.array_equal(pictures[1], with_legend(pictures[0], legend)) and not np.array_equal(*pictures)
    d.key("M")
    assert np.array_equal(shown(d), before)


def check_a_clip_cuts_the_picture_and_is_undone(d: Driver) -> None:
    from pointglass.viewer.picture.background import composite
    from pointglass.viewer.window.panels.status_bar import _columns

    def counted() -> str:
        return next(column.text for column in _columns(d.session, None) if " of " in column.text)

    before = shown(d)
    assert not counted().startswith("up to")
    d.key("B")
    tool = d.app.toolbox.active
    tool.add(d.app.tools, "upright")
    found, session = shown(d), d.session
    assert counted().startswith("up to"), "a clip takes some of them away"
    camera = session.camera.resized(*session.area.window_size)
    frame = d.app.viewport.renderer.render(camera, session.view_settings.settings, edits=session.document.edits)
    assert np.array_equal(found, composite(frame.image("filled"))) and not np.array_equal(found, before)
    session.picture.dirty = True
    chord(d, "Z")
    assert session.document.clips == () and np.array_equal(shown(d), before)
    d.key("B")


def check_the_look_colours_points_and_tones_pictures(d: Driver) -> None:
    from pointglass.viewer.picture.background import composite
    from pointglass.viewer.picture.look import Look, tone_curves, toned
    from pointglass.viewer.window.interaction.editing import edit

    before = shown(d)
    look = Look(exposure=1.0, temperature=0.5)
    edit(d.app.tools, "tones", look=look)
    found, session = shown(d), d.session
    camera = session.camera.resized(*session.area.window_size)
    frame = d.app.viewport.renderer.render(camera, session.view_settings.settings)
    assert np.array_equal(found, composite(toned(frame.image("filled"), tone_curves(look))))
    session.picture.dirty = True
    edit(d.app.tools, "height", look=replace(Look(), colour_by="height"))
    assert np.array_equal(shown(d), before), "the filled view keeps the scan's colours"
    d.key("1")
    coloured = shown(d)
    chord(d, "Z")
    chord(d, "Z")
    assert session.document.look == Look() and not np.array_equal(shown(d), coloured)
    d.key("3")
    d.rest()


def check_point_size_and_lighting_are_set_for_the_side_of_points_in_a_comparison(d: Driver) -> None:
    session, tools = d.session, d.app.tools
    d.key("3")
    d.key("V")
    before, middle = shown(d), SIZE[0] // 2
    d.app.toolbox.select("colours", tools)
    session.area.panels.inspector = True
    d.settle()
    Items(d).click("##point size")
    assert session.document.look.point_size > 1, "it is enabled"
    session.area.panels.inspector = False
    d.app.toolbox.select(d.app.toolbox.fly.name, tools)
    after = shown(d)
    assert not np.array_equal(before[:, : middle - 8], after[:, : middle - 8])
    assert np.array_equal(before[:, middle + 8 :], after[:, middle + 8 :])
    chord(d, "Z")
    assert session.document.look.point_size == 1
    d.key("V")
    d.rest()


def check_a_film_is_made_beside_the_window_and_a_cancelled_one_leaves_nothing(d: Driver) -> None:
    """The film's renderer has an OpenGL context of its own on another thread; the window goes on drawing meanwhile."""
    d.key("K")
    film, context = d.app.toolbox.active, d.app.tools
    film.path.add_keyframe(context)
    d.session.flight.look(60, 0)
    d.rest()
    film.path.add_keyframe(context)
    film.path.set_length(context, 0.2)
    film.change_format(context, size=(96, 64), view="filled")
    for out in ("film.mp4", "frames"):
        film.start(context, d.folder / out)
        turns = 0
        while film.worker is not None:
            d.session.flight.look(2, 0)
            d.app.step(wait=False)
            turns += 1
            assert turns < 5000, "the film does not end"
        assert d.session.notices.message is None and turns > 1
    assert (d.folder / "film.mp4").stat().st_size > 500
    assert len(list((d.folder / "frames").glob("*.png"))) == 6
    film.start(context, d.folder / "cancelled.mp4")
    film.worker.cancel()
    d.until(lambda: film.worker is None)
    assert not list(d.folder.glob("*cancelled*"))
    for _ in range(4):
        chord(d, "Z")  # pictures, length and keyframes
    assert not d.session.work.document.path.keyframes
    d.key("ESCAPE")
    d.rest()


def check_every_tool_draws_its_panel(d: Driver) -> None:
    for key in ("C", "P", "B", "T", "I", "M", "N", "K"):
        d.key(key)
        d.rest()
        d.canvas()
    d.app.toolbox.select("scene", d.app.tools)
    d.canvas()
    d.key("ESCAPE")
    assert d.app.toolbox.active is d.app.toolbox.fly
