"""Chooses files by X key and pointer events, for ``test_dialogs.py``: open, also at addresses, save, replace, locate,
photographs, files; and drags a clip.

Each check begins where the one before left the window; what is drawn is left as PNG, to be looked at.
"""

import json
import sys
import time
import traceback
from pathlib import Path

import numpy as np
from driver import Driver
from items import Items
from x_keyboard import focus, xdo

from pointglass.viewer.window.kit import icons

sys.path += [str(Path(__file__).resolve().parents[1] / part) for part in ("unit", "unit/readers")]

from e57_photo_files import pinhole, room_points, write_photos
from range_server import served

SIZE = (960, 600)


def write_ply(path: Path, away: float = 0.0, points: int = 6000) -> Path:
    """A room, ``away`` metres east."""
    xyz, rgb = room_points(points)
    return write_points(path, xyz + (away, 0.0, 0.0), rgb)


def write_points(path: Path, xyz: np.ndarray, rgb: np.ndarray | None = None) -> Path:
    """Points, (n, 3), grey where no colours are given."""
    rgb = np.full(xyz.shape, 120, np.uint8) if rgb is None else rgb
    rows = "\n".join(" ".join([*(f"{value:.4f}" for value in place), *map(str, colour)])
                     for place, colour in zip(xyz.tolist(), rgb.tolist()))
    head = "".join(f"property {kind} {name}\n" for kind, names in (("float", "xyz"), ("uchar", ("red", "green", "blue")))
                   for name in names)
    path.write_text(f"ply\nformat ascii 1.0\nelement vertex {len(xyz)}\n{head}end_header\n{rows}\n")
    return path


class Person:
    """Hands at keyboard and mouse of the X server."""

    def __init__(self, d: Driver):
        self.d, self.items = d, Items(d)

    def key(self, *names: str) -> None:
        for name in names:
            xdo("key", name)
            self.d.settle()

    def type(self, text: str) -> None:
        """Types into the file dialog and waits until all of it has arrived."""
        xdo("type", "--delay", "8", text)
        self.d.until(lambda: self.choice.text.endswith(text[-12:]))

    def click(self, label: str) -> None:
        (left, top), (right, bottom) = self.items.find(label)
        for _ in range(20):  # the panel is scrolled until the item is in sight
            if bottom < self.d.session.area.window_size[1] - 30:
                break
            xdo("mousemove", round((left + right) / 2), self.d.session.area.window_size[1] - 80)
            self.d.settle()
            xdo("click", 5)
            self.d.settle()
            (left, top), (right, bottom) = self.items.find(label)
        xdo("mousemove", round((left + right) / 2), round((top + bottom) / 2))
        self.d.settle()
        xdo("click", 1)
        self.d.settle()

    @property
    def choice(self):
        return self.d.app.files.choice

    def listed(self) -> None:
        """Waits until the folder is listed."""
        self.d.until(lambda: self.choice is not None and self.choice.listing.finished)
        self.d.settle()

    def opened(self, title: str) -> None:
        session = self.d.session
        self.d.until(lambda: session.loads.current is None and session.scene is not None
                     and session.shown_scan.title == title, 90.0)
        self.d.settle()


def check_an_address_is_typed_and_is_a_recent_scan_that_opens(p: Person, folder: Path) -> None:
    from pointglass.viewer.window.session.recent import recent_scans

    notices = p.d.session.notices
    with served({"far.ply": write_ply(folder / "far.ply").read_bytes()}) as server:
        for address, told in ((f"{server.address}/near.ply", "near.ply: "), ("ftp://there/far.ply", "read from https://")):
            p.key("o")
            p.listed()
            p.type(address)
            p.key("Return")
            p.d.until(lambda: notices.message is not None or (p.choice is not None and p.choice.problem))
            said = p.choice.problem if p.choice is not None else notices.message.text
            assert address.partition(":")[0] + "://" in said and told in said
            p.d.picture(f"refused {address[:3]}")
            p.key("Escape")
            p.d.settle()
        p.click("Open an address…")
        p.listed()
        p.d.picture("dialog address")
        p.type(f"{server.address}/far.ply?version=1&token=2")
        p.key("Return")
        p.opened("far.ply")
        p.d.rest()
        p.d.app.act("close_scan")
        asked = len(server.queries)
        p.d.settle(4)
        p.d.picture("recent address")
        assert len(server.queries) == asked, "drawing the list asks no server"
        assert recent_scans()[0].paths == (f"{server.address}/far.ply?version=1",)
        p.click("card")
        p.opened("far.ply")


def check_a_path_is_typed_completed_and_opened(p: Person, folder: Path) -> None:
    write_ply(folder / "scans" / "first room.ply")
    p.key("o")
    p.listed()
    p.type(f"{folder}/sca")
    p.key("Tab")
    p.d.until(lambda: p.choice.text == f"{folder}/scans/")
    p.listed()
    p.d.picture("dialog open")
    p.key("Down", "Return")
    p.opened("first room.ply")
    assert not p.d.session.flight.held and p.d.app.files.folders.folder_of("scans") == folder / "scans"


