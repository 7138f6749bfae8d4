"""The window's actions: name in the table of controls (viewer.window.interaction.controls) -> what it does."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Protocol

from ...common.errors import InputError
from ...common.text import counted
from ...picture.settings import Settings
from ...picture.views import VIEWS
from ...work.changed_files import with_files, without_file
from ...work.project import SUFFIX
from ...work.scan_files import FilePart, files_of
from ..file_dialog.file_dialogs import FileDialogs
from ..flight.framing import SIDES
from ..flight.gamepad import SPEED_NOTCHES
from ..flight.space_mouse import FASTEST, SLOWEST
from ..interaction.editing import copy_camera, paste_camera, step
from ..interaction.fly import Fly
from ..interaction.projection_switch import change_projection, turn_to
from ..interaction.tool import KeyEvent, ToolContext
from ..interaction.toolbox import Toolbox
from ..kit.notices import Offer
from ..saving.open_result import open_path
from ..saving.save_actions import SaveActions
from ..session.project_flow import ProjectFlow
from ..session.recovery import Recoverable
from ..session.scan_notice_actions import act_on_notice
from ..session.session import Session

if TYPE_CHECKING:
    from ...picture.camera import Camera
    from .input import Input

_WITHOUT_SCENE = {"open", "open_folder", "open_address", "demo", "help", "escape", "screenshot", "record", "quit", "save",
                  "save_as"}
"""Actions that work, or say why they do not, on the start page."""



class Host(Protocol):
    """The parts of a window that act."""

    imgui: Any
    input: "Input"
    session: Session
    toolbox: Toolbox
    tools: ToolContext
    files: FileDialogs
    projects: ProjectFlow
    save_actions: SaveActions

    def open(self, paths: Sequence[Path], start: "Camera | None" = None) -> None: ...
    def close_scan(self) -> None: ...
    def request_close(self) -> None: ...


class WindowActions:
    """What panels may have this window do (viewer.window.session.panel_actions).  table: name of a control -> what it does.

    What is asked for while the interface is drawn and may take the scan away is done when it has been drawn."""

    def __init__(self, host: Host):
        self._host, self._session, self.table = host, host.session, action_table(host)
        self._later: list[Callable[[], object]] | None = None  # while the interface is drawn

    @contextmanager
    def drawing(self) -> Iterator[None]:
        """The interface is drawn within the block."""
        self._later = []
        try:
            yield
        finally:
            asked, self._later = self._later, None
        for act in asked:
            act()

    def _when_drawn(self, act: Callable[[], object]) -> None:
        if self._later is None:
            act()
        else:
            self._later.append(act)

    def do(self, name: str) -> None:
        """Does what a control asks for.  On the start page only what can be seen there acts."""
        if self._host.session.scene is not None or name in _WITHOUT_SCENE:
            self._when_drawn(partial(self._done, self.table[name]))

    def _done(self, act: Callable[[], object]) -> None:
        """An error becomes a dialog, as of a tool (viewer.window.interaction.toolbox): it reads points of a file, too."""
        try:
            act()
        except InputError as error:
            self._session.notices.say("This cannot be done", error)

    def open(self, paths: Sequence[Path]) -> None:
        self._when_drawn(partial(self._host.open, paths))

    def restore(self, found: Recoverable) -> None:
        self._when_drawn(partial(self._host.projects.restore, found))

    def ask_to_discard(self, found: Recoverable) -> None:
        self._host.projects.ask_to_discard(found)

    def fold(self, panel: Literal["outliner", "inspector"], folded: bool) -> None:
        setattr(self._session.area.panels, panel, not folded)

    def request(self, settings: Settings) -> None:
        self._session.view_settings.request(settings)

    def show_view(self, view: str) -> None:
        self._session.view_settings.show(view)

    def compare(self, on: bool) -> None:
        self._session.view_settings.compare(on)

    def choose_left(self, view: str) -> None:
        self._session.view_settings.choose_left(view)

    def choose_background(self, name: str) -> None:
        self._session.view_settings.background = name

    def choose_mouse(self, preset: str) -> None:
        self._session.flight.mouse = preset

    def choose_twist_speed(self, factor: float) -> None:
        if SLOWEST <= factor <= FASTEST:  # a typed one may be no number
            self._session.flight.twist_speed = factor

    def keep_up(self, on: bool) -> None:
        self._session.picture.adaptive_lod.keep_up, self._session.picture.dirty = on, True

    def turn_to(self, region: tuple[int, int, int]) -> None:
        turn_to(self._host.tools, region)

    def show_cube(self, on: bool) -> None:
        self._session.area.panels.cube = on

    def show_points_of(self, part: FilePart, on: bool) -> None:
        hidden = set(self._session.document.hidden_stations)
        kept = hidden.difference(part.numbers) if on else hidden.union(part.numbers)
        self._session.work.edit(f"{'Show' if on else 'Hide'} {Path(part.path).name}", hidden_stations=tuple(sorted(kept)))

    def fly_to_file(self, part: FilePart) -> None:
        session = self._session
        if not session.shown_scan.show_file(part, session.document, session.area.aspect):
            session.notices.toast(f"{Path(part.path).name} has too few points to fly to")

    def remove_file(self, part: FilePart) -> None:
        session, scene = self._session, self._session.scene
        if scene is None or session.loads.current is not None:
            session.notices.toast("Wait until the scans are loaded")
            return
        parts = files_of(scene)
        found = without_file(session.document, parts, [one.path for one in parts].index(part.path))
        if found is session.document:
            session.notices.toast(f"{Path(part.path).name} shares a folder made by convert with other files, and stays in it")
            return
        session.work.edit(f"Remove {Path(part.path).name}", scans=found.scans, hidden_stations=found.hidden_stations)

    def act_on_notice(self, offer: Offer) -> None:
        act_on_notice(self._session, offer)

    def open_saved(self, path: Path) -> None:
        if not path.exists():
            self._session.notices.toast(f"{path} is not there any more")
        elif not open_path(path):
            self._session.notices.toast(f"There is no xdg-open here to open {path} with")

    def forget_saved(self, path: Path) -> None:
        self._session.notices.forget_saved(path)

    def answer(self, number: int) -> None:
        self._session.notices.answer(number)

    def cancel_load(self) -> None:
        self._session.cancel_load()

    def select_tool(self, name: str) -> None:
        _select_tool(self._host, name)


def action_table(app: Host) -> "dict[str, Callable[[], object]]":
    """Every action of the window and one per tool that has a key, called ``tool_NAME``."""
    session, views = app.session, app.session.view_settings
    table: dict[str, Callable[[], object]] = {
        "home": session.go_home,
        "frame": session.frame_scene,
        **{f"from_{side}": partial(_look_from, session, side) for side in SIDES},
        "orthographic": partial(change_projection, app.tools),
        "walk": partial(_walk, app),
        "slower": lambda: session.wheel(-SPEED_NOTCHES),
        "faster": lambda: session.wheel(SPEED_NOTCHES),
        **{f"view_{view}": partial(views.show, view) for view in VIEWS},
        "split": lambda: views.compare(not views.split),
        "screenshot": app.save_actions.screenshot,
        "record": app.save_actions.record,
        "export": app.save_actions.points.ask,
        "open": partial(_open_scans, app),
        "add": partial(_add_scans, app),
        "open_folder": partial(_open_folder, app),
        "open_address": partial(_open_scans, app, "Open a scan at an address", inside=True),
        "demo": partial(_open_demo, app),
        "close_scan": app.close_scan,
        "profiler": lambda: setattr(session, "profiler", not session.profiler),
        "help": lambda: setattr(session, "help", not session.help),
        "interface": session.show_or_hide_interface,
        "escape": partial(_escape, app),
        "quit": app.request_close,
        "undo": partial(step, app.tools, redo=False),
        "redo": partial(step, app.tools, redo=True),
        "copy_camera": partial(copy_camera, app.tools),
        "paste_camera": partial(paste_camera, app.tools),
        "save": app.projects.save,
        "save_as": app.projects.save_as,
    }
    for tool in app.toolbox.tools:
        if tool.key:
            table[f"tool_{tool.name}"] = partial(_select_tool, app, tool.name)
    return table


def _select_tool(app: Host, name: str) -> None:
    """Selects a tool by its icon or key, and opens the folded inspector, which has its controls."""
    app.toolbox.select(name, app.tools)
    if app.toolbox.active is not app.toolbox.fly:
        app.session.area.panels.inspector = True


def _look_from(session: Session, side: str) -> None:
    if session.scene is not None:
        session.flight.look_from(side, session.area.aspect)


def _walk(app: Host) -> None:
    fly = app.toolbox.fly
    assert isinstance(fly, Fly)
    fly.walk_mode.toggle(app.tools)


def _escape(app: Host) -> None:
    """Lets go of the pointer, or closes the one thing that lies on top: what a tool has begun lies below help and lists, and is
    not seen while the interface is hidden."""
    imgui, session, toolbox = app.imgui, app.session, app.toolbox
    plain = session.notices.message is None and not session.help and session.interface
    if toolbox.holding or session.dragging_handle:
        app.input.release_pointer()
    elif session.notices.message is None and imgui.is_popup_open("", imgui.PopupFlags_.any_popup):  # a list of choices
        imgui.internal.close_popups_except_modals()
    elif plain and session.scene is not None and toolbox.key_event(KeyEvent("ESCAPE", "press"), app.tools):
        pass
    elif plain and toolbox.active is not toolbox.fly:
        toolbox.select(toolbox.fly.name, app.tools)
    else:
        session.escape()


def _open_scans(app: Host, title: str = "Open scans or a project", *, inside: bool = False) -> None:
    """inside: with the dialog inside the window, which takes addresses."""
    from ...readers.formats import FORMATS
    from ...readers.meshes.mesh_formats import MESH_FORMATS

    scans = tuple(dict.fromkeys(suffix for row in FORMATS for suffix in row.suffixes))
    kinds = {"Scans and projects": (*scans, SUFFIX), "Projects": (SUFFIX,), "Meshes": tuple(MESH_FORMATS)}
    app.files.open("scans", title, kinds, app.open, many=True, addresses=True, inside=inside)


def _add_scans(app: Host) -> None:
    """Files that are shown beside those of the scene."""
    from ...readers.formats import FORMATS

    def add(paths: Sequence[Path]) -> None:
        found = with_files(app.session.document, paths)
        app.session.work.edit(f"Add {counted(len(found.scans) - len(app.session.document.scans), 'scan')}", scans=found.scans)

    scans = tuple(dict.fromkeys(suffix for row in FORMATS for suffix in row.suffixes))
    app.files.open("scans", "Add scans to the scene", {"Scans": scans}, add, many=True, addresses=True)


def _open_folder(app: Host) -> None:
    app.files.open_folder("scans", "Open a folder of scans", lambda folder: app.open([folder]))


def _open_demo(app: Host) -> None:
    from ...commands.demo import demo_camera, demo_scan

    try:
        app.open([demo_scan()], demo_camera())
    except InputError as error:
        app.session.notices.say("The demo cannot be opened", error)
