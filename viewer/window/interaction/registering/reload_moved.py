"""The scene follows the scans of the document and their transformations: where they differ, the scans are read again.

So undo, redo and what adds, removes or moves a scan all do the same: they change the document.  The camera stays.  Of a
place of many files only those are converted whose grid is not in the cache (viewer.grid.place).
"""

from pathlib import Path
from typing import TYPE_CHECKING

from ....readers.moved_source import moves_at
from ....work.project import moves_of
from ....work.registration.moved_files import transforms_of

if TYPE_CHECKING:
    from ....common.rigid_transform import Rows
    from ..tool import ToolContext


class ReloadMoved:
    """One of a window."""

    def __init__(self) -> None:
        self._checked: tuple[object, object] | None = None
        self._asked: tuple[tuple[Path, ...], tuple[Rows | None, ...]] | None = None
        self._meta: object = None  # of the scene whose scans are ``_held``: their paths in the document
        self._held: tuple[str, ...] = ()
        self._tried: tuple[str, ...] = ()

    def follow(self, context: "ToolContext") -> None:
        """Called in every turn of the loop: begins to read the scans again where the document has moved one."""
        scene, session = context.scene, context.session
        if scene is None or scene.meta.records is None or not scene.meta.sources:
            return
        if session.shown_scan.preview or session.loads.current is not None:
            return
        sources, records, scans = scene.meta.sources, scene.meta.records, context.document.scans
        if self._follow_files(context):
            return
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

    def _follow_files(self, context: "ToolContext") -> bool:
        """Begins to read the scans where the document has other ones than the scene.  Returns whether it did."""
        scene, session, scans = context.scene, context.session, context.document.scans
        assert scene is not None
        paths = tuple(scan.path for scan in scans if scan.visible)
        if scene.meta is not self._meta:
            self._meta, self._held, self._tried = scene.meta, self._tried or paths, ()
        if paths in (self._held, self._tried) or not paths:
            return False
        self._tried = paths  # once: where it fails or is given up, the document changes before it is tried again
        session.loads.open([Path(path) for path in paths], as_scanned=scene.meta.match is False, moves=moves_of(scans),
                           same_work=True)
        return True