def check_keys_of_the_dialog_do_nothing_behind_it(p: Person, folder: Path) -> None:
    before = p.d.session.flight.state, p.d.session.view_settings.settings
    p.key("o")
    p.listed()
    assert p.choice.folder == folder / "scans", "the folder used last"
    p.type("w1v")
    p.d.session.notices.say("A message", "over the dialog")
    p.d.settle()
    p.key("Escape")
    assert p.d.session.notices.message is None and p.choice is not None and p.choice.text == "w1v"
    p.key("Escape")
    assert p.choice is None and (p.d.session.flight.state, p.d.session.view_settings.settings) == before
    assert not p.d.app.closing


def check_a_file_is_replaced_only_where_the_person_says_so(p: Person, folder: Path) -> None:
    tool = next(tool for tool in p.d.app.toolbox.tools if tool.name == "section")
    p.key("n")
    (folder / "sheets").mkdir()
    old = folder / "sheets" / "plan.pdf"
    old.write_bytes(b"old")
    p.click("Save sheet…")
    p.listed()
    p.type(f"{folder}/sheets/plan")
    p.key("Return")
    p.d.until(lambda: p.choice.question == old)
    p.d.picture("dialog question")
    p.key("Return")  # keeps it
    assert p.choice.question is None and old.read_bytes() == b"old"
    p.key("Return")
    p.d.until(lambda: p.choice.question == old)
    p.key("Right", "Escape", "Return")  # another time it is kept again, unless the person says so
    p.d.until(lambda: p.choice.question == old)
    p.key("Return")
    assert p.choice.question is None and old.read_bytes() == b"old"
    p.key("Return")
    p.d.until(lambda: p.choice.question == old)
    p.key("Right", "Return")
    p.d.until(lambda: p.choice is None and tool.worker is None, 60.0)
    assert old.read_bytes().startswith(b"%PDF") and [path.name for path in old.parent.iterdir()] == ["plan.pdf"]
    p.key("Escape")


def check_rows_are_clicked_and_a_folder_is_made(p: Person, folder: Path) -> None:
    chosen: list[Path] = []
    p.d.app.files.save("test", "Save", "a.csv", {"Table": (".csv",)}, chosen.append)
    p.listed()
    p.type(f"{folder}/")
    p.listed()
    p.click("New folder")
    p.d.settle(8)  # its field has the keyboard then
    xdo("type", "--delay", "8", "made here")
    p.d.settle(12)
    p.key("Return")
    p.d.until(lambda: p.choice.folder == folder / "made here")
    p.listed()
    p.click("Save")
    p.d.until(lambda: bool(chosen))
    assert chosen == [folder / "made here" / "a.csv"]


def check_rows_are_spanned_by_a_click_with_shift_however_fast_it_is(p: Person, folder: Path) -> None:
    (folder / "several").mkdir()
    for number in range(3):
        (folder / "several" / f"{number}.ply").touch()
    p.key("o")
    p.listed()
    p.type(f"{folder}/several/")
    p.listed()
    p.click("##row")  # the last of three
    p.d.until(lambda: p.choice.cursor == 2)
    (left, top), (right, bottom) = p.items.find("##row")
    xdo("mousemove", round((left + right) / 2), round((top + bottom) / 2 - 2 * (bottom - top)))
    p.d.settle()
    xdo("keydown", "shift", "click", 1, "keyup", "shift")  # within one frame: the field has the keyboard, and the click waits
    p.d.until(lambda: p.choice.chosen == {f"{number}.ply" for number in range(3)})
    p.key("Escape")


def check_a_moved_scan_is_located(p: Person, folder: Path) -> None:
    from pointglass.viewer.work.document import Document, ScanFile
    from pointglass.viewer.work.project import write_project

    scan, project = write_ply(folder / "old place" / "moved.ply", 3.0), folder / "projects" / "p.pointglass"
    write_project(project, Document((ScanFile(str(scan)),)))
    (folder / "unlike").mkdir()
    write_ply(folder / "unlike" / "other.ply", 123.0)
    scan.rename(folder / "unlike" / "renamed.ply")
    dialog = p.d.app.missing_scans
    p.d.drop(project)
    p.d.until(lambda: dialog.asked is not None)
    p.d.picture("locate")
    p.key("Return")
    p.listed()
    p.type(f"{folder}/unlike/other.ply")
    p.key("Return")
    p.d.until(lambda: dialog.doubt is not None)
    assert "bytes" in dialog.doubt[1]
    content = bytearray((folder / "unlike" / "renamed.ply").read_bytes())
    content[-1] ^= 1
    (folder / "unlike" / "as large.ply").write_bytes(content)
    p.key("Return")
    p.listed()
    p.type(f"{folder}/unlike/as large.ply")
    p.key("Return")
    p.d.until(lambda: dialog.doubt is not None and "contents are others" in dialog.doubt[1])
    p.key("Return")
    p.listed()
    p.type(f"{folder}/unlike/renamed.ply")
    p.key("Return")
    p.opened("renamed.ply")
    assert p.d.session.work.project == project


