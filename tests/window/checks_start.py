"""Checks of the start page: it invites, unseen keys do nothing, recent scans open again, bad files leave the good ones."""

import numpy as np
from driver import SIZE, Driver


def check_empty_start_page_invites(d: Driver) -> None:
    image = d.canvas()
    assert image.shape == (SIZE[1], SIZE[0], 3)
    assert image.std() > 0, "the start page is blank"


def check_keys_do_nothing_unseen_on_the_start_page(d: Driver) -> None:
    before, settings = d.canvas(), d.session.view_settings.shown_settings
    for key in ("1", "2", "4", "V", "F", "HOME", "F3", "F10", "W"):
        d.key(key)
    session = d.session
    assert session.view_settings.shown_settings == settings and not session.view_settings.split
    assert session.interface and not session.profiler and not session.flight.held
    assert np.array_equal(before, d.canvas())


def check_one_bad_file_does_not_discard_the_good_ones(d: Driver) -> None:
    from pointglass.viewer.common.errors import InputError

    bad, usual, asked = d.folder / "broken.ply", d.session.loads.open_scene, []

    def opened(paths, **colours):
        asked.append(list(paths))
        if bad in paths:
            raise InputError("the header ends early", file=bad)
        return usual([path for path in paths if path.name.startswith("room")])

    d.session.loads.open_scene = opened
    try:
        d.drop(d.folder / "room4", bad, d.folder / "room6")
        d.until(lambda: d.session.loads.current is None, 120.0)  # the first scene: numba may have to compile
    finally:
        d.session.loads.open_scene = usual
    message = d.session.notices.message
    assert message is not None and message.title == "1 of 3 files could not be opened" and "broken.ply" in message.text
    assert asked[-1] == [d.folder / "room4", d.folder / "room6"] and d.session.scene is not None
    d.key("ESCAPE")


def check_a_closed_scan_is_a_recent_one_with_a_thumbnail(d: Driver) -> None:
    from pointglass.viewer.window.session.recent import load_thumbnail, recent_scans

    if d.session.scene is None:
        d.drop(d.folder / "room4", d.folder / "room6")
        d.until(lambda: d.session.loads.current is None and d.session.scene is not None, 120.0)
    d.rest()
    d.app.act("close_scan")
    assert d.session.scene is None
    scan = recent_scans()[0]
    assert scan.title.startswith("room4") and scan.points == 50_000
    picture = load_thumbnail(scan)
    assert picture is not None and picture.shape == (200, 320, 3) and picture.std() > 5
    assert d.canvas().std() > 0
    assert scan.missing, "its file was never there"
