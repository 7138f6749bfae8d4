"""Switches the colours of photographs off and on by X pointer events, for ``test_photographs_window.py``."""

import sys
from pathlib import Path

import numpy as np
from drive_dialogs import Person, main
from x_keyboard import xdo

from pointglass.viewer.commands.photo_placing import photo_search
from pointglass.viewer.window.flight.navigation import view_along
from pointglass.viewer.window.interaction.stations.photo_panel import state_text
from pointglass.viewer.window.kit import icons
from pointglass.viewer.work.photo_poses import reference_views
from pointglass.viewer.work.project import read_project, write_project

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "unit"))

import e57_photo_files
from e57_photo_files import AWAY, pinhole, room_points, write_photos


def check_the_switch_changes_the_picture_and_gives_it_back(p: Person, folder: Path) -> None:
    given = [pinhole((0.0, 0.0, 0.0), k * np.pi / 2, name=f"wall {k}", size=(480, 480), fl=240.0) for k in range(4)]
    p.d.drop(write_photos(folder / "walls.e57", given, *room_points(80_000)))
    p.opened("walls.e57")
    session, viewport = p.d.session, p.d.app.viewport
    session.view_settings.show("filled")
    session.flight.go(view_along(AWAY + (-0.5, 0.3, 0.1), (1.0, 0.2, 0.0), 1.0))
    p.key("p")
    p.d.until(lambda: p.d.app.toolbox.active.photos, 60.0)
    library = viewport.renderer.photographs.library("auto")
    p.d.until(lambda: viewport.frame.facts.photographs and library.missing == 0, 60.0)
    pictures = [p.d.bare()]
    for _ in range(2):
        p.click("Colour by photographs")
        pictures.append(p.d.bare())
    assert np.mean(np.abs(pictures[0].astype(int) - pictures[1]).max(-1) > 8) > 0.05
    assert np.array_equal(pictures[0], pictures[2])
    p.d.picture("with photographs")


def check_the_photograph_in_its_place_is_the_one_that_colours_the_picture(p: Person, folder: Path) -> None:
    """A dark photograph, a click on it, the line against the view, a step aside, and its file gone."""
    given = [pinhole((0.0, 0.0, 0.0), k * np.pi / 2, name=f"dark {k}", size=(480, 480), fl=240.0, gain=0.7) for k in range(2)]
    p.d.drop(write_photos(folder / "dark.e57", given, *room_points(80_000)))
    p.opened("dark.e57")
    session, viewport, layer = p.d.session, p.d.app.viewport, p.d.app.viewport.photos
    session.view_settings.show("filled")
    tool = p.d.app.toolbox.active
    p.d.until(lambda: tool.photos, 60.0)
    p.click("dark 0 (pinhole)")
    library = viewport.renderer.photographs.library("auto")
    p.d.until(lambda: viewport.frame.facts.photographs and library.missing == 0 and layer.psnr is not None, 60.0)
    p.d.settle()
    assert layer.psnr > 35, f"{layer.psnr:.1f} dB: the exposure of the points in both"
    p.click("split against the view")
    p.d.picture("photograph and picture")
    eye = session.work.photo.photo.position
    session.flight.go(view_along(eye + (0.0, 0.4, 0.1), (1.0, 0.1, 0.0), 1.0))
    p.d.settle()
    assert layer.psnr > 28, f"{layer.psnr:.1f} dB beside its place"
    p.d.picture("photograph and picture, beside its place")
    session.flight.go(view_along(eye - (1.0, 0.0, 0.0), (1.0, 0.1, 0.0), 1.0))
    p.click("Hide photograph")
    assert session.work.photo is None


def drawn(p: Person, label: str) -> bool:
    try:
        p.items.find(label)
    except AssertionError:
        return False
    return True


def check_a_photograph_where_no_point_lies_is_shown_and_the_next_one(p: Person, folder: Path) -> None:
    xyz, rgb = room_points(80_000)
    half = xyz[:, 0] < AWAY[0] - 0.3  # the photographs look at the other half
    given = [pinhole((0.0, 0.3 * k, 0.0), 0.0, name=f"void {k}", size=(480, 480), fl=240.0) for k in range(3)]
    p.d.drop(write_photos(folder / "void.e57", given, xyz[half], rgb[half]))
    p.opened("void.e57")
    session, tool = p.d.session, p.d.app.toolbox.active
    p.d.until(lambda: tool.photos, 60.0)
    p.click("void 0 (pinhole)")
    p.d.until(lambda: session.lost and not p.d.app.viewport.photos.waits, 60.0)
    p.d.settle()
    assert state_text(p.d.app.tools) == "No point lies behind it here: nothing to compare it with"
    assert not drawn(p, "Whole scene"), "over the photograph"
    p.d.picture("a photograph where no point lies")

    def shown() -> int:
        return [photo is session.work.photo.photo for photo in tool.photos].index(True)

    p.key("Next", "Next")
    assert shown() == 2
    p.key("Next")
    assert shown() == 0, "the first after the last"
    p.key("Prior")
    p.click("Previous")
    assert shown() == 1
    assert not drawn(p, tool.pictures[0].text), "each photograph is listed once"
    p.click(icons.PHOTOGRAPH)
    assert tool.viewer.shows(tool.pictures[2])
    p.key("Prior")
    assert tool.viewer.shows(tool.pictures[1])
    p.key("Escape")
    p.click("Hide photograph")
    p.d.until(lambda: session.lost)
    assert drawn(p, "Whole scene")


