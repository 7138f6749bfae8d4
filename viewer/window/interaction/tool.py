"""What a tool is: how it receives pointer and key events, what it draws over the picture, and what it shows in the panel.

To add a tool: subclass :class:`Tool` in a file of this folder and add the class to TOOLS in ``table.py``.

Positions are pixels of the picture (column, row), row 0 at the top, the frame of ``Camera.project`` and ``Camera.unproject``;
they may lie outside the picture while a button is held.  Distances dragged are logical pixels (kit.theme), so that a gesture
has the same size on every screen.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from ..kit.clipboard import Clipboard
from ..kit.image_texture import texture_of

if TYPE_CHECKING:
    import moderngl

    from ...grid.scene import Scene
    from ...picture.camera import Camera
    from ..file_dialog.file_dialogs import FileDialogs
    from ..kit.overlay import OverlayCanvas
    from ..kit.theme import Theme
    from ..kit.worker import Worker
    from ..saving.save_actions import SaveActions
    from ..session.session import Session
    from ..viewport.viewport import Viewport
    from .outline import Group


@dataclass(frozen=True)
class Modifiers:
    """Modifier keys that are held during an event."""

    shift: bool = False
    control: bool = False
    alt: bool = False


@dataclass(frozen=True)
class PointerEvent:
    """One event of the pointer.

    kind: ``press``, ``release``, ``move`` (with or without a button held), ``wheel``, or ``leave`` (the pointer left the
    picture, or the window lost the focus: drop any hover or drag).
    position: (column, row) in pixels of the picture.  delta: movement since the last event, logical pixels.
    button: of a press or release, and of a move while a button is held; else "".
    clicks: on release, 1 for a click and 2 for a double click; 0 where the pointer was dragged.  notches: of the wheel.
    """

    kind: Literal["press", "release", "move", "wheel", "leave"]
    position: tuple[float, float]
    delta: tuple[float, float] = (0.0, 0.0)
    button: Literal["", "left", "right", "middle"] = ""
    clicks: int = 0
    notches: float = 0.0
    modifiers: Modifiers = Modifiers()


@dataclass(frozen=True)
class KeyEvent:
    """One key.  key: GLFW's name without ``KEY_``, by its place on a US keyboard ("C", "DELETE", "ENTER")."""

    key: str
    kind: Literal["press", "release", "repeat"]
    modifiers: Modifiers = Modifiers()


