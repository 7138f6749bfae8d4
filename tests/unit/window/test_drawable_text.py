"""Text that no UTF-8 has, drawn by a real imgui context (viewer.window.kit.drawable_text)."""

from time import sleep

import numpy as np
import pytest

from pointglass.viewer.common import fonts
from pointglass.viewer.window.kit.drawable_text import accept_any_text, drawable


def test_any_text_is_drawn_and_a_wrong_argument_is_refused_as_before(seed):
    imgui = pytest.importorskip("imgui_bundle").imgui
    accept_any_text(imgui)
    accept_any_text(imgui)
    random = np.random.default_rng(seed)
    context = imgui.create_context()
    io = imgui.get_io()
    io.display_size, io.delta_time = imgui.ImVec2(640, 480), 0.02
    io.backend_flags |= imgui.BackendFlags_.renderer_has_textures
    io.set_ini_filename("")
    for _ in range(10):
        text = "".join(map(chr, random.choice([65, 0xE9, 0x6C34, 0x1F600, 0xD800, 0xDCE9, 0xDFFF], 8)))
        imgui.new_frame()
        imgui.begin("a window")
        imgui.text(text)
        imgui.button(text)
        assert imgui.input_text("##name", text)[0] is False
        assert imgui.calc_text_size(text).x == imgui.calc_text_size(drawable(text)).x > 0
        imgui.get_window_draw_list().add_text(imgui.ImVec2(5, 5), 0xFFFFFFFF, text)
        imgui.combo("##choice", 0, [text, "b"])
        with pytest.raises(TypeError):
            imgui.text(5)
        imgui.end()
        imgui.render()
    imgui.destroy_context(context)


def test_only_halves_of_characters_are_escaped():
    assert drawable("caf\udce9\n水") == "caf\\udce9\n水" and drawable("café 水\x1b") == "café 水\x1b"
    assert drawable(["a\ud800", 5, None]) == ["a\\ud800", 5, None] and drawable(7) == 7


LACKED = "水א"
"""Letters of two scripts that the interface's typeface does not have."""


def write_font(path, letters):
    """A font in which each letter is a square."""
    from fontTools.fontBuilder import FontBuilder
    from fontTools.pens.ttGlyphPen import TTGlyphPen

    pen = TTGlyphPen(None)
    pen.moveTo((0, 0))
    for corner in ((0, 900), (900, 900), (900, 0)):
        pen.lineTo(corner)
    pen.closePath()
    square, names = pen.glyph(), [".notdef", *(f"uni{ord(letter):04X}" for letter in letters)]
    made = FontBuilder(1000, isTTF=True)
    made.setupGlyphOrder(names)
    made.setupCharacterMap({ord(letter): name for letter, name in zip(letters, names[1:], strict=True)})
    made.setupGlyf(dict.fromkeys(names, square))
    made.setupHorizontalMetrics(dict.fromkeys(names, (1000, 0)))
    made.setupHorizontalHeader(ascent=900, descent=-100)
    made.setupNameTable({"familyName": path.stem, "styleName": "Regular"})
    made.setupOS2(sTypoAscender=900, usWinAscent=900, usWinDescent=100)
    made.setupPost()
    made.save(path)


def test_letters_that_the_typeface_lacks_are_drawn_from_a_font_of_the_machine(tmp_path, monkeypatch):
    imgui = pytest.importorskip("imgui_bundle").imgui
    from pointglass.viewer.window.kit.theme import Theme

    for number, letter in enumerate(LACKED):
        write_font(tmp_path / f"font{number}.ttf", letter)
    (tmp_path / "damaged.ttf").write_bytes(b"no font")
    monkeypatch.setenv(fonts.ENVIRONMENT, str(tmp_path))
    for found in (fonts.machine_fonts, fonts.font_with):
        found.cache_clear()
    context, woken = imgui.create_context(), []
    io = imgui.get_io()
    io.display_size, io.delta_time = imgui.ImVec2(640, 480), 0.02
    io.backend_flags |= imgui.BackendFlags_.renderer_has_textures
    io.set_ini_filename("")
    try:
        theme = Theme(1.0, lambda: woken.append(True))

        def frame():
            theme.fallback.follow()
            imgui.new_frame()
            imgui.begin("a window")
            imgui.input_text("##name", f"Größe Журнал {LACKED}")
            imgui.combo("##choice", 0, [LACKED, "b"])
            width = imgui.calc_text_size(LACKED).x
            imgui.end()
            imgui.render()
            return width

        assert all(theme.regular.is_glyph_in_font(ord(letter)) for letter in "ößЖя"), "its own letters"
        frame()
        for _ in range(6000):  # the search runs on a thread
            if frame() == 2 * round(theme.regular.legacy_size):
                break
            sleep(0.01)
        for typeface in (theme.regular, theme.bold):
            assert all(typeface.is_glyph_in_font(ord(letter)) for letter in LACKED)
        assert woken and frame() == 2 * round(theme.regular.legacy_size), "each letter is as wide as it is high"
    finally:
        imgui.destroy_context(context)
        for found in (fonts.machine_fonts, fonts.font_with):
            found.cache_clear()
