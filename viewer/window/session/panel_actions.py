"""What panels may have the window do.  The window implements it (viewer.window.shell.actions); a panel knows no window."""

from collections.abc import Sequence
from pathlib import Path
from typing import Literal, Protocol

from ...picture.settings import Settings
from ...work.scan_files import FilePart
from ..kit.notices import Offer
from .recovery import Recoverable


class Actions(Protocol):
    """Called when a person acts on what a panel shows; never while nothing is pressed."""

    def do(self, name: str) -> None:
        """What a control does, by its name in the table of controls (viewer.window.interaction.controls)."""

    def open(self, paths: Sequence[Path]) -> None:
        """Opens scans or a project instead of what is open, once that is saved or given up."""

    def fold(self, panel: Literal["outliner", "inspector"], folded: bool) -> None:
        """Folds a panel away, or opens it."""

    def request(self, settings: Settings) -> None:
        """Asks for pictures with these settings."""

    def show_view(self, view: str) -> None:
        """Chooses the view; in a comparison the right side."""

    def compare(self, on: bool) -> None:
        """Splits the picture between two views, or undoes it."""

    def choose_left(self, view: str) -> None:
        """Chooses the left side of a comparison."""

    def choose_background(self, name: str) -> None:
        """Chooses what is laid behind the picture."""

    def choose_twist_speed(self, factor: float) -> None:
        """Chooses how fast the 3D mouse is, within viewer.window.flight.space_mouse.SLOWEST and FASTEST."""

    def choose_mouse(self, preset: str) -> None:
        """Chooses what drags and the wheel do, a key of viewer.window.flight.mouse.PRESETS."""

    def keep_up(self, on: bool) -> None:
        """Whether moving pictures leave something out to hold a frame rate."""

    def turn_to(self, region: tuple[int, int, int]) -> None:
        """Turns the camera about what is in the middle of the picture until it sees this region of the view cube
        (viewer.window.flight.cube_regions) from outside."""

    def show_cube(self, on: bool) -> None:
        """Shows or hides the view cube."""

    def show_points_of(self, part: FilePart, on: bool) -> None:
        """Shows or hides the points of one file, as a step that can be undone."""

    def fly_to_file(self, part: FilePart) -> None:
        """Flies to a view of one file."""

    def remove_file(self, part: FilePart) -> None:
        """Takes a file out of the scene, as a step that can be undone; the file stays where it is."""

    def act_on_notice(self, offer: Offer) -> None:
        """Does what a notice about the scan offers."""

    def open_saved(self, path: Path) -> None:
        """Opens a file that was saved, or a folder, outside the window."""

    def forget_saved(self, path: Path) -> None:
        """Takes a saved file off the list of jobs."""

    def answer(self, number: int) -> None:
        """Presses a button of the message that is open."""

    def cancel_load(self) -> None:
        """Gives the load under way up."""

    def select_tool(self, name: str) -> None:
        """Selects a tool; the one that is selected: Fly."""

    def restore(self, found: Recoverable) -> None:
        """Opens the scans of unsaved work with it."""

    def ask_to_discard(self, found: Recoverable) -> None:
        """Removes unsaved work where the person confirms it."""