def check_a_photograph_without_a_pose_is_looked_at_and_saved(p: Person, folder: Path) -> None:
    given = pinhole((0.1, 0.0, 0.0), 0.3, name="no pose", kind="visualReference", size=(480, 360))
    p.d.drop(write_photos(folder / "photo.e57", [given], *room_points(4000)))
    p.opened("photo.e57")
    p.key("p")
    tool = p.d.app.toolbox.active
    p.d.until(lambda: bool(tool.pictures))
    p.click("no pose, 480 x 360")
    p.d.until(lambda: tool.viewer._image is not None)
    p.d.picture("photograph")
    left, top, width, height = (*p.d.session.area.origin, *p.d.session.area.size)
    xdo("mousemove", round(left + width / 2), round(top + height / 2))
    xdo("click", "--repeat", 4, 4)
    p.d.until(lambda: tool.viewer.zoom is not None)
    before = tool.viewer.centre.copy()
    xdo("mousedown", 1)
    xdo("mousemove_relative", 30, 20)
    p.d.until(lambda: not np.array_equal(before, tool.viewer.centre))
    xdo("mouseup", 1)
    p.d.settle()
    p.click("Save…")
    p.listed()
    p.type(f"{folder}/kept")
    p.key("Return")
    p.d.until(lambda: (folder / "kept.png").is_file())
    assert (folder / "kept.png").read_bytes() == next(iter(given.blobs.values()))
    p.key("Escape")
    assert tool.viewer.viewed is None and p.d.app.toolbox.active is tool
    p.key("Escape")


def check_one_of_several_files_is_hidden_and_flown_to(p: Person, folder: Path) -> None:
    files = [write_ply(folder / f"{name}.ply", away) for name, away in (("west", 0.0), ("east", 4000.0))]
    p.d.drop(*files)
    p.opened("west.ply and 1 more")
    p.d.rest()
    both, camera = p.d.bare(), p.d.session.flight.state
    p.d.picture("files")
    p.click("east.ply")
    p.d.until(lambda: not p.d.session.flight.moving and p.d.session.camera.position[0] > 3000.0)
    p.d.session.flight.go(camera)
    p.click(f"{icons.SHOWN}##file")  # the last one drawn: of the eastern file
    p.d.rest()
    assert p.d.session.document.hidden_stations == (1,)
    p.d.session.work.undo()
    p.d.rest()
    assert np.array_equal(p.d.bare(), both)


def check_a_clip_that_is_deleted_while_it_is_dragged_changes_no_other(p: Person, folder: Path) -> None:
    from pointglass.viewer.window.interaction.clipping.clip_tool import handles

    p.d.session.go_home()
    p.key("b")
    p.click("+ Box")
    p.click("+ Plan")
    p.d.session.frame_scene()
    p.d.until(lambda: not p.d.session.flight.moving)
    p.d.rest()
    box, plan = p.d.session.document.clips
    (place, _), _ = handles(plan)
    (pixel,), _ = p.d.session.camera.project([place])
    x, y = (round(length) for length in pixel + np.array(p.d.session.area.origin))
    xdo("mousemove", x, y)
    p.d.settle()
    xdo("mousedown", 1)
    xdo("mousemove", x, y + 20)
    p.d.until(lambda: p.d.session.document.clips[1] != plan)
    assert p.d.session.document.clips[0] == box
    p.key("Delete")
    p.d.until(lambda: p.d.session.document.clips == (box,))
    xdo("mousemove", x, y + 40)
    p.d.settle()
    xdo("mouseup", 1)
    p.d.settle()
    assert p.d.session.document.clips == (box,)
    p.key("Escape")


CHECKS = {name.removeprefix("check_"): made for name, made in list(globals().items()) if name.startswith("check_")}


def main(folder: Path, checks=CHECKS) -> None:
    report: dict[str, dict] = {}
    for name in ("scans", "old place", "projects"):
        (folder / name).mkdir()
    d = Driver(folder)
    d.app.files.folders.in_window = True  # where the system has a dialog of its own, too
    d.resize(*SIZE)
    d.settle()
    focus()
    d.settle()
    person = Person(d)
    for name, check in checks.items():
        start, problem = time.monotonic(), None
        try:
            check(person, folder)
        except Exception:
            problem = traceback.format_exc()
            d.picture(f"failed {name[:30]}")
        report[name] = {"problem": problem, "seconds": time.monotonic() - start}
        (folder / "report.json").write_text(json.dumps(report, indent=1))
        d.app.files.close()
        d.session.notices.message, d.app.missing_scans.asked = None, None
        d.settle()
    d.app.close()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