class ToolContext:
    """What a tool may use.  One object a window; its properties are always those of the present moment.

    session: notices, flight, view settings.  viewport: the renderer and the last Frame (depth, mask), for picking.
    theme: sizes and colours.  clipboard: text copied and pasted.  files: dialogs that ask for a file.
    saves: pictures saved in the folder of pictures.  save_project: as Ctrl+S.  open_scans: opens files instead of what is open.
    """

    def __init__(self, session: "Session", viewport: "Viewport", theme: "Theme", *, set_captured: Any = None):
        self.session, self.viewport, self.theme = session, viewport, theme
        self.clipboard = Clipboard()
        self.files: FileDialogs
        self.saves: SaveActions
        self.save_project: Callable[[], object] = lambda: None
        self.open_scans: Callable[[Sequence[Path]], object] = lambda paths: None
        self._set_captured = set_captured or (lambda captured: None)

    @property
    def scene(self) -> "Scene | None":
        """The scan shown; None on the start page."""
        return self.session.scene

    @property
    def document(self) -> Any:
        """The Document (viewer.work.document) that the session works on."""
        return self.session.document

    @property
    def camera(self) -> "Camera":
        """The camera of the present view; its width and height are the picture's pixels."""
        return self.session.camera

    def ray(self, position: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
        """Origin (3,) and unit direction (3,), file coordinates, of the viewing ray through a pixel position."""
        return self.camera.ray(position)

    def pixels(self, length: float) -> float:
        """Pixels of the picture that ``length`` design units (kit.theme) make; for a picking radius."""
        return length * self.session.area.density * self.theme.scale

    def toast(self, text: str) -> None:
        """Shows a line for a few seconds."""
        self.session.notices.toast(text)

    def tell_saved(self, path: Path, text: str = "") -> None:
        """Says that a file was saved, in these words where there are any, and lists it with the jobs."""
        self.session.notices.tell_saved(path, text)

    def texture(self, image: np.ndarray) -> "moderngl.Texture":
        """A texture of (H, W, 3) uint8, for the interface; whoever asks for it releases it."""
        return texture_of(self.viewport.context, image)

    def wake(self) -> None:
        """Something is to be shown: draws the interface again.  From any thread."""
        self.session.loads.wake()

    def renew_picture(self) -> None:
        """Asks for a new picture: what is drawn of the scan has changed (a clip, a hidden scan)."""
        self.session.picture.renew()

    def capture_pointer(self, captured: bool) -> None:
        """Hides the pointer and lets it move without end, or shows it again."""
        self._set_captured(captured)


class Tool:
    """Base class of all tools; each method may be left as it is.

    name: identifier, unique, lower case.  label: its name for a person.
    icon: of viewer.window.kit.icons, on its button; the first letter of its label where it has none.
    help: one line, for the tooltip and the table of controls.  key: GLFW's name of the key that selects it, "" for none.
    cursor: ``arrow``, ``crosshair``, ``hand`` or ``resize``, while the pointer is over the picture.
    takes_clicks: whether clicks on the picture mean something to it; a double click then does not fly to a point.
    picks: whether a click asks what lies under the pointer: it then waits until the picture is at rest.
    writes: whether a click begins a text.  text_coming: whether that text is about to take the keys.
    wanted: what it had begun was restored, or something of it was chosen in the outliner: it is to be selected.
    answering: whether what a click makes of the document is still being worked out.
    """

    name = ""
    label = ""
    icon = ""
    help = ""
    key = ""
    cursor: Literal["arrow", "crosshair", "hand", "resize"] = "arrow"
    takes_clicks = False
    picks = False
    writes = False
    text_coming = False
    wanted = False
    answering = False

    def pointer(self, event: PointerEvent, context: ToolContext) -> bool:
        """Handles an event.  Returns True where the tool used it; otherwise Fly receives it.

        A tool that returns True for a press receives all events until the release.  Where it leaves the press to Fly, it
        still receives the release of a click, after Fly; what it returns then is not looked at.
        """
        return False

    def key_event(self, event: KeyEvent, context: ToolContext) -> bool:
        """Handles a key before the table of controls does.  Returns True where the tool used it."""
        return False

    def draw(self, overlay: "OverlayCanvas", context: ToolContext) -> None:
        """Draws over the picture while the tool is selected.  Changes nothing: what it shows is found by :meth:`follow`."""

    def hint(self, context: ToolContext) -> str:
        """What a click or a key does now, in a few words, written beside the pointer; "" where a person need not be told."""
        return ""

    def panel(self, ui: Any, context: ToolContext) -> None:
        """Draws its rows in the tool panel while it is selected.  ui: the ``imgui`` module, inside a window."""

    def outline(self, context: ToolContext) -> "Sequence[Group]":
        """What the outliner lists of it, selected or not, while a scan is shown."""
        return ()

    def selected(self, context: ToolContext) -> None:
        """The tool was selected."""

    def left(self, context: ToolContext) -> None:
        """Another tool was selected: drop what was begun, unless it can go on when this one is selected again."""

    def follow(self, context: ToolContext) -> None:
        """Called in every turn of the window's loop, selected or not, before the interface is drawn: takes what work in the
        background and readings of the picture have brought."""

    @property
    def workers(self) -> "Sequence[Worker | None]":
        """Work under way that a person may watch and give up; it is listed with its title.  None: of what does not run."""
        return ()

    @property
    def unfinished(self) -> str:
        """What would be lost if the window closed now, besides the document; "" for nothing."""
        return ""

    def close(self) -> None:
        """The window closes: cancels work in the background and waits until it has removed what it was writing."""


class Overlay:
    """Something drawn over the picture whichever tool is selected: stored measurements, station markers, a scale bar.

    name: shown in the list of overlays.  visible: whether it is drawn.
    """

    name = ""
    visible = True

    def draw(self, overlay: "OverlayCanvas", context: ToolContext) -> None:
        """Draws over the picture.  Changes nothing."""

    def follow(self, context: ToolContext) -> None:
        """Called in every turn of the window's loop, as a tool's."""
