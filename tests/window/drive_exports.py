"""A person exports points, by X key and pointer events, for ``test_exports.py``; other libraries read what was written."""

import sys
from itertools import pairwise
from pathlib import Path

import ezdxf
import laspy
import numpy as np
from checks_align import check_three_pairs_and_icp_bring_a_scan_to_its_place_and_undo_puts_it_back  # noqa: F401
from checks_written_files import asked_about, held
from drive_dialogs import Person, main
from x_keyboard import xdo

from pointglass.viewer.picture.clip import box_around
from pointglass.viewer.window.kit import icons
from pointglass.viewer.window.saving import points_export

LOW, HIGH = (0.5, 0.5, -1.0), (1.5, 2.5, 3.0)


def write_las(path: Path, count: int = 4000) -> laspy.LasData:
    """A wall of coloured points with every attribute of its point format."""
    rng = np.random.default_rng(6)
    las = laspy.create(point_format=7, file_version="1.4")
    las.header.scales, las.header.offsets = (0.001,) * 3, (0.0,) * 3
    las.xyz = rng.random((count, 3)) * (2.0, 3.0, 0.02)
    for name in ("red", "green", "blue", "intensity", "point_source_id"):
        las[name] = rng.integers(0, 65535, count)
    las.gps_time, las.classification = rng.random(count) * 1e9, rng.integers(0, 18, count)
    las.write(path)
    return laspy.read(path)


def check_points_in_sight_are_exported_as_whole_records(p: Person, folder: Path) -> None:
    whole, out = write_las(folder / "scans" / "wall.las"), folder / "projects" / "part.las"
    p.d.drop(folder / "scans" / "wall.las")
    p.opened("wall.las")
    p.d.until(lambda: not p.d.session.shown_scan.preview)
    p.d.session.work.edit("Clip", clips=(box_around(np.array(LOW), np.array(HIGH), "Box"),))
    p.click(f"{icons.EXPORT}##export")
    p.listed()
    assert p.choice.text == "wall part.laz"
    xdo("key", "ctrl+a")
    p.type(f"{folder}/projects/part.las")
    p.key("Return")
    p.d.until(lambda: out in p.d.session.notices.saved, 60.0)
    made = laspy.read(out)
    inside = ((np.asarray(whole.xyz) >= LOW) & (np.asarray(whole.xyz) <= HIGH)).all(axis=1)
    assert 0 < inside.sum() < len(whole.points)
    key = np.argsort(made.gps_time), np.argsort(whole.gps_time[inside])
    assert np.array_equal(made.points.array[key[0]], whole.points.array[inside][key[1]]), "every value of every record"
    p.d.picture("exported")


def check_an_export_is_given_up_in_the_list_of_jobs_and_leaves_nothing(p: Person, folder: Path) -> None:
    out = folder / "projects" / "given up.laz"
    with held(points_export, "export"):
        p.d.app.save_actions.points.start(out)
        p.d.settle()
        asked_about(p, "Points are being exported.")
        p.click(f"{icons.REMOVE}##cancel")
    p.d.until(lambda: p.d.app.save_actions.points.worker is None, 60.0)
    assert not out.exists() and not list(out.parent.glob("*partial*")) and "given up" in p.d.session.notices.toasts[-1].text


def check_a_name_that_cannot_be_written_is_told_and_the_scan_is_never_replaced(p: Person, folder: Path) -> None:
    scan = folder / "scans" / "wall.las"
    before = scan.read_bytes()
    p.d.app.save_actions.points.start(scan)
    p.d.until(lambda: p.d.session.notices.message is not None, 60.0)
    assert "the scan itself" in p.d.session.notices.message.text and scan.read_bytes() == before


def check_splats_are_asked_how_many_and_a_name_with_ply_alone_holds_them(p: Person, folder: Path) -> None:
    from plyfile import PlyData

    out = folder / "projects" / "wall.splats.ply"
    p.click(f"{icons.EXPORT}##export")
    p.listed()
    p.click("##kind")
    p.d.picture("kinds of export")
    p.click("Gaussian splats, PLY (*.splats.ply)")
    p.d.settle()
    assert p.choice.text.endswith(" part.splats.ply")
    xdo("key", "ctrl+a")
    p.type(f"{folder}/projects/wall.ply")
    p.key("Return")
    p.d.until(lambda: p.d.session.notices.message is not None, 60.0)
    message = p.d.session.notices.message
    assert message.title == "How many splats?" and "wall.splats.ply" in message.text
    assert [answer.label for answer in message.answers] == ["2 million", "0.5 million", "8 million", "Cancel"]
    p.d.settle()
    p.d.picture("budget of splats")
    with held(points_export, "export"):
        p.click("0.5 million##1")
        p.d.until(lambda: p.d.app.save_actions.points.worker is not None)
        assert p.d.app.save_actions.points.worker.title == "Exporting splats to wall.splats.ply"
    p.d.until(lambda: out in p.d.session.notices.saved, 90.0)
    rows = PlyData.read(out)["vertex"]
    assert "f_dc_0" in rows and 0 < len(rows.data) <= 4000 and not (folder / "projects" / "wall.ply").exists()
    assert "splats" in p.d.session.notices.toasts[-1].text
    p.d.session.notices.message = None  # what a PLY of splats does not hold


