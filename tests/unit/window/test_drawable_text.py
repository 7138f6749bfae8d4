"""Text that no UTF-8 has, drawn by a real imgui context (viewer.window.kit.drawable_text)."""

import numpy as np
import pytest

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
