"""The interface's looks, without a window."""

import pytest


def test_sizes_are_the_same_again_after_any_change_of_screen():
    """imgui truncates what it scales: done one on the other, every move between two screens made them smaller."""
    imgui = pytest.importorskip("imgui_bundle", reason="the window's packages are not installed").imgui
    from viewer.window.theme import Theme

    context = imgui.create_context()
    try:
        theme, style = Theme(1.0), imgui.get_style()

        def sizes():
            return [(size.x, size.y) for size in (style.frame_padding, style.cell_padding, style.item_spacing)]

        first, larger = sizes(), []
        for scale in (1.25, 2.0, 1.25, 1.0):
            theme.rescale(scale)
            larger.append(sizes())
        assert larger[0] == larger[2] != first and larger[1][0] == (20, 10) and larger[3] == first
    finally:
        imgui.destroy_context(context)


def test_a_name_too_long_keeps_its_beginning_and_its_end():
    imgui = pytest.importorskip("imgui_bundle", reason="the window's packages are not installed").imgui
    from viewer.window.theme import Theme, fitted

    context = imgui.create_context()
    try:
        io = imgui.get_io()
        io.set_ini_filename("")  # leaves no file behind
        io.backend_flags |= imgui.BackendFlags_.renderer_has_textures
        io.display_size = (640, 400)
        Theme(1.0)
        imgui.new_frame()
        name = "2026-11-04_registered_merged_" + 20 * "level-02_" + "5mm.e57"
        short = fitted(name, 258.0)
        assert fitted("house.e57", 258.0) == "house.e57"
        assert short.startswith("2026-11-04") and "…" in short and short.endswith("5mm.e57")
        assert 200 < imgui.calc_text_size(short).x <= 258 and fitted(name, 0.0) == "…"
        imgui.end_frame()
    finally:
        imgui.destroy_context(context)
