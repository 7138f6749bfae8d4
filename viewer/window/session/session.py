"""The state of a window without the window: the scene, the camera, the settings and the picture to be made.

A Session receives events (a file dropped, time passing, a picture made) and decides what to draw and whether that has
changed.  It owns no GL object: the viewport uploads a loaded scene and then calls :meth:`accept`.  Its parts are used
directly; what concerns several of them is here:

    flight (where the camera is)   view_settings (settings, comparison)   picture (what is on the screen, what may be left out)
    screen (that against what was asked for)   shown_scan   loads (scans on their way)
    area (where the picture lies)   notices (messages)   work (the document and its history)

Frame: file coordinates; up is the direction that the document calls up.  The clock counts seconds; any steady one will do.
"""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

from ...picture.camera import Camera
from ...picture.settings import Settings
from ...picture.spec import PictureSpec
from ...preprocess.scan_description import NO_DESCRIPTION, ScanDescription
from ...render.frame import FrameCost
from ...work.document import Document
from ..flight.flight import Flight
from ..kit.notices import Notices, Problem, ToastSubject
from ..planning import networks, opened_ahead
from ..planning.picture_plan import Plan, RefinementState
from ..planning.view_settings import ViewSettings
from ..planning.window_area import WindowArea
from . import loading
from .recovery import Recoverable
from .screen_state import ScreenState
from .shown_scan import ShownScan
from .time_recording import FrameTimes
from .work import DocumentState

if TYPE_CHECKING:
    from ...grid.scene import Scene
    from ...work.viewpoint import Viewpoint

_HIDDEN = "Interface hidden; F10 or Esc shows it"
_REPLACED = "Measurements stay at their places; regions and classes may hold other points. Saving the project takes this file."


