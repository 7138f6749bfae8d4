"""Letters that the plain font lacks are drawn in reports, on sheets and over pictures, in a font that has them."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

HAN = "\u5317\u5c4b"
SCRIPT = """
import io, sys
import numpy as np
from pointglass.viewer.commands.report.pages import Pages, line_width
from pointglass.viewer.commands.section.sheet import _save
from pointglass.viewer.common.fonts import families
from pointglass import look_at
from pointglass.viewer.work.pictures.drawn_over import with_shapes
from pointglass.viewer.work.pictures.picture_legend import Legend, with_legend

pages = Pages("foot")
pages.heading(sys.argv[1])
pages.text(sys.argv[1])
data = io.BytesIO()
_save([(figure, 100) for figure in pages.finished()], data, "pdf")
black = np.zeros((300, 400, 3), np.uint8)
legend = with_legend(black, Legend(sys.argv[1], [((1, 2, 3), sys.argv[1])]))
camera = look_at((0, -5, 0), (0, 0, 0), size=(400, 300))
label = with_shapes(black, camera, lambda *_: None, [np.zeros(3)], [sys.argv[1]])
print(int(b"Squares" in data.getvalue()), (legend > 200).sum(), (label > 200).sum(),
      round(line_width(sys.argv[1], 10), 3), families(sys.argv[1]))
"""


@pytest.fixture(scope="module")
def fonts(tmp_path_factory) -> Path:
    """A folder with a font whose Han letters are squares, 0.9 of its size wide."""
    from fontTools.fontBuilder import FontBuilder
    from fontTools.pens.ttGlyphPen import TTGlyphPen

    pen = TTGlyphPen(None)
    pen.moveTo((0, 0))
    for corner in ((0, 700), (800, 700), (800, 0)):
        pen.lineTo(corner)
    pen.closePath()
    square = pen.glyph()
    names = [".notdef", *(f"uni{ord(letter):X}" for letter in HAN)]
    made = FontBuilder(1000, isTTF=True)
    made.setupGlyphOrder(names)
    made.setupCharacterMap({ord(letter): name for letter, name in zip(HAN, names[1:], strict=True)})
    made.setupGlyf(dict.fromkeys(names, square))
    made.setupHorizontalMetrics(dict.fromkeys(names, (900, 0)))
    made.setupHorizontalHeader(ascent=800, descent=-200)
    made.setupNameTable({"familyName": "Squares", "styleName": "Regular", "psName": "Squares"})
    made.setupOS2()
    made.setupPost()
    folder = tmp_path_factory.mktemp("fonts")
    made.save(folder / "squares.ttf")
    return folder


@pytest.mark.slow
def test_a_font_of_the_machine_draws_what_the_plain_one_lacks(fonts, tmp_path):
    """In a process of its own: which fonts there are is asked once."""
    def told(folder: Path) -> list[str]:
        found = subprocess.run([sys.executable, "-c", SCRIPT, HAN], check=False, capture_output=True, text=True,
                               env={**os.environ, "POINTGLASS_FONTS": str(folder)})
        assert found.returncode == 0, found.stderr
        return found.stdout.split(maxsplit=4)

    with_it, without = told(fonts), told(tmp_path)
    assert with_it[0] == "1" and "Squares" in with_it[4] and "Squares" not in without[4]
    assert float(with_it[3]) == pytest.approx(2 * 0.9 * 10 / 72 * 25.4, rel=0.02)
    assert int(with_it[1]) > 1.5 * int(without[1]) > 0 and int(with_it[2]) > 1.5 * int(without[2]) > 0, "filled, not outlined"


def test_numbers_stay_where_they_stand_beside_words_from_right_to_left():
    from pointglass.viewer.common.fonts import in_order

    name, mark = "\u05d1\u05d9\u05ea", "\u200e"
    assert in_order(f"3   {name}") == f"{mark}3   {name}"
    assert in_order(f"{name}  4.21 m, {name} b") == f"{mark}{name}{mark}  4.21 m, {name} b"
    assert in_order(name) == name and in_order("3   house") == "3   house"
