"""What the window remembers from one start to the next: its size, folded panels, background, size of F12, quality, detail, and
what the mouse does.

A JSON file in the user's state folder.  A file that is missing or damaged is as good as none: a window must open.  What the
command line asks for goes before what is remembered.
"""

import logging
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields, replace
from typing import TYPE_CHECKING

from ....model.network.qualities import DEFAULT
from ...common.errors import InputError
from ...common.state_files import read_state, write_state
from ...picture.settings import BACKGROUNDS, Settings
from ..flight.mouse import DEFAULT as DEFAULT_MOUSE
from ..flight.mouse import PRESETS
from ..flight.space_mouse import FASTEST, SLOWEST
from .recent import state_dir
from .work import LARGEST_SHOT

if TYPE_CHECKING:
    from .session import Session

FILE = "window.json"
SMALLEST, LARGEST_SIDE = 320, 16384
"""Range of a remembered window's sides that is accepted, logical pixels."""
_OPTIONS = ("quality", "detail")
"""Fields of Settings that are remembered; each has an option of its name."""
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Preferences:
    """width, height: of the window, logical pixels.  outliner, inspector: whether the panels are open.  background: a key of
    BACKGROUNDS.  shot_scale: times the window's size that F12 saves.  quality, detail: as in Settings.
    mouse: a key of viewer.window.flight.mouse.PRESETS.  cube: whether the view cube is shown.  twist_speed: of the 3D mouse."""

    width: int = 1280
    height: int = 720
    outliner: bool = True
    inspector: bool = True
    background: str = "plain"
    shot_scale: int = 1
    quality: str = DEFAULT
    detail: float = 1.0
    mouse: str = DEFAULT_MOUSE
    cube: bool = True
    twist_speed: float = 1.0

    def __post_init__(self) -> None:
        good = (min(self.width, self.height) >= SMALLEST and max(self.width, self.height) <= LARGEST_SIDE
                and self.background in BACKGROUNDS and self.mouse in PRESETS and 1 <= self.shot_scale <= LARGEST_SHOT
                and SLOWEST <= self.twist_speed <= FASTEST)
        if not good:
            raise InputError(f"window preferences {asdict(self)}: out of range")
        Settings(quality=self.quality, detail=self.detail)  # raises InputError


def read_preferences() -> Preferences:
    """What was remembered; the defaults where there is nothing, or nothing usable."""
    kinds = {field.name: type(field.default) for field in fields(Preferences)}

    def parse(found) -> Preferences:
        return Preferences(**{name: value for name, value in found.items() if type(value) is kinds.get(name)})

    return read_state(state_dir() / FILE, parse, Preferences())


def write_preferences(kept: Preferences) -> None:
    """Remembers them; what cannot be written is logged."""
    path = state_dir() / FILE
    try:
        write_state(path, asdict(kept))
    except OSError as error:
        _log.warning("%s cannot be written: %s", path, error)


def with_preferences(settings: Settings, kept: Preferences, arguments: Sequence[str]) -> Settings:
    """The settings of the command line, with what is remembered where ``arguments`` do not name an option for it."""
    asked = [argument.partition("=")[0] for argument in arguments if len(argument) > 2]
    free = [name for name in _OPTIONS if not any(f"--{name}".startswith(option) for option in asked)]
    return replace(settings, **{name: getattr(kept, name) for name in free})


def preferences_of(session: "Session") -> Preferences | None:
    """What a session has now; None where its window is too small to be remembered."""
    width, height = session.area.window_size
    density = session.area.density
    panels, chosen = session.area.panels, session.view_settings
    try:
        return Preferences(round(width / density), round(height / density), panels.outliner, panels.inspector,
                           chosen.background, session.work.shot_scale, chosen.shown_settings.quality,
                           float(chosen.shown_settings.detail), session.flight.mouse, panels.cube,
                           session.flight.twist_speed)
    except InputError:
        return None


def take_preferences(session: "Session", kept: Preferences) -> None:
    """Puts into a new session what is not part of its settings or its window's size."""
    session.area.panels.outliner, session.area.panels.inspector = kept.outliner, kept.inspector
    session.area.panels.cube = kept.cube
    session.view_settings.background = kept.background
    session.work.shot_scale, session.flight.mouse = kept.shot_scale, kept.mouse
    session.flight.twist_speed = kept.twist_speed
