"""The interface's looks, without a window."""

import pytest


def test_sizes_are_the_same_again_after_any_change_of_screen():
    """imgui truncates what it scales: done one on the other, every move between two screens made them smaller."""
    imgui = pytest.importorskip("imgui_bundle", reason="the window's packages are not installed").imgui
    from pointglass.viewer.window.kit.theme import Theme

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
    from pointglass.viewer.window.kit.theme import Theme, fitted

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


def test_text_and_controls_stand_out_from_what_is_behind_them():
    """WCAG 2.1: 4.5:1 for text, 3:1 for what shows where a control is, over the brightest and the darkest picture."""
    pytest.importorskip("imgui_bundle", reason="the window's packages are not installed")
    from imgui_bundle import ImVec4

    from pointglass.viewer.window.kit import theme
    from pointglass.viewer.window.kit.theme import contrast, over

    white, black = ImVec4(1, 1, 1, 1), ImVec4(0, 0, 0, 1)
    assert contrast(white, black) == pytest.approx(21.0) and contrast(black, white) == contrast(white, black)
    for picture in (white, black):
        panel = over(theme.PANEL, picture)
        for text in (theme.TEXT, theme.DIM, theme.WARN, theme.BAD, theme.ACCENT):
            assert contrast(text, panel) >= 4.5, text
        assert contrast(theme.EDGE, panel) >= 3.0
        assert contrast(theme.ACCENT, panel) >= 3.0
    for field in (theme.FIELD, theme.FIELD_OVER, theme.FIELD_DOWN):
        assert contrast(theme.TEXT, field) >= 4.5
    for filled in (theme.ACCENT, theme.TEXT, theme.DIM):  # a primary button, hovered and pressed
        assert contrast(theme.ACCENT_TEXT, filled) >= 4.5
    assert contrast(theme.EDGE, theme.FIELD) >= 3.0 and contrast(theme.ACCENT, theme.FIELD) >= 3.0
    assert contrast(theme.TEXT, theme.SLIDER) >= 4.5, "the value is written over the bar"
    for colour in theme.OVERLAY_COLOURS.values():
        if colour is not theme.SHADE:
            assert contrast(colour, over(theme.SHADE, white)) >= 3.0 or contrast(colour, white) >= 3.0


def test_the_style_uses_the_colours_that_were_checked():
    imgui = pytest.importorskip("imgui_bundle", reason="the window's packages are not installed").imgui
    from pointglass.viewer.window.kit import theme
    from pointglass.viewer.window.kit.theme import Theme

    context = imgui.create_context()
    try:
        Theme(1.0)
        style = imgui.get_style()
        chosen = {"text": theme.TEXT, "border": theme.EDGE, "button": theme.FIELD, "slider_grab": theme.SLIDER}
        for name, colour in chosen.items():
            shown = style.color_(getattr(imgui.Col_, name))
            assert (shown.x, shown.y, shown.z) == pytest.approx((colour.x, colour.y, colour.z)), name
        assert style.frame_border_size >= 1, "a control is told by its edge"
    finally:
        imgui.destroy_context(context)
