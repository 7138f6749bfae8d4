"""What the outliner lists of a tool: groups of what the document or the scan holds, a row each.

Rows are made when they are in sight: a scan may have hundreds of stations.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Row:
    """name: what it is called.  value: a few words in a second line.  about: the tooltip.  shown: whether it is drawn; None:
    it has no eye.  chosen: whether the tool works on it.  aside: a number at the end of its line.  colour: sRGB of a swatch in
    place of the group's icon."""

    name: str
    value: str = ""
    about: str = ""
    shown: bool | None = None
    chosen: bool = False
    aside: str = ""
    colour: tuple[int, int, int] | None = None


@dataclass(frozen=True)
class Group:
    """Rows of one kind.

    row: number of a row, from 0 -> the row as it is now.  click: what a click on its name does.  show: what its eye does, with
    whether it is to be shown.  rename: gives it another name.  commands: entry of its menu -> what that does to a row.
    opened: whether its rows are shown at first.
    """

    title: str
    icon: str
    count: int
    row: Callable[[int], Row]
    click: Callable[[int], object]
    show: Callable[[int, bool], object] | None = None
    rename: Callable[[int, str], object] | None = None
    commands: Mapping[str, Callable[[int], object]] = field(default_factory=dict)
    opened: bool = True
