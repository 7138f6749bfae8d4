"""What the mouse does to the camera: for flying, and as people know it from programs that turn an object.

A tool that takes clicks keeps them: a drag begins where the pointer has moved far enough.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

Gesture = Literal["look", "orbit", "pan", "zoom", "speed"]
GESTURES: dict[Gesture, str] = {
    "look": "look around",
    "orbit": "orbit the point under the pointer",
    "pan": "move it with the pointer",
    "zoom": "move toward it, or away",
    "speed": "change the flying speed",
}
"""Gesture -> what it does, as the help page says it."""
DRAGS = {"left": "Left drag", "right": "Right drag", "middle": "Middle drag", "shift+left": "Shift+left drag",
         "shift+right": "Shift+right drag", "shift+middle": "Shift+middle drag"}  # fmt: skip
"""Drag -> its name for a person."""


@dataclass(frozen=True)
class MousePreset:
    """title, text: for a person.  drags: key of DRAGS -> gesture; with Shift, a drag without an entry of its own is as without.
    wheel: what the wheel does alone; with Ctrl it does the other of "zoom" and "speed"."""

    title: str
    text: str
    drags: Mapping[str, Gesture]
    wheel: Literal["zoom", "speed"]

    def drag(self, button: str, *, shift: bool) -> Gesture | None:
        """What a drag with ``button`` does; None: nothing."""
        return (self.drags.get(f"shift+{button}") if shift else None) or self.drags.get(button)

    def turn(self, *, control: bool) -> Gesture:
        """What the wheel does."""
        return self.wheel if not control else "speed" if self.wheel == "zoom" else "zoom"

    @property
    def orthographic(self) -> "MousePreset":
        """The same for an orthographic camera, which stands nowhere to look around from and has no speed."""
        turns: dict[str, Gesture] = {drag: "pan" if "right" in drag else "orbit" for drag, of in self.drags.items()
                                     if of == "look"}
        return replace(self, drags={**self.drags, **turns}, wheel="zoom")

    @property
    def rows(self) -> list[tuple[str, str]]:
        """(control, what it does) for the help page."""
        drags = [(DRAGS[drag], GESTURES[gesture]) for drag, gesture in self.drags.items()]
        return [*drags, ("Wheel", GESTURES[self.turn(control=False)]), ("Ctrl+wheel", GESTURES[self.turn(control=True)])]


PRESETS = {
    "fly": MousePreset("Fly", "drags look around, the wheel changes the speed; middle drag orbits",
                       {"left": "look", "right": "look", "middle": "orbit", "shift+middle": "pan"}, "speed"),
    "orbit": MousePreset("Orbit", "as in CloudCompare: left drag orbits, right drag moves, the wheel zooms; Shift looks around",
                         {"left": "orbit", "right": "pan", "middle": "pan", "shift+left": "look"}, "zoom"),
    "cad": MousePreset("CAD", "as in AutoCAD: middle drag moves, Shift+middle drag orbits, the wheel zooms; left looks around",
                       {"middle": "pan", "shift+middle": "orbit", "left": "look", "right": "look"}, "zoom"),
}  # fmt: skip
"""A new preset is one row: the choice in the window, what is remembered and the help page follow."""
DEFAULT = "fly"
