"""The table of views: what a picture shows, and the passes that make it.  Pure values.

Settings, renderer, window, film and command line read it: names, explanations, keys and passes of a view stand here alone.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

ViewName = Literal["raw", "filtered", "filled", "neural"]
PassName = Literal["filter", "fill", "network"]


@dataclass(frozen=True)
class View:
    """text: explains it.  title: its name in the window.  short: the same where there is little room.  key_help: of its key in
    the table of controls.  passes: those that it needs after the points are drawn, in order."""

    text: str
    title: str
    short: str
    key_help: str
    passes: tuple[PassName, ...] = ()

    @property
    def shows_points(self) -> bool:
        """Whether it shows points alone, so that their colours, sizes and lighting apply."""
        return "fill" not in self.passes


VIEWS: dict[str, View] = {
    "raw": View("all points, also those of surfaces behind others", "Raw", "Raw", "raw points"),
    "filtered": View("points hidden by a nearer surface removed", "Filtered", "Filt", "filtered: hidden points removed",
                     ("filter",)),
    "filled": View("filtered, and holes filled smoothly (pull-push), without the network", "Filled", "Fill",
                   "filled: holes closed smoothly", ("filter", "fill")),
    "neural": View("filtered, filled, and repainted by the network", "Neural", "Net", "neural: repainted by the network",
                   ("filter", "fill", "network")),
}
POINT_VIEWS = tuple(name for name, view in VIEWS.items() if view.shows_points)


def passes_of(views: Iterable[str]) -> set[PassName]:
    """The passes that any of the views needs."""
    return {name for view in views for name in VIEWS[view].passes}