class Session:
    """State of one window.

    work: the document that a person works on, and its history (DocumentState).
    pointer: where it is over the picture, its pixels, else None.  lost: whether the picture shows nothing of the scene.
    help, interface, profiler: which of them are open.  dragging_handle: whether the mouse holds the comparison's line.
    recording: the frame times being recorded, else None.
    open_scene, load_network, clock, wake: replaceable in tests."""

    def __init__(
        self,
        settings: Settings,
        size: tuple[int, int],
        *,
        open_scene: "Callable[[list[Path]], Scene]" = opened_ahead.open_scene,
        load_network: Callable[[Settings], None] = networks.load_network,
        clock: Callable[[], float] = perf_counter,
        wake: Callable[[], None] = lambda: None,
        start: Camera | None = None,
        preview_scene: "Callable[..., Scene | None]" = lambda paths, **_: None,
    ):
        self._clock = clock
        self.area = WindowArea(size, clock)
        self.notices = Notices(clock)
        self.loads = loading.ScanLoads(self.notices, open_scene, wake, preview_scene)
        self.flight = Flight(clock)
        self.shown_scan = ShownScan(self.flight, start)
        self.picture = RefinementState()
        self.view_settings = ViewSettings(settings, self.picture, self.notices, load_network, wake)
        self.screen = ScreenState(self.picture, self.view_settings, self.flight, self.shown_scan, self.area, lambda: self.spec)
        self.work = DocumentState()
        self.loads.prepare, self.loads.moves = self.work.begin, self.work.opening_moves
        self._followed: tuple | None = None
        self.pointer: tuple[float, float] | None = None
        self.lost = self.dragging_handle = False
        self.help, self.interface, self.profiler = False, True, False
        self.recording: FrameTimes | None = None
        self._variant: Scene | None = None
        self._shown_at: deque[tuple[float, tuple[int, int]]] = deque()  # of pictures whose cost is not known yet

    @property
    def scene(self) -> "Scene | None":
        """The scene shown, None on the start page."""
        return self.shown_scan.scene

    @property
    def document(self) -> Document:
        """What a person works on; changed through ``work``."""
        return self.work.document

    @property
    def facts(self) -> ScanDescription:
        """``Scene.meta`` of the scene shown, with the unit and reference system that a person assigned."""
        return NO_DESCRIPTION if self.scene is None else self.work.facts(self.scene.meta)

    @property
    def point(self) -> np.ndarray | None:
        """(3,) file coordinates: the measured point under the pointer; None where there is none."""
        return None if (picked := self.work.under_pointer) is None else np.array(picked.position)

    # -- what to draw ------------------------------------------------------------------------------------------------

    @property
    def camera(self) -> Camera:
        """The camera of the picture, at its size; while minimised, too: files are read for it, a project is saved with it."""
        return self.flight.camera(self.area.last_size)

    @property
    def spec(self) -> PictureSpec:
        """The description of the picture that is asked for now."""
        chosen, work = self.view_settings, self.work
        edits = work.shown_edits
        if self.scene is None or self.scene.marked is None:  # passers-by are looked for, and shown until then
            edits = replace(edits, ghosts="shown")
        made = PictureSpec(self.camera, chosen.settings, chosen.sides, edits, work.tint, chosen.background, chosen.split_at)
        return work.dates.spec(made) if work.dates is not None and chosen.split else made

    def drew(self, plan: Plan, cost: FrameCost) -> None:
        """A picture was made as planned."""
        self.shown(plan, hides=cost.hidden is not None, approximations=cost.facts.approximations)
        self.learn(plan, cost)

    def shown(self, plan: Plan, *, hides: bool, approximations: Sequence[str], shown: tuple[str, ...] | None = None,
              pending: bool = False) -> None:
        """The picture of :attr:`spec` was made as planned; :meth:`learn` is called later, in the order of pictures.  hides:
        hidden cells were left out indeed.  shown: the views on the screen where they are not the planned ones; pending: those
        follow, when the network has run or more points have arrived."""
        self.picture.spec = self.spec
        self.picture.drew(plan, hides=hides, approximations=approximations, shown=shown, pending=pending)
        self.view_settings.worked()
        if self.shown_scan.preview:
            self.loads.preview_shown()
        self._shown_at.append((self._clock(), self.area.size))

    def learn(self, plan: Plan, cost: FrameCost) -> None:
        """What a picture cost that was made as planned."""
        self.picture.learn(plan, cost)
        now, size = self._shown_at.popleft() if self._shown_at else (self._clock(), self.area.size)
        if self.recording is not None:
            self.recording.add(now, cost, size, plan.views)

    def completed(self, cost: FrameCost) -> None:
        """The network of the last picture has run and its view is on the screen."""
        plan = self.picture.pending
        self.picture.completed(cost)
        if self.recording is not None and plan is not None:
            self.recording.add(self._clock(), cost, self.area.size, plan.views)

    def failed(self, problem: Problem) -> None:
        """A picture could not be made: says so and goes back to the settings that worked last."""
        self.notices.say("This picture cannot be made", problem)
        self._shown_at.clear()
        self.picture.pending = None
        back = self.view_settings.fall_back()
        # with nothing left to try the window shows no picture until something changes
        self.picture.dirty, self.picture.made = back, None if back else self.screen.plan
        self.picture.spec = self.spec

    # -- time and movement -------------------------------------------------------------------------------------------

    def advance(self) -> bool:
        """Lets time pass since the last call.  Returns whether anything visible changed."""
        moved, expired = self.flight.advance(), self.notices.expire()
        turned, altered = self.flight.set_up(self.document.up), (self.work.shown_edits, self.work.tint)
        if turned or self._followed not in (None, altered):
            self.picture.renew()  # refinement starts again
        self._followed = altered
        self.picture.dirty |= moved
        return moved or expired

    def next_change(self) -> float | None:
        """Seconds until something changes by itself; 0: now; None: never."""
        if self.flight.under_way:
            return 0.0
        now, rest = self._clock(), self.flight.rest_in
        times = [toast.until - now for toast in self.notices.toasts]
        if self.scene is not None and rest > 0 and self.picture.lacks(self.screen.full_plan):
            times.append(rest)
        if self.scene is not None and (still := self.area.settles_in) > 0 and self.screen.drawn != self.view_settings.sides:
            times.append(still)
        return max(0.0, min(times)) if times else None

    def wheel(self, notches: float) -> None:
        """Changes the flying speed and shows it."""
        if self.scene is not None:
            self.flight.change_speed(notches)
            self.notices.toast(f"Speed {self.speed_text}", seconds=1.5, subject=ToastSubject.SPEED)

    @property
    def speed_text(self) -> str:
        """The flying speed in metres where the file knows them, else in its own units."""
        return self.flight.speed_text(self.facts.metres_per_unit)

    def go_home(self) -> None:
        """Puts the camera at the start viewpoint."""
        self.flight.go_home()
        self.picture.renew()

    def frame_scene(self) -> None:
        """Steps back, looking the same way, until everything is in view."""
        if self.scene is not None:
            self.flight.step_back(self.area.aspect)
            self.picture.renew()

    def show_or_hide_interface(self) -> None:
        """Hides what is laid over the picture, and says for a moment how it comes back; or shows it again."""
        self.interface = not self.interface
        self.notices.drop(ToastSubject.HIDDEN_INTERFACE)
        if not self.interface:
            self.notices.toast(_HIDDEN, seconds=2.0, subject=ToastSubject.HIDDEN_INTERFACE)

    def move_split(self, x: float) -> None:
        """The comparison's line was dragged.  x: pixels of the picture."""
        self.view_settings.split_at = min(max(x / max(self.area.size[0], 1), 0.0), 1.0)

    def let_go(self) -> None:
        """Forgets every key and button held: the window lost the keyboard."""
        self.flight.let_go()
        self.dragging_handle = False

    def resize(self, size: tuple[int, int]) -> None:
        """The framebuffer's size in pixels; (0, 0) while minimised."""
        if self.area.resize(size):
            self.picture.renew()

    def arrange(self, scale: float | None = None) -> None:
        """Gives the picture the space that panels leave.  scale: interface pixels per design unit; None: as before."""
        if self.area.arrange(panels=self.scene is not None and self.interface, scale=scale):
            self.picture.renew()

    # -- scenes ------------------------------------------------------------------------------------------------------

    def open(self, paths: Sequence[Path], start: Camera | None = None, recovered: Recoverable | None = None,
             view: "Viewpoint | None" = None) -> None:
        """Opens ``paths`` as one scene; folders that are no scan stand for the scans in them.  start, view: where the camera
        begins (ShownScan.start, ShownScan.resume).  recovered: an autosave, whose scans are opened instead."""
        self.shown_scan.start, self.shown_scan.resume = start or self.shown_scan.start, view
        self.loads.open(paths, recovered=recovered)

    def keeps_work(self, loaded: loading.Loaded) -> bool:
        """Whether the document stays where ``loaded`` is shown."""
        return loaded.variant or loaded.same_work or (self.shown_scan.shows_scan_of(loaded) and not self.work.opens_other)

    def poll(self) -> loading.Loaded | None:
        """News from the workers: a scene to upload, or None.  Errors become dialogs."""
        self.view_settings.poll()
        self.loads.reading.look(self.camera, moving=self.flight.moving)
        variant, self._variant = self._variant, None
        if variant is not None and self.loads.current is None:
            return self.shown_scan.variant(variant)
        return self.loads.poll()

    def accept(self, loaded: loading.Loaded) -> None:
        """The scene was uploaded: it is shown."""
        shown, kept = self.shown_scan, self.keeps_work(loaded)
        stays = kept and shown.continues_with(loaded)
        shown.show(loaded, stays=stays)
        self._shown_at.clear()
        self.work.under_pointer = None
        document = self.work.document if kept else self.work.accept()
        self.arrange()  # the start viewpoint frames what the panels leave
        if not stays:
            shown.begin(document, self.area.aspect)
            if not kept:
                self.view_settings.begin(document)
        elif loaded.follows_preview:
            shown.mend_start(document, self.area.aspect)
        self.picture.begin(loaded.scene.count)
        self._followed = self.work.shown_edits, self.work.tint
        self.notices.leave_scene()
        self.notices.tell_of_scan([] if loaded.preview else shown.notices(document, self.work.project))
        if not loaded.variant and (replaced := self.work.note_loaded(loaded.paths)):
            self.notices.say_also("A scan is another file than before", *replaced, _REPLACED)

    def show_variant(self, scene: "Scene") -> None:
        """The same points with other marks are shown from the next poll on; the camera stays."""
        self._variant = scene

    def close_scene(self) -> None:
        """Back to the start page.  The viewport must release its renderer before."""
        self.loads.cancel(forget=True)
        self.work.leave()
        self.shown_scan.end()
        self.work.under_pointer = None
        self.notices.leave_scene()
        self.picture.begin(0)
        self._shown_at.clear()

    def cancel_load(self) -> None:
        """Gives the load under way up and says so; the scene stays, and so does a preview."""
        self.loads.cancel()
        self.notices.toast("Loading cancelled")
        self.loads.reading.resume()

    def close(self) -> None:
        """Stops workers, and waits until what they were writing is gone."""
        self.loads.close()
        self.view_settings.close()

    def escape(self) -> None:
        """Closes one thing, the topmost."""
        if self.notices.message is not None:
            self.notices.message = None
        elif self.help:
            self.help = False
        elif self.loads.current is not None:
            self.cancel_load()
        elif not self.interface:
            self.show_or_hide_interface()
