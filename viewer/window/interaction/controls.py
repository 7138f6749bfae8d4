"""The table of controls: the code dispatches on it, the help page and the README print it.

A key is named by its place on a US keyboard, as GLFW does: W is the key above S whatever the layout prints on it, and
the help page shows what the person's own keyboard prints there.  Mouse controls are named by their gesture.
"""

from dataclasses import dataclass
from typing import Literal

from ...picture.views import VIEWS
from .table import TOOLS


@dataclass(frozen=True)
class Control:
    """keys: GLFW key names without ``KEY_``, or mouse gestures; any of them does it.  action: what the code calls.

    kind: ``hold`` acts while down, ``press`` acts once, ``modifier`` changes what held keys do, ``mouse`` is a gesture,
    ``gamepad`` a part of one (viewer.window.flight.gamepad),
    ``chord`` a key with Ctrl, which never moves the camera.  A chord's letter is the printed one, not its place: Ctrl+Q on
    a French keyboard is the key that prints Q.  everywhere: a chord that also acts while text is typed and a dialog is open.
    """

    keys: tuple[str, ...]
    name: str
    action: str
    help: str
    kind: Literal["hold", "press", "modifier", "mouse", "gamepad", "chord"] = "press"
    everywhere: bool = False


CONTROLS: dict[str, tuple[Control, ...]] = {
    "Move": (
        Control(("W",), "W", "forward", "forward", "hold"),
        Control(("S",), "S", "back", "back", "hold"),
        Control(("A",), "A", "left", "left", "hold"),
        Control(("D",), "D", "right", "right", "hold"),
        Control(("E",), "E", "up", "up", "hold"),
        Control(("Q",), "Q", "down", "down", "hold"),
        Control(("LEFT_SHIFT", "RIGHT_SHIFT"), "Shift", "fast", "four times faster while held", "modifier"),
        Control(("LEFT_ALT", "RIGHT_ALT"), "Alt", "slow", "four times slower while held", "modifier"),
        Control(("DRAG_LEFT", "DRAG_RIGHT"), "Drag, left or right", "look", "look around", "mouse"),
        Control(("WHEEL",), "Wheel", "speed", "change the flying speed", "mouse"),
        Control(("DRAG_MIDDLE",), "Middle drag", "orbit", "orbit the point under the pointer", "mouse"),
        Control(("SHIFT_DRAG_MIDDLE",), "Shift+middle drag", "pan", "move it with the pointer", "mouse"),
        Control(("CTRL_WHEEL",), "Ctrl+wheel", "zoom", "move toward it, or away", "mouse"),
        Control(("DOUBLE_CLICK",), "Double click", "fly_to", "fly there and face the surface; any key stops", "mouse"),
        Control(("G",), "G", "walk", "walk on the floor, or fly again"),
        Control(("HOME",), "Home", "home", "back to the start viewpoint"),
        Control(("F",), "F", "frame", "see the whole scene from here"),
        Control(("X", "KP_5"), "X", "orthographic", "orthographic with a scale bar, or perspective"),
    ),
    "See": (
        *(Control((str(number),), str(number), f"view_{view}", row.key_help)
          for number, (view, row) in enumerate(VIEWS.items(), 1)),
        Control(("V",), "V", "split", "compare two views, side by side"),
        Control(("DRAG_HANDLE",), "Drag the handle", "split_handle", "move the line between the two", "mouse"),
    ),
    "Keep": (
        Control(("F12",), "F12", "screenshot", "save the picture as PNG, with what `render --like` needs to draw it again"),
        Control(("F9",), "F9", "record", "start or stop recording frame times, as CSV and a plot"),
        Control(("DROP",), "Drop files", "drop", "open them as one scene", "mouse"),
    ),
    "Work": (
        Control(("CTRL_Z",), "Ctrl+Z", "undo", "undo", "chord"),
        Control(("CTRL_Y", "CTRL_SHIFT_Z"), "Ctrl+Y", "redo", "redo, as Ctrl+Shift+Z", "chord"),
        Control(("CTRL_C",), "Ctrl+C", "copy_camera", "copy the camera as text", "chord"),
        Control(("CTRL_V",), "Ctrl+V", "paste_camera", "fly to a copied camera", "chord"),
        Control(("CTRL_S",), "Ctrl+S", "save", "save the project: clips, measurements, look, viewpoint", "chord", True),
        Control(("CTRL_SHIFT_S",), "Ctrl+Shift+S", "save_as", "save it under another name", "chord", True),
    ),
    "Gamepad": (
        Control(("STICKS",), "Sticks", "pad_sticks", "left: move; right: look; triggers: down and up", "gamepad"),
        Control(("BUMPERS",), "Bumpers", "pad_speed", "slower and faster", "gamepad"),
        Control(("SPACE_MOUSE",), "3D mouse", "space_mouse", "moves the camera, or in orbit the scene", "gamepad"),
        Control(("PAD_A",), "A, B, Start", "pad_buttons", "walk or fly; back to the start; these controls", "gamepad"),
    ),
    "Window": (
        Control(("O",), "O", "open", "open scan files"),
        Control(("F3",), "F3", "profiler", "show or hide where the time of a frame goes"),
        Control(("F1",), "F1", "help", "show or hide these controls"),
        Control(("F10",), "F10", "interface", "show or hide the interface"),
        Control(("ESCAPE",), "Esc", "escape", "close what is open, cancel a load"),
        Control(("CTRL_Q",), "Ctrl+Q", "quit", "close the window", "chord", True),
    ),
}

if tools := tuple(Control((tool.key,), tool.key, f"tool_{tool.name}", tool.help) for tool in TOOLS if tool.key):
    CONTROLS["Tools"] = tools

ALL: tuple[Control, ...] = tuple(control for group in CONTROLS.values() for control in group)


def by_key() -> dict[str, Control]:
    """Key name -> control, for the keyboard."""
    return {key: control for control in ALL if control.kind not in ("mouse", "gamepad", "chord") for key in control.keys}


def by_chord() -> dict[str, Control]:
    """Chord ("CTRL_S", "CTRL_SHIFT_S") -> control."""
    return {key: control for control in ALL if control.kind == "chord" for key in control.keys}


def table_markdown() -> str:
    """The controls as the README's table."""
    lines = ["| | Control | What it does |", "|---|---|---|"]
    for group, controls in CONTROLS.items():
        for row, control in enumerate(controls):
            lines.append(f"| {f'**{group}**' if row == 0 else ''} | {control.name} | {control.help} |")
    return "\n".join(lines) + "\n"
