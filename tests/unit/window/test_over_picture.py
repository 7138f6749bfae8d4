"""What F12 draws over a picture (viewer.window.saving.over_picture), and how it says so."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from documents import random_note

from pointglass.viewer.common import fonts
from pointglass.viewer.picture.clip import vector
from pointglass.viewer.preprocess.scan_description import ScanDescription
from pointglass.viewer.window.saving import over_picture as module
from pointglass.viewer.window.saving.over_picture import OverPicture, over_picture
from pointglass.viewer.work.document import Document
from pointglass.viewer.work.measuring.measurement import MeasuredPoint, Measurement
from pointglass.viewer.work.pictures.picture_legend import Legend

LEGEND = Legend("class", [((255, 0, 0), "ground")])


def test_it_is_said_in_words(seed):
    random = np.random.default_rng(seed)
    made = Measurement("distance", tuple(MeasuredPoint(vector(random.random(3))) for _ in range(2)), "A")
    note = random_note(random, "x")
    assert OverPicture().text == ""
    assert OverPicture((made,)).text == " with 1 measurement"
    assert OverPicture((made, made), "m", (note,)).text == " with 2 measurements and 1 note"
    assert OverPicture((made,), "m", (note, note), LEGEND).text == " with 1 measurement, 2 notes and its legend"


def test_letters_that_no_font_has_are_named(tmp_path, monkeypatch, seed):
    def asked_again():
        fonts.machine_fonts.cache_clear()
        fonts.font_with.cache_clear()

    random = np.random.default_rng(seed)
    made = Measurement("distance", tuple(MeasuredPoint(vector(random.random(3))) for _ in range(2)), "\u7ba1")
    note, legend = replace(random_note(random, "\u5317"), text="\u5317"), Legend("\u5c4b", [((255, 0, 0), "\u7ba1 ground")])
    asked_again()
    with monkeypatch.context() as patched:
        patched.setenv(fonts.ENVIRONMENT, str(tmp_path))
        assert OverPicture((made,), "m", legend=LEGEND).boxes == "", "a single measurement is drawn without its name"
        over = OverPicture((made, made), "m", (note,), legend)
        assert "no font on this machine has \u7ba1 \u5317 \u5c4b; install" in over.boxes
    asked_again()


@pytest.mark.parametrize("chosen", range(8))
def test_each_part_is_drawn_where_it_is_chosen(chosen, monkeypatch, seed):
    random = np.random.default_rng(seed)
    note = random_note(random, "x")
    camera = note.view.camera(320, 240)
    middle = camera.position + 3 * camera.forward
    note = note.__class__("x", vector(middle))
    ends = camera.unproject(np.array([[60.0, 60.0], [250.0, 90.0]]), np.full(2, 4.0))
    made = Measurement("distance", tuple(MeasuredPoint(vector(end)) for end in ends), "A")
    measured, noted, legend = (bool(chosen >> k & 1) for k in range(3))
    work = SimpleNamespace(shot_measured=measured, shot_noted=noted, shot_legend=legend, facts=lambda meta: meta)
    document = Document(measurements=(made,), annotations=(note,))
    monkeypatch.setattr(module, "shown_legend", lambda session: LEGEND)
    session = SimpleNamespace(work=work, document=document, scene=SimpleNamespace(meta=ScanDescription()), camera=camera)
    black = np.zeros((240, 320, 3), np.uint8)
    over = over_picture(cast(Any, session)).drawn(black, camera)
    assert (np.abs(over[120, 160].astype(int) - (240, 185, 91)).max() < 5) == noted
    assert bool((over[60:95, 60:250] > 60).any()) == measured
    assert bool((over[200:, :60] > 200).any()) == legend
    session.camera = parallel = replace(camera, orthographic=5.0)
    assert bool((over_picture(cast(Any, session)).drawn(black, parallel)[200:, -60:] > 200).any()) == legend, "a scale bar"
    session.scene = None
    assert np.array_equal(over_picture(cast(Any, session)).drawn(black, camera), black)
