"""The scene follows the transformations of the document: where they differ, the scans are read again at their new places.

So undo, redo and a tool that moves a scan all do the same: they change the document.  The camera stays.
"""

from pathlib import Path
from typing import TYPE_CHECKING

from ....readers.moved_source import moves_at
from ....work.registration.moved_files import transforms_of

if TYPE_CHECKING:
    from ....common.rigid_transform import Rows
    from ..tool import ToolContext


class ReloadMoved:
    """One of a window."""

    def __init__(self) -> None:
        self._checked: tuple[object, object] | None = None
        self._asked: tuple[tuple[Path, ...], tuple[Rows | None, ...]] | None = None

    def follow(self, context: "ToolContext") -> None:
        """Called in every turn of the loop: begins to read the scans again where the document has moved one."""
        scene, session = context.scene, context.session
        if scene is None or scene.meta.records is None or not scene.meta.sources:
            return
        if session.shown_scan.preview or session.loads.current is not None:
            return
        sources, records, scans = scene.meta.sources, scene.meta.records, context.document.scans
        if self._checked is not None and self._checked[0] is scans and self._checked[1] is scene.meta:
            return  # the paths of hundreds of files are not resolved in every turn
        self._checked = scans, scene.meta
        wanted = transforms_of(scans, sources)
        shown = tuple(records.move_of(number) for number in range(len(sources)))
        if wanted == shown:
            self._asked = None
            return
        paths = session.shown_scan.paths
        if not paths or self._asked == (paths, wanted):  # it was tried, and failed or was given up
            return
        self._asked = paths, wanted
        moves = moves_at([Path(source) for source in sources], wanted)
        session.loads.open(paths, as_scanned=scene.meta.match is False, moves=moves)