def lasso(p: Person, *corners: tuple[float, float], modifier: str = "") -> None:
    """Draws a line with the left button held.  corners: shares of the picture's width and height."""
    area, before = p.d.session.area.layout.uncovered, p.d.session.document.selection
    places = [(round(area.left + x * area.width), round(area.top + y * area.height)) for x, y in corners]
    if modifier:
        xdo("keydown", modifier)
    xdo("mousemove", *places[0])
    p.d.settle()
    xdo("mousedown", 1)
    for (x0, y0), (x1, y1) in pairwise(places):
        for step in range(1, 9):
            xdo("mousemove", round(x0 + (x1 - x0) * step / 8), round(y0 + (y1 - y0) * step / 8))
            p.d.settle(1)
    xdo("mouseup", 1)
    if modifier:
        xdo("keyup", modifier)
    tool = p.d.app.toolbox.active
    p.d.until(lambda: tool.job.worker is None and p.d.session.document.selection is not before, 60.0)
    p.d.settle()


def check_a_lasso_classifies_points_which_a_project_keeps_and_an_export_writes(p: Person, folder: Path) -> None:
    p.d.session.work.undo()  # the clip
    scan, out = folder / "scans" / "wall.las", folder / "projects" / "roof.laz"
    before, bytes_before = laspy.read(scan), scan.read_bytes()
    work, tool = p.d.session.work, next(tool for tool in p.d.app.toolbox.tools if tool.name == "select")
    p.key("r", "f")
    p.d.rest()
    shown, camera = p.d.canvas(), p.d.session.camera
    lasso(p, (0.3, 0.3), (0.6, 0.3), (0.6, 0.8), (0.3, 0.8))
    count = work.document.selection.count
    assert count > 20 and tool.facts is not None and tool.facts.bounds is not None
    lasso(p, (0.2, 0.2), (0.45, 0.2), (0.45, 0.9), (0.2, 0.9), modifier="ctrl")
    assert 0 < work.document.selection.count < count, "Ctrl takes points away"
    p.d.rest()
    assert not np.array_equal(p.d.canvas(), shown), "what is selected is tinted"
    p.d.picture("selected")
    key = ((scan.name, len(before.points)),)
    chosen = work.document.selection.mask(key)
    area, layout = p.d.session.area.size, p.d.session.area.layout
    pixels, depth = camera.project(np.asarray(before.xyz))
    pixels -= np.array([layout.uncovered.left - layout.picture.left, layout.uncovered.top - layout.picture.top])
    share = pixels / (layout.uncovered.width, layout.uncovered.height)
    wanted = (depth > 0) & (share[:, 0] > 0.45) & (share[:, 0] < 0.6) & (share[:, 1] > 0.3) & (share[:, 1] < 0.8)
    assert (chosen != wanted).mean() < 0.01, ("the points under the lasso", area)
    p.click("##code")
    xdo("key", "ctrl+a")
    xdo("type", "17")
    p.d.settle()
    p.click("Classify")
    p.d.until(lambda: bool(work.document.reclassified), 60.0)
    assert not work.document.selection and work.document.reclassified[0].code == 17
    p.key("ctrl+z", "ctrl+y")
    assert work.document.reclassified[0].points.mask(key).sum() == chosen.sum()
    saved, scene = work.document.reclassified, p.d.session.scene
    xdo("key", "ctrl+s")
    p.d.until(lambda: work.project is not None, 60.0)
    p.click(f"{icons.REMOVE}##close_scan")
    p.d.until(lambda: p.d.session.scene is None)
    p.d.drop(folder / "scans" / "wall.pointglass")
    p.d.until(lambda: p.d.session.scene not in (None, scene) and not p.d.session.shown_scan.preview, 90.0)
    p.d.settle()
    assert work.document.reclassified == saved
    p.click(f"{icons.EXPORT}##export")
    p.listed()
    xdo("key", "ctrl+a")
    p.type(str(out))
    p.key("Return")
    p.d.until(lambda: out in p.d.session.notices.saved, 60.0)
    made, classes = laspy.read(out), np.array(before.classification)
    classes[chosen] = 17
    assert np.array_equal(made.classification, classes), "exactly these points have the class"
    made.classification = np.array(before.classification)
    assert np.array_equal(made.points.array, before.points.array), "and everything else is as it was"
    assert scan.read_bytes() == bytes_before
    p.key("r")
    p.d.picture("classified")


def check_a_sheet_on_paper_and_a_drawing_of_its_lines_are_saved_from_the_section_tool(p: Person, folder: Path) -> None:
    p.d.session.work.undo()  # the clip
    p.key("n")
    p.d.settle()
    p.click("##paper")
    p.click("A4")
    tool = next(tool for tool in p.d.app.toolbox.tools if tool.name == "section")
    assert tool.sheet.paper == "A4" and tool.sheet.scale is None
    tool.height = 0.01  # the scan is flat: all of it is cut
    for name, start in (("sheet.pdf", b"%PDF"), ("lines.dxf", b"")):
        out = folder / "projects" / name
        p.click("Save sheet…")
        p.listed()
        xdo("key", "ctrl+a")
        p.type(f"{folder}/projects/{name}")
        p.key("Return")
        p.d.until(lambda out=out: out in p.d.session.notices.saved, 60.0)
        assert out.read_bytes().startswith(start)
    ezdxf.readfile(folder / "projects" / "lines.dxf")  # type: ignore[reportPrivateImportUsage]
    p.d.picture("section panel")
    p.key("Escape")


CHECKS = {name.removeprefix("check_"): made for name, made in list(globals().items()) if name.startswith("check_")}

if __name__ == "__main__":
    main(Path(sys.argv[1]), CHECKS)
