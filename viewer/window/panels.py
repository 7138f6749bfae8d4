"""The settings panel, made from the tables of ``viewer/settings.py``: a choice added there appears here."""

from dataclasses import replace

from imgui_bundle import ImVec2, imgui

from viewer.settings import BACKGROUNDS, CHOICES, VIEWS, Settings
from viewer.tools.background import COLOURS
from viewer.window import theme
from viewer.window.hud import MARGIN, OVERLAY
from viewer.window.session import Session
from viewer.window.theme import Theme, text_in

WIDTH = 312.0
_LABEL = 96.0
_LOD_DEFAULT = 4.0


def draw_panel(session: Session, look: Theme) -> None:
    """Top right, or a button that brings it back.  Every change is a new Settings record, asked of the session."""
    if session.scene is None:
        return
    px, size = look.px, imgui.get_io().display_size
    imgui.set_next_window_pos(ImVec2(size.x - px(MARGIN), px(MARGIN)), 0, ImVec2(1.0, 0.0))
    if not session.panel:
        _folded(session, look)
        return
    width = min(px(WIDTH), size.x - 2 * px(MARGIN))
    imgui.set_next_window_size_constraints(ImVec2(width, 0), ImVec2(width, size.y - 2 * px(MARGIN)))
    flags = (OVERLAY & ~imgui.WindowFlags_.no_scrollbar) | imgui.WindowFlags_.always_auto_resize
    imgui.begin("panel", None, flags | imgui.WindowFlags_.no_bring_to_front_on_focus)  # toasts stay above it
    imgui.push_font(look.regular, theme.FONT_SIZE - 1)
    old = session.view_settings.shown_settings
    _heading("View", look)
    imgui.same_line(width - px(16) - imgui.calc_text_size("hide").x - 2 * imgui.get_style().frame_padding.x)
    imgui.push_style_color(imgui.Col_.button, (0, 0, 0, 0))
    imgui.push_style_color(imgui.Col_.text, theme.DIM)
    if imgui.small_button("hide"):
        session.panel = False
    imgui.pop_style_color(2)
    new = _views(old, look)
    _compare(session, look)
    _background(session, look)
    _heading("Filter", look)
    new = _choice(new, "filter", "preset", look)
    with_filter = new.filter != "off"
    imgui.begin_disabled(not with_filter)
    _label("strength", "multiplies the depth tolerance; 1 is the preset's own, less keeps fewer points", look)
    new = replace(new, filter_strength=_slider("##strength", new.filter_strength, 0.1, 10.0, "%.2f"))
    _label("levels", "depths of the pyramid; auto is the preset's own", look)
    changed, value = imgui.slider_int(
        "##levels", new.filter_levels or 0, 0, 12, "auto" if new.filter_levels is None else "%d", _CLAMP
    )
    if changed:
        new = replace(new, filter_levels=value or None)
    imgui.end_disabled()
    _heading("Points", look)
    _label("detail", "points drawn per pixel a cell covers; every point where it is off", look)
    every = new.lod is None
    ticked, on = imgui.checkbox("##lod", not every)
    if ticked:
        new = replace(new, lod=_LOD_DEFAULT if on else None)
    imgui.same_line()
    imgui.set_next_item_width(-1)
    imgui.begin_disabled(every)
    value = _slider("##lod points", new.lod or _LOD_DEFAULT, 0.25, 32.0, "every point" if every else "%.2f a pixel")
    if new.lod is not None:
        new = replace(new, lod=value)
    imgui.end_disabled()
    new = _choice(new, "stations", "stations", look)
    new = _choice(new, "soft_z", "soft depth", look)
    new = _choice(new, "raster", "rasteriser", look)
    _heading("Network", look)
    new = _choice(new, "quality", "quality", look)
    _label("detail", "from smooth to every measured grain; in the middle as the scan's noise asks for", look)
    changed, detail = imgui.slider_float("##detail", new.detail, 0.0, 2.0, _detail_text(new.detail), _CLAMP)
    if changed and 0.0 <= detail <= 2.0:
        new = replace(new, detail=detail)
    new = _own_weights(new, session, look)
    new = _choice(new, "precision", "precision", look)
    new = _choice(new, "device", "device", look)
    _label("flying", "where it is slow: fewer points and the filled view while moving, all of it at rest", look)
    changed, quick = imgui.checkbox("keep up while moving", session.picture.adaptive_lod.keep_up)
    if changed:
        session.picture.adaptive_lod.keep_up, session.picture.dirty = quick, True
    imgui.dummy(ImVec2(0, px(2)))
    imgui.begin_disabled(new == Settings(view=new.view))
    if imgui.button("Back to defaults", ImVec2(-1, 0)):
        new = Settings(view=new.view)
    imgui.end_disabled()
    imgui.pop_font()
    imgui.end()
    if new != old:
        session.view_settings.request(new)


def _folded(session: Session, look: Theme) -> None:
    imgui.push_style_var(imgui.StyleVar_.window_padding, ImVec2(0, 0))
    imgui.push_style_var(imgui.StyleVar_.window_border_size, 0.0)
    imgui.begin("folded panel", None, OVERLAY | imgui.WindowFlags_.always_auto_resize)
    imgui.push_font(look.regular, theme.FONT_SIZE - 1)
    if imgui.button("Settings"):
        session.panel = True
    imgui.pop_font()
    imgui.end()
    imgui.pop_style_var(2)


