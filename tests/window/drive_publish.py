"""A person publishes a scan for browsers, by X key and pointer events, for ``test_publish_window.py``."""

import json
import os
import sys
import threading
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np
from checks_written_files import asked_about
from drive_dialogs import Person, main, write_ply
from x_keyboard import xdo

from pointglass.viewer.commands.publishing.publication import Publication
from pointglass.viewer.window.kit import icons

PLACES = 4


def publishing(p: Person):
    return next(tool for tool in p.d.app.toolbox.tools if tool.name == "film").publishing


@contextmanager
def held_at(number: int):
    """Within the block the place with this number, and those after it, wait; gives what lets them go on."""
    usual, go = Publication.render_place, threading.Event()

    def waits(made, wanted, *given):
        assert wanted < number or go.wait(120.0)
        return usual(made, wanted, *given)

    with patch.object(Publication, "render_place", waits):
        try:
            yield go
        finally:
            go.set()


def published_into(p: Person, out: Path) -> None:
    """Presses the dialog's button and gives a folder."""
    p.click("Publish…")
    p.listed()
    xdo("key", "ctrl+a")
    p.type(str(out))
    p.key("Return")


def check_the_dialog_shows_places_on_a_plan_with_size_and_time(p: Person, folder: Path) -> None:
    p.d.drop(write_ply(folder / "scans" / "hall.ply", points=20_000))
    p.opened("hall.ply")
    p.d.until(lambda: not p.d.session.shown_scan.preview)
    p.d.rest()
    p.key("k")
    p.click("Add bookmark")
    view = p.d.session.document.viewpoints[0]
    pose = np.array(view.camera_to_world)
    moved = [pose + np.array([[0, 0, 0, 0.2 * n], [0, 0, 0, 0.1 * n], [0, 0, 0, 0], [0, 0, 0, 0]]) for n in range(PLACES)]
    views = tuple(replace(view, camera_to_world=tuple(map(tuple, made.tolist())), name=f"view {n}")
                  for n, made in enumerate(moved))
    p.d.session.work.edit("Viewpoints", viewpoints=views)
    p.click("Publish…")
    dialog = publishing(p)
    assert dialog.open
    p.click("##places")
    p.d.picture("kinds of places")
    p.click("scanner positions")
    p.d.until(lambda: dialog.problem != "")
    assert "no scanner positions" in dialog.problem and dialog.plan is None
    p.click("##places")
    p.click("viewpoints")
    p.click("##view")
    p.click("filled pictures")
    assert dialog.view == "filled"
    p.d.until(lambda: dialog.plan is not None)
    assert [place.name for place in dialog.plan.places] == [f"view {n}" for n in range(PLACES)]
    assert dialog.plan.seconds > 0 and np.ptp(dialog.plan.picture) > 100
    p.d.settle()
    p.d.picture("publish dialog")


def check_a_publication_is_given_up_in_the_list_of_jobs_and_whole_places_stay(p: Person, folder: Path) -> None:
    out, dialog = folder / "projects" / "site", publishing(p)
    with held_at(2) as go:
        published_into(p, out)
        p.d.until(lambda: dialog.worker is not None)
        assert not dialog.open
        p.d.until(lambda: dialog.worker.done >= 1, 120.0)
        assert dialog.worker.total == PLACES and dialog.worker.title == "Publishing site"
        p.d.picture("publishing")
        asked_about(p, "A publication is being written.")
        p.click(f"{icons.REMOVE}##cancel")
        assert dialog.worker.cancelled
        go.set()
        p.d.until(lambda: dialog.worker is None, 120.0)
    assert "the places made so far stay" in p.d.session.notices.toasts[-1].text
    made = sorted(file.name for file in (out / "coming" / "places").iterdir())
    parts = "depth", "first", "full", "second"
    assert made and made == [f"{n:03d}.{part}.js" for n in range(len(made) // 4) for part in parts]
    assert [entry.name for entry in out.iterdir()] == ["coming"]


def check_it_is_gone_on_with_and_opened_in_the_browser(p: Person, folder: Path) -> None:
    out, dialog = folder / "projects" / "site", publishing(p)
    before = {file.name: file.stat().st_mtime_ns for file in (out / "coming" / "places").iterdir()}
    p.click("Publish…")
    p.d.until(lambda: dialog.open and dialog.plan is not None)
    published_into(p, out)
    p.d.until(lambda: out / "index.html" in p.d.session.notices.saved, 240.0)
    assert before == {name: (out / "places" / name).stat().st_mtime_ns for name in before}
    text = (out / "scene.js").read_text("ascii")
    scene = json.loads(f"[{text[text.index('(') + 1:text.rindex(')')]}]")[1]
    assert [place["name"] for place in scene["places"]] == [f"view {n}" for n in range(PLACES)] and scene["view"] == "filled"
    assert f"Published {PLACES} places" in p.d.session.notices.toasts[-1].text and not (out / "coming").exists()
    opener, opened = folder / "xdg-open", folder / "opened"
    opener.write_text(f'#!/bin/sh\nprintf %s "$1" > {opened}.part && mv {opened}.part {opened}\n')
    opener.chmod(0o755)
    with patch.dict(os.environ, PATH=f"{folder}:{os.environ['PATH']}"):
        p.click("index.html##open")
        p.d.until(opened.is_file)
    assert opened.read_text() == str(out / "index.html")


CHECKS = {name.removeprefix("check_"): made for name, made in list(globals().items()) if name.startswith("check_")}

if __name__ == "__main__":
    main(Path(sys.argv[1]), CHECKS)
