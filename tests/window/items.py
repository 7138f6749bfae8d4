"""Finds the items of the panels by their labels."""

from driver import Driver
from imgui_bundle import imgui


class Items:
    """Where the items of the panels are: their rectangles by label, recorded while a frame is drawn."""

    KINDS = ("button", "begin_combo", "selectable", "input_text", "slider_float", "checkbox", "radio_button", "small_button",
             "invisible_button", "drag_float", "input_double", "input_int",
             "slider_int", "collapsing_header")

    def __init__(self, d: Driver):
        self._driver = d

    def click(self, label: str, button: int | None = None) -> None:
        """Clicks the middle of the item whose label is ``label``; with the left button where none is told."""
        (left, top), (right, bottom) = self.find(label)
        self._driver.click((left + right) / 2, (top + bottom) / 2, button)

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
