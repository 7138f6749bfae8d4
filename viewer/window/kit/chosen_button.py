"""Which button of a dialog Enter presses: the usual one, until Tab or an arrow key chooses another one.

imgui's own keyboard navigation is off in the whole window, where the arrow keys and Tab belong to the fields and the tools.
"""

from collections.abc import Sequence

from imgui_bundle import imgui


class ChosenButton:
    """label: of the button that Enter presses, which is drawn as the primary one; "" before the first dialog."""

    def __init__(self) -> None:
        self.label = ""
        self._of: object = None

    def forget(self) -> None:
        """The next dialog begins with its usual button, also where it is the same as the one before."""
        self._of, self.label = None, ""

    def follow(self, of: object, labels: Sequence[str], usual: str, *, appearing: bool = False) -> str:
        """Called in every frame of a dialog, before its buttons are drawn.

        of: what tells the dialog from another one, not None.  labels: of the buttons that can be pressed, from left to right.
        appearing: the dialog is drawn for the first time, and Enter belonged to what was there before.  Tab counts: who types
        ahead would else press the button before the one that is meant.
        Returns the label of the button that Enter presses in this frame, "" for none.
        """
        if of != self._of or self.label not in labels:
            self._of, self.label = of, usual
        key, pressed = imgui.Key, imgui.is_key_pressed
        shifts = key.left_shift, key.right_shift  # one frame may take Tab and the release of Shift behind it
        shift = any(imgui.is_key_down(each) or imgui.is_key_released(each) for each in shifts)
        back = pressed(key.left_arrow) or (pressed(key.tab) and shift)
        if back or pressed(key.right_arrow) or pressed(key.tab):
            self.label = labels[(labels.index(self.label) + (-1 if back else 1)) % len(labels)]
        entered = pressed(key.enter, False) or pressed(key.keypad_enter, False)
        return self.label if entered and not appearing else ""
