"""Reading meshes on a thread: those that arrive, and those of a project that are not in memory."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ....common.text import counted
from ....picture.meshes.mesh_layer import MOST_MESHES, MeshLayer, shown_meshes
from ....readers.meshes.mesh_store import kept_mesh, mesh_of
from ....work.document import replaced
from ....work.meshes.laid_meshes import assumed, new_layer
from ...kit.worker import Worker
from ..editing import edit, end, ended, facts_of

if TYPE_CHECKING:
    from ..tool import ToolContext


class MeshLoads:
    """worker: what is being read, None at rest.  failed: paths that could not be read.  added: number of the mesh that was
    added last, until somebody takes it."""

    def __init__(self) -> None:
        self.worker: Worker | None = None
        self.failed: set[str] = set()
        self.added: int | None = None
        self._adds = False

    def follow(self, context: "ToolContext") -> None:
        """Takes what was read, and begins with the next."""
        done = ended(self.worker, context, "A mesh cannot be shown")
        if done is not None:
            self.worker = None
            if done.result is not None and not done.cancelled:
                (self._add if self._adds else self._take)(context, done.result)
        session = context.session
        if self.worker is not None or context.scene is None or session.shown_scan.preview or session.loads.current is not None:
            return
        if session.work.arriving_meshes:
            path, metres = session.work.arriving_meshes.pop(0), facts_of(context).metres_per_unit
            self._begin(context, path, lambda: new_layer(path, metres), adds=True)
            return
        for layer in shown_meshes(context.document.meshes):
            if layer.path not in self.failed and kept_mesh(layer.path) is None:
                self.failed.add(layer.path)  # until it has been read
                self._begin(context, Path(layer.path), lambda layer=layer: (layer.path, mesh_of(layer.path)), adds=False)
                return

    def _begin(self, context: "ToolContext", path: Path, work, *, adds: bool) -> None:
        self._adds = adds
        self.worker = Worker(work, f"Reading {path.name}", context.wake)

    def _add(self, context: "ToolContext", layer: MeshLayer) -> None:
        """Lays a mesh beside the scan, as a step that can be undone."""
        there = context.document.meshes
        if len(there) >= MOST_MESHES:
            context.toast(f"{MOST_MESHES} meshes are beside the scan: remove one first")
            return
        edit(context, f"Add {layer.name}", meshes=(*there, layer))
        self.added = len(there)
        mesh = mesh_of(layer.path)
        context.toast(f"{layer.name}: {counted(len(mesh.faces), 'triangle')}. {assumed(layer, mesh)}")

    def _take(self, context: "ToolContext", read) -> None:
        """A mesh of the document is in memory: the picture is made again with it."""
        path, mesh = read
        self.failed.discard(path)
        context.session.picture.dirty = True
        for number, layer in enumerate(context.document.meshes):
            if layer.path == path and layer.checksum != mesh.checksum:
                if layer.checksum:
                    context.toast(f"{layer.name} has changed since it was laid here")
                edit(context, f"Read {layer.name} again",
                     meshes=replaced(context.document.meshes, number, replace(layer, checksum=mesh.checksum)))

    def again(self, path: str) -> None:
        """Tries once more to read a file that failed."""
        self.failed.discard(path)

    def close(self) -> None:
        end(self.worker)