def check_where_a_photograph_was_taken_is_searched_kept_in_the_project_and_undone(p: Person, folder: Path) -> None:
    e57_photo_files.paint = e57_photo_files.patches
    reference_views.TURNS, photo_search.PLACES = ((0.0, 8, 0.0),), 1  # fewer views: less time
    photo = pinhole((0.4, -0.3, 0.2), 0.6, name="unplaced", size=(640, 480), fl=420.0)
    photo.quaternion = None
    p.d.drop(write_photos(folder / "unplaced.e57", [photo], *room_points(400_000)))
    p.opened("unplaced.e57")
    tool = p.d.app.toolbox.active
    p.d.until(lambda: tool.pictures, 60.0)
    p.click(tool.pictures[0].text)
    p.click("Find where it was taken")
    work = p.d.session.work
    seen = []
    p.d.until(lambda: (worker := tool.placer.worker) is None or seen.append((worker.label, worker.fraction or 0.0)), 400.0)
    steps = [share for _, share in seen]
    assert steps == sorted(steps), ("one progress, which grows", sorted(set(seen)))
    assert work.document.photographs, tool.placer.said
    placed, = work.document.photographs
    assert np.linalg.norm(np.array(placed.camera_to_world)[:3, 3] - AWAY - (0.4, -0.3, 0.2)) < 0.06
    assert work.photo is not None and work.photo.photo.title == "unplaced"
    p.d.settle()
    p.d.picture("a photograph placed by search")
    write_project(folder / "placed.pointglass", work.document)
    assert read_project(folder / "placed.pointglass").photographs == (placed,)
    p.key("ctrl+z")
    assert work.document.photographs == ()


def check_several_files_are_placed_at_once_and_one_that_is_no_photograph_is_named(p: Person, folder: Path) -> None:
    pictures = folder / "several"
    pictures.mkdir()
    for number, yaw in enumerate((0.6, 0.75)):
        taken = pinhole((0.4, -0.3, 0.2 + 0.1 * number), yaw, size=(640, 480), fl=420.0, coding="jpeg")
        (pictures / f"{number}.jpg").write_bytes(next(iter(taken.blobs.values())))
    (pictures / "2.jpg").write_bytes(b"no photograph")
    tool, session = p.d.app.toolbox.active, p.d.session
    p.click("Place photographs…")
    p.listed()
    p.type(f"{pictures}/")
    p.listed()
    (left, top), (right, bottom) = p.items.find("##row")  # of the last of three rows
    xdo("mousemove", round((left + right) / 2), round((top + bottom) / 2), "click", 1)
    p.d.until(lambda: p.choice.chosen == {"2.jpg"} or p.choice.cursor == 2)
    xdo("mousemove", round((left + right) / 2), round((top + bottom) / 2 - 2 * (bottom - top)))
    p.d.settle()
    xdo("keydown", "shift", "click", 1, "keyup", "shift")
    p.d.until(lambda: len(p.choice.chosen) == 3)
    p.key("Return")
    p.d.until(lambda: tool.placer.worker is not None or tool.placer.said)
    p.d.until(lambda: tool.placer.worker is None, 400.0)
    assert len(session.document.photographs) == 2 and len(tool.placer.said) == 3, tool.placer.said
    assert [line for line in tool.placer.said if line.startswith("2.jpg: where it was taken was not found")], tool.placer.said
    for number, placed in enumerate(session.document.photographs):
        place = np.array(placed.camera_to_world)[:3, 3] - AWAY
        assert np.linalg.norm(place - (0.4, -0.3, 0.2 + 0.1 * number)) < 0.06, place
    p.key("ctrl+z")
    assert session.document.photographs == ()


CHECKS = {name.removeprefix("check_"): made for name, made in list(globals().items()) if name.startswith("check_")}

if __name__ == "__main__":
    main(Path(sys.argv[1]), CHECKS)
