"""Align: moves a scan, or a mesh, to its place beside another scan, by pairs of points, by surfaces (ICP), by numbers, or to a
level floor.

Each is a step that can be undone: the document keeps the transformation of the scan, and the scans are read again at their new
places (reload_moved).  Surfaces are compared on a thread.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from ....common.errors import InputError
from ....common.rigid_transform import IDENTITY, Rows, combined, inverse, moved_points
from ....picture.meshes.mesh_layer import MeshLayer
from ....work.places.pick import Picked
from ....work.registration.carried_work import carried, only_of
from ....work.registration.levelling import by_numbers, set_bearing
from ....work.registration.moved_files import points_of, transforms_of, with_transform
from ....work.registration.point_pairs import LEAST
from ....work.scan_files import FilePart, files_of
from ...kit import icons
from ...kit.worker import BESIDE, Worker
from ..editing import Pointing, drawn_points, edit, end, ended, unit_of
from ..tool import KeyEvent, PointerEvent, Tool, ToolContext
from .align_panel import draw_panel, name_of
from .bearing import BearingLine
from .clicked_pairs import Pairs
from .moving_mesh import is_of, middle_of, names_of, number_of, refine_mesh_work, with_mesh_at
from .refining import Moved, level_work, refine_work
from .reload_moved import ReloadMoved

if TYPE_CHECKING:
    from ...kit.overlay import OverlayCanvas

_FEW = 20_000
"""Points from which the middle of a scan is found, about which it turns."""


class Align(Tool):
    """moving: number of the file that is moved, or, after them, of the mesh.  levelling: whether the next click is on its
    floor.  line: of which the bearing is set, where it is begun.  shift, degrees: as typed, to be done.  result: of the last
    step, in words."""

    name, label, icon = "align", "Align", icons.ALIGN
    help = "move a scan, or a model, to its place beside another scan"
    cursor = "crosshair"
    takes_clicks = picks = True

    def __init__(self) -> None:
        self._pointing = Pointing()
        self._on_meshes = Pointing(meshes=True)
        self._reload = ReloadMoved()
        self.moving = 0
        self.pairs = Pairs()
        self.line = BearingLine()
        self.levelling = False
        self.shift, self.degrees = [0.0, 0.0, 0.0], 0.0
        self.result = ""
        self.worker: Worker | None = None
        self._of: tuple[str, ...] = ()
        self._meshes = 0
        self._selected = False

    # ---- what there is

    def parts(self, context: ToolContext) -> list[FilePart]:
        """The files of the scene; none where it does not tell them apart, or cannot be read again."""
        scene = context.scene
        if scene is None or scene.meta.records is None or context.session.shown_scan.preview:
            return []
        found = files_of(scene)
        return found if all(part.apart for part in found) else []

    def names(self, context: ToolContext) -> list[str]:
        """Of the files, and of the meshes after them."""
        return names_of(self.parts(context), context.document.meshes, name_of)

    def mesh(self, context: ToolContext, number: int | None = None) -> MeshLayer | None:
        """The mesh with this number in the list of files and meshes (None: the one being moved); None if the row is a file."""
        at, meshes = (self.moving if number is None else number) - len(self.parts(context)), context.document.meshes
        return meshes[at] if 0 <= at < len(meshes) else None

    def transform(self, context: ToolContext, number: int | None = None) -> Rows:
        """The transform in the document of the file or mesh with this number; None: of the one being moved."""
        if (layer := self.mesh(context, number)) is not None:
            return layer.transform
        assert context.scene is not None
        source = context.scene.meta.sources[self.moving if number is None else number]
        return transforms_of(context.document.scans, [source])[0] or IDENTITY

    def choose(self, number: int) -> None:
        """Another scan is to be moved."""
        if number != self.moving:
            self.moving, self.levelling, self.result = number, False, ""
            self.pairs.clear()
            self.line.clear()

    # ---- clicks

    def pointer(self, event: PointerEvent, context: ToolContext) -> bool:
        if event.kind != "release" or event.clicks == 0:
            return False
        if event.button == "right":
            self.pairs.drop_last()
            return False
        parts, names = self.parts(context), self.names(context)
        alone = self.levelling or self.line.asks
        if event.button != "left" or event.clicks != 1 or not parts or (len(names) < 2 and not alone):
            return False
        begun, mesh = self.pairs.begun, self.mesh(context) is not None
        awaits_scan = self.levelling or (mesh and begun is not None and begun[0])  # a mesh may stand before it
        picked = (self._pointing if awaits_scan else self._on_meshes).clicked(context, event.position)
        if picked is None:
            return False
        of = number_of(picked, parts, context.document.meshes)
        moves = of == self.moving
        if of is None or not (moves if alone else self.pairs.takes(moves)):
            whose = names[of] if of is not None else "none of the files"
            context.toast(f"{self.hint(context)}; this point is of {whose}")
            return False
        if self.levelling:
            self._level(context, picked, parts)
            return False
        transform = self.transform(context)
        if self.line.asks:
            self.line.add(np.array(picked.position), transform)
            return False

        def arrived(exact: Picked) -> None:
            self.pairs.correct(np.array(taken.position), np.array(exact.position), transform)

        taken = context.session.work.exact_points.of(context, picked, arrived)
        self.pairs.add(moves, np.array(taken.position), transform)
        return False

    def key_event(self, event: KeyEvent, context: ToolContext) -> bool:
        if event.kind != "press" or event.key not in ("BACKSPACE", "ESCAPE"):
            return False
        if event.key == "ESCAPE" and (self.levelling or self.line.asks):
            self.levelling = False
            self.line.clear()
        elif event.key == "BACKSPACE" or self.pairs.begun is not None:
            return self.pairs.drop_last()
        else:
            return False
        return True

    def hint(self, context: ToolContext) -> str:
        parts = self.parts(context)
        names = self.names(context)
        if self.levelling and parts:
            return f"Click the floor of {names[self.moving]}"
        if self.line.asks and self.moving < len(names):
            return f"Click the {'end' if self.line.places else 'beginning'} of a line on {names[self.moving]}"
        if len(names) < 2 or self.moving >= len(names):
            return ""
        if (begun := self.pairs.begun) is not None:
            return f"Click the same place in {'a scan that stays' if begun[0] else names[self.moving]}"
        return "Click a place that both show" if self.pairs.count < LEAST else ""

    def draw(self, overlay: "OverlayCanvas", context: ToolContext) -> None:
        if not self.parts(context):
            return
        transform, begun = self.transform(context), self.pairs.begun
        self.line.draw(overlay, transform)
        if begun is not None:
            place = moved_points(transform, begun[1][None])[0] if begun[0] else begun[1]
            overlay.marker(place, "warn", 5.0, "ring" if begun[0] else "dot")
        if not self.pairs.count:
            return
        there = moved_points(transform, np.array(self.pairs.moving))
        for place, partner in zip(there, self.pairs.fixed):
            overlay.polyline([place, partner], "accent", 1.0)
            overlay.marker(partner, "accent", 4.0)
            overlay.marker(place, "warn", 5.0, "ring")
        overlay.labels(list(there), [str(number + 1) for number in range(len(there))])

    # ---- what is done

    def place(self, context: ToolContext, number: int, transform: Rows, label: str, unsure: float | None = None) -> None:
        """Gives a file a transformation, as a step that can be undone.  unsure: of its place, as Moved has it."""
        assert context.scene is not None
        layer = self.mesh(context, number)
        of_it = is_of(layer) if layer is not None else only_of(
            [{context.scene.meta.scans[at].name for at in part.numbers} for part in self.parts(context)], number)
        found = carried(context.document, combined(transform, inverse(self.transform(context, number))), of_it)
        if found.moved or found.left:
            stay = f"; {found.left} stay: volumes, profiles, or of an unknown scan" if found.left else ""
            context.toast(f"Of measurements and notes {found.moved} moved with the scan{stay}")
        work: dict[str, Any] = {"measurements": found.measurements, "annotations": found.annotations}
        if layer is not None:
            at = number - len(self.parts(context))
            edit(context, label, meshes=with_mesh_at(context.document.meshes, at, transform, unsure), **work)
            return
        scans = with_transform(context.document.scans, context.scene.meta.sources, number, transform, unsure)
        edit(context, label, scans=scans, **work)

    def apply_pairs(self, context: ToolContext) -> None:
        """Moves the scan so that its points come nearest to their partners."""
        found = self.pairs.fit()
        if found is None or isinstance(found, str):
            return
        self.result = f"{self.pairs.count} pairs agree to {found.rms:.3g} {unit_of(context)} (RMS)"
        self.place(context, self.moving, found.transform, f"Align {self.names(context)[self.moving]} by pairs")

    def refine(self, context: ToolContext) -> None:
        """Compares the surfaces, on a thread, from where the pairs lead, else from where the scan is."""
        scene, parts, before, layer = context.scene, self.parts(context), self.transform(context), self.mesh(context)
        if scene is None or not parts or (len(parts) < 2 and layer is None):
            return
        found = self.pairs.fit()
        start = before if found is None or isinstance(found, str) else found.transform
        name, unit = self.names(context)[self.moving], unit_of(context)
        if layer is not None:
            work = refine_mesh_work(scene, parts, self.moving, layer, start, unit)
        else:
            work = refine_work(scene, parts, self.moving, before, start, name, unit)
        self.worker = Worker(work, f"Aligning {name}", context.session.loads.wake, niceness=BESIDE)

    def _level(self, context: ToolContext, picked: Picked, parts: list[FilePart]) -> None:
        assert context.scene is not None
        self.levelling = False
        work = level_work(context.scene, parts[self.moving], drawn_points(context), picked.position, self.moving,
                          self.transform(context), name_of(parts[self.moving]), context.document.up)
        self.worker = Worker(work, "Fitting the floor", context.session.loads.wake)

    def move_by_numbers(self, context: ToolContext) -> None:
        """Turns the scan or mesh about the vertical through its middle, and shifts it."""
        scene, parts, layer = context.scene, self.parts(context), self.mesh(context)
        if scene is None or not parts:
            return
        middle = points_of(scene, [parts[self.moving]], _FEW).mean(axis=0) if layer is None else middle_of(layer)
        shift = self.shift[0], self.shift[1], self.shift[2]
        motion = by_numbers(shift, self.degrees, middle, np.array(context.document.up))
        self.place(context, self.moving, combined(motion, self.transform(context)), f"Move {self.names(context)[self.moving]}")
        self.shift, self.degrees = [0.0, 0.0, 0.0], 0.0

    def turn_to_bearing(self, context: ToolContext) -> None:
        """Turns the scan about the vertical until its line has the bearing that is typed."""
        transform = self.transform(context)
        first, second = moved_points(transform, np.array(self.line.places))
        try:
            motion = set_bearing(first, second, self.line.bearing)
        except InputError as error:
            context.toast(str(error))
            return
        name = self.names(context)[self.moving]
        self.result = f"The line on {name} has a bearing of {self.line.bearing:.4f}°"
        self.place(context, self.moving, combined(motion, transform), f"Set a bearing of {name}")
        self.line.clear()

    def put_back(self, context: ToolContext) -> None:
        """Puts the scan where its file has it."""
        self.result = ""
        self.place(context, self.moving, IDENTITY, f"Put {self.names(context)[self.moving]} back")

    def follow(self, context: ToolContext) -> None:
        sources = context.scene.meta.sources if context.scene is not None else ()
        if sources != self._of:
            self._of, self.moving, self.result, self.levelling = sources, max(len(sources) - 1, 0), "", False
            self.pairs.clear()
            self.line.clear()
        meshes = len(context.document.meshes)
        if meshes != self._meshes or self.moving >= max(len(sources) + meshes, 1):
            if len(sources) == 1 or self.moving >= len(sources):  # a mesh beside one scan is what can be moved
                self.choose(len(sources) + meshes - 1)
            self._meshes = meshes
        done = ended(self.worker, context, "The scan was not aligned")
        if done is not None:
            self.worker = None
            self._take(done, context)
        self._reload.follow(context)
        context.session.work.set_aside = self._set_aside(context)

    def _set_aside(self, context: ToolContext) -> tuple[int, ...]:
        """Numbers of the stations that are not drawn while the second point of a pair is awaited: those of the side that the
        first one is of, so that a click finds the other."""
        begun, parts = self.pairs.begun, self.parts(context)
        if not self._selected or begun is None or self.levelling or self.line.asks:
            return ()
        return tuple(number for at, part in enumerate(parts) if (at == self.moving) == begun[0] for number in part.numbers)

    def _take(self, done: Worker, context: ToolContext) -> None:
        """The work on the thread has ended."""
        if done.cancelled:
            context.toast("Aligning cancelled")
            return
        found: Moved | None = done.result
        if found is None or context.scene is None or found.number >= len(self.names(context)):
            return
        at = found.number - len(self.parts(context))
        now = context.document.meshes[at].transform if at >= 0 else transforms_of(
            context.document.scans, context.scene.meta.sources)[found.number] or IDENTITY
        if now != found.before:
            context.toast("It was moved meanwhile: refine again")
            return
        self.result = found.text
        self.place(context, found.number, found.after, found.label, found.unsure)

    @property
    def workers(self) -> "tuple[Worker | None, ...]":
        return (self.worker,)

    @property
    def unfinished(self) -> str:
        return "A scan is being aligned." if self.worker is not None else ""

    def selected(self, context: ToolContext) -> None:
        self._selected = True

    def left(self, context: ToolContext) -> None:
        self._selected = self.levelling = False
        self.line.clear()
        context.session.work.set_aside = ()

    def close(self) -> None:
        end(self.worker)

    def panel(self, ui: Any, context: ToolContext) -> None:
        draw_panel(ui, self, context)