def _detail_text(detail: float) -> str:
    """What stands in the slider: imgui puts the number where the format asks for one."""
    return "by the noise" if abs(detail - 1.0) < 0.02 else "%.2f smoother" if detail < 1.0 else "%.2f finer"


_SHIPPED = "shipped"
_CLAMP = imgui.SliderFlags_.always_clamp


def _heading(text: str, look: Theme) -> None:
    if imgui.get_cursor_pos_y() > look.px(40):
        imgui.dummy(ImVec2(0, look.px(2)))
    imgui.push_font(look.bold, theme.FONT_SIZE - 1)
    imgui.text_unformatted(text)
    imgui.pop_font()


def _label(text: str, hint: str, look: Theme) -> None:
    """The name at the left of a row, explained where the pointer rests; the next widget takes the rest of the row."""
    imgui.align_text_to_frame_padding()
    text_in(theme.DIM, text)
    _hint(hint, look)
    imgui.same_line(look.px(_LABEL))
    imgui.set_next_item_width(-1)


def _slider(label: str, value: float, least: float, most: float, form: str) -> float:
    """The number chosen, or typed: then it may be none, which imgui takes for one within its limits."""
    changed, chosen = imgui.slider_float(label, value, least, most, form, imgui.SliderFlags_.logarithmic | _CLAMP)
    return chosen if changed and least <= chosen <= most else value


def _hint(text: str, look: Theme) -> None:
    if text and imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip):
        left = imgui.get_io().display_size.x - look.px(MARGIN + WIDTH + 8)
        if left > look.px(WIDTH):  # beside the panel: below the pointer it would hide the choices to come
            imgui.set_next_window_pos(ImVec2(left, imgui.get_item_rect_min().y), 0, ImVec2(1.0, 0.0))
        imgui.begin_tooltip()
        imgui.push_text_wrap_pos(look.px(280))
        imgui.text_unformatted(text)
        imgui.pop_text_wrap_pos()
        imgui.end_tooltip()


def _views(settings: Settings, look: Theme) -> Settings:
    """The four views as one row of buttons, the chosen one in the accent colour."""
    spacing = look.px(4)
    width = (imgui.get_content_region_avail().x - (len(VIEWS) - 1) * spacing) / len(VIEWS)
    imgui.push_style_var(imgui.StyleVar_.frame_padding, ImVec2(0, look.px(6)))
    for number, (view, hint) in enumerate(VIEWS.items()):
        if number:
            imgui.same_line(0, spacing)
        chosen = settings.view == view
        if chosen:
            imgui.push_style_color(imgui.Col_.button, theme.ACCENT)
            imgui.push_style_color(imgui.Col_.button_hovered, theme.ACCENT)
            imgui.push_style_color(imgui.Col_.button_active, theme.ACCENT)
            imgui.push_style_color(imgui.Col_.text, theme.ACCENT_TEXT)
        if imgui.button(view, ImVec2(width, 0)):
            settings = replace(settings, view=view)
        if chosen:
            imgui.pop_style_color(4)
        _hint(f"{number + 1}: {hint}", look)
    imgui.pop_style_var()
    return settings


def _compare(session: Session, look: Theme) -> None:
    _label("compare", "two views side by side; V switches it", look)
    changed, on = imgui.checkbox("with", session.view_settings.split)
    if changed:
        session.view_settings.compare(on)
    imgui.same_line()
    imgui.set_next_item_width(-1)
    imgui.begin_disabled(not session.view_settings.split)
    chosen = _combo("##left side", session.view_settings.left, VIEWS, look)
    if chosen != session.view_settings.left:
        session.view_settings.choose_left(chosen)
    imgui.end_disabled()


def _background(session: Session, look: Theme) -> None:
    """A row that chooses what is behind the picture; only the canvas is drawn again."""
    table = {name: BACKGROUNDS[name] for name in COLOURS}
    _label("background", f"where nothing was measured or filled: {table[session.view_settings.background]}", look)
    session.view_settings.background = _combo("##background", session.view_settings.background, table, look)


def _choice(settings: Settings, name: str, label: str, look: Theme) -> Settings:
    """A row that chooses one of a table's entries."""
    table, value = CHOICES[name], getattr(settings, name)
    _label(label, table[value], look)
    chosen = _combo(f"##{name}", value, table, look)
    return settings if chosen == value else replace(settings, **{name: chosen})


def _own_weights(settings: Settings, session: Session, look: Theme) -> Settings:
    """A row that chooses among a person's own weights, where there are any."""
    if not session.view_settings.own_weights and settings.weights is None:
        return settings
    names = {str(path): name for name, path in session.view_settings.own_weights.items()}
    if settings.weights is not None:
        names.setdefault(settings.weights, settings.weights.rpartition("/")[2])
    table = {_SHIPPED: "the weights that came with pointglass", **{name: path for path, name in names.items()}}
    value = _SHIPPED if settings.weights is None else names[settings.weights]
    _label("weights", "your own weights, made by `pointglass train`", look)
    chosen = _combo("##weights", value, table, look)
    path = next((path for path, name in names.items() if name == chosen), None)
    return settings if chosen == value else replace(settings, weights=path)


def _combo(label: str, value: str, table: dict[str, str], look: Theme) -> str:
    if imgui.begin_combo(label, value):
        for option, hint in table.items():
            if imgui.selectable(option, option == value)[0]:
                value = option
            _hint(hint, look)
        imgui.end_combo()
    return value
