"""Switches the colours of photographs off and on by X pointer events, for ``test_photographs_window.py``."""

import sys
from pathlib import Path

import numpy as np
from drive_dialogs import Person, main

from pointglass.viewer.window.flight.navigation import view_along

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "unit"))

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


CHECKS = {name.removeprefix("check_"): made for name, made in list(globals().items()) if name.startswith("check_")}

if __name__ == "__main__":
    main(Path(sys.argv[1]), CHECKS)
