"""What the callbacks of a window need of its owner, shell/app.py, which they do not import."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from ..interaction.tool import ToolContext
from ..interaction.toolbox import Toolbox
from ..session.session import Session
from .answers import Answers

if TYPE_CHECKING:
    from ..kit.theme import Theme


class Host(Protocol):
    """The owner.  window: GLFW's handle.  address: the same as a number."""

    glfw: Any
    imgui: Any
    window: Any
    address: int
    session: Session
    theme: "Theme"
    toolbox: Toolbox
    tools: ToolContext
    answers: Answers

    @property
    def asking(self) -> bool: ...  # whether a question or a file dialog is open that takes all keys
    def wake(self) -> None: ...
    def linger(self) -> None: ...
    def act(self, action: str) -> None: ...
    def open(self, paths: Sequence[Path]) -> None: ...
    def request_close(self) -> None: ...
    def interface_scale(self) -> float: ...
