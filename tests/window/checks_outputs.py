"""Checks of what is assigned to a scan and of what is saved from the window: reference system, films, pictures, sheets."""

from pathlib import Path

from driver import SIZE, Driver
from imgui_bundle import imgui


class Items:
    """Where the items of the panels are: their rectangles by label, recorded while a frame is drawn."""

    KINDS = ("button", "begin_combo", "selectable", "input_text", "slider_float", "checkbox", "radio_button", "small_button")

    def __init__(self, d: Driver):
        self._driver = d

    def click(self, label: str) -> None:
        """Clicks the middle of the item whose label is ``label``."""
        (left, top), (right, bottom) = self.find(label)
        self._driver.click((left + right) / 2, (top + bottom) / 2)

    def find(self, label: str) -> tuple[tuple[float, float], tuple[float, float]]:
        """Lowest and highest corner of an item, pixels of the window."""
        found, usual = {}, {name: getattr(imgui, name) for name in self.KINDS}

        def recorded(name):
            def call(text, *rest):
                answer = usual[name](text, *rest)
                opened = name == "begin_combo" and answer  # then the last item is no longer the combo
                if text == label and not opened:
                    low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
                    found[label] = (low.x, low.y), (high.x, high.y)
                return answer

            return call

        try:
            for name in self.KINDS:
                setattr(imgui, name, recorded(name))
            self._driver.settle(2)
        finally:
            for name, call in usual.items():
                setattr(imgui, name, call)
        assert label in found, f"no item {label!r} is drawn"
        return found[label]


def typed(d: Driver, text: str) -> None:
    """Types into the field that has the keyboard."""
    for character in text:
        imgui.get_io().add_input_character(ord(character))
        d.settle(2)


def check_a_reference_system_is_chosen_by_its_code_and_by_its_name(d: Driver) -> None:
    d.resize(1280, 720)
    d.drop(Path("room7"))
    d.until(lambda: d.session.loads.current is None and d.session.scene is not None and not d.session.visit.preview)
    d.rest()
    items = Items(d)
    d.app.toolbox.select("scene", d.app.tools)
    panel = d.app.toolbox.active.reference
    before = d.session.document
    items.click("##crs")
    typed(d, "999999")
    d.key("ENTER")
    assert "epsg.io" in panel._problem and d.session.document == before
    d.key("ESCAPE")
    items.click("##crs")
    typed(d, "25833")
    d.key("ENTER")
    assert {scan.crs for scan in d.session.document.scans} == {"EPSG:25833"} and d.session.facts["units"] == "metre"
    items.click("##crs")
    typed(d, "etrs89 / utm zone 32n")
    d.until(lambda: panel._systems.finished)
    items.click("EPSG:25832  ETRS89 / UTM zone 32N")
    assert d.session.facts["crs"] == "EPSG:25832"
    d.picture("reference")
    for _ in range(2):
        d.session.work.undo()
    assert d.session.document.scans == before.scans and d.session.facts["crs"] is None
    d.app.toolbox.select("scene", d.app.tools)
    d.resize(*SIZE)
    d.rest()
