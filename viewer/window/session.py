"""The state of a window without the window: the scene, the camera, the settings and the picture to be made.

A Session receives events (a file dropped, time passing, a picture made) and decides what to draw and whether that has
changed.  It owns no GL object: the viewport uploads a loaded scene and then calls :meth:`accept`.  Its parts are used
directly; what concerns several of them is here:

    flight (where the camera is)   view_settings (settings, comparison)   picture (what is on the screen, what may be left out)
    loads (scans on their way)     notices (messages)

Frame: file coordinates, world up = +z.  The clock counts seconds; any steady one will do.
"""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

from viewer.camera import Camera, from_fov
from viewer.settings import Settings
from viewer.text import counted
from viewer.tools.document import UP_AXES, Document
from viewer.tools.standing_place import standing_view
from viewer.window import loading
from viewer.window.capture import FrameTimes
from viewer.window.flight import Flight
from viewer.window.layout import Layout, Panels, Rect, arrange
from viewer.window.navigation import looking
from viewer.window.notices import Notices, ScanNotice
from viewer.window.picture_plan import Picture, Plan
from viewer.window.start_viewpoint import FIELD_OF_VIEW, Survey, brightening, darkness, lying, start_state
from viewer.window.view_settings import ViewSettings
from viewer.window.work import Work

if TYPE_CHECKING:
    from viewer.grid.scene import Scene

_NOTE_SECONDS = 10.0
_HIDDEN = "Interface hidden; F10 or Esc shows it"
_RESIZED = 0.3
"""Seconds that a window must have kept its size for it to be the one wanted."""


class Session:
    """State of one window.

    size: of the picture, pixels; window_size: of the framebuffer; both (0, 0) while minimised.
    scene: the one shown, None at first.
    work: the document that a person works on, and its history.  origin: left and top of the picture, framebuffer pixels.
    density: framebuffer pixels per logical pixel.  pointer: where it is over the picture, its pixels, else None.
    point: the measured point under it, (3,) file coordinates, else None.  paths: the files of the scene.
    lost: whether the picture shows nothing of the scene.  preview: whether the scene is coarse and the complete one follows.
    help, interface, profiler, panels: which of them are open.  layout: where they are.
    dragging_handle: whether the mouse holds the comparison's line.
    recording: the frame times being recorded, else None.
    start: where the first visit begins; None: where that makes sense (viewer.window.start_viewpoint).
    open_scene, load_network, clock, wake: what it depends on, replaceable in tests.
    """

    def __init__(
        self,
        settings: Settings,
        size: tuple[int, int],
        *,
        open_scene: "Callable[[list[Path]], Scene]" = loading.open_scene,
        load_network: Callable[[Settings], None] = loading.load_network,
        clock: Callable[[], float] = perf_counter,
        wake: Callable[[], None] = lambda: None,
        start: Camera | None = None,
        preview_scene: "Callable[..., Scene | None]" = lambda paths, **_: None,
    ):
        self._clock, self._start = clock, start
        self.size = self.window_size = size
        self._resized = -_RESIZED
        self.scene: Scene | None = None
        self.notices = Notices(clock)
        self.loads = loading.ScanLoads(self.notices, open_scene, wake, preview_scene)
        self.loads.prepare = lambda paths: self.work.begin(paths)
        self.flight = Flight(clock)
        self.picture = Picture()
        self.view_settings = ViewSettings(settings, self.picture, self.notices, load_network, wake)
        self.work = Work()
        self.origin, self.density = (0, 0), 1.0
        self.pointer: tuple[float, float] | None = None
        self.point: np.ndarray | None = None
        self.paths: tuple[Path, ...] = ()
        self.preview = self.lost = False
        self._inside = False  # whether the visit began standing in the scan
        self._seen: Survey | None = None
        self.dragging_handle = False
        self.help, self.interface, self.profiler = False, True, False
        self.panels = Panels()
        self._scale: float | None = None  # of the interface, once it was arranged
        self.layout = Layout(Rect(0.0, 0.0, *map(float, size)))
        self.recording: FrameTimes | None = None
        self._shown_at: deque[tuple[float, tuple[int, int]]] = deque()  # of pictures whose cost is not known yet

    @property
    def document(self) -> Document:
        """What a person works on; changed through ``work``."""
        return self.work.document

    # -- what to draw ------------------------------------------------------------------------------------------------

    @property
    def camera(self) -> Camera:
        """The camera of the picture, at the framebuffer's size."""
        return from_fov(*self.size, FIELD_OF_VIEW, self.flight.state.camera_to_world)

    @property
    def plan(self) -> Plan:
        """The picture to make now."""
        return self.picture.plan(self.view_settings.sides, self.view_settings.settings.lod, moving=self.flight.moving,
                                 resizing=self._resizing_for > 0)

    @property
    def _resizing_for(self) -> float:
        """Seconds until the window's size counts as settled; not above 0: it has."""
        return self._resized + _RESIZED - self._clock()

    @property
    def full_plan(self) -> Plan:
        """The picture as the settings have it, however long it takes."""
        return Plan(self.view_settings.sides, self.view_settings.settings.lod)

    @property
    def needs_picture(self) -> bool:
        """Whether the picture on the screen is not the one to be shown."""
        return self.scene is not None and min(self.size) > 0 and (self.picture.dirty or self.picture.lacks(self.plan))

    def drew(self, plan: Plan, stats: dict) -> None:
        """A picture was made as planned; ``stats`` as ``Frame.stats``."""
        self.shown(plan, hides="occlusion" in stats, approximations=stats["approximations"])
        self.learn(plan, stats)

    def shown(self, plan: Plan, *, hides: bool, approximations: Sequence[str], shown: tuple[str, ...] | None = None,
              pending: bool = False) -> None:
        """A picture was made as planned; :meth:`learn` is called later, in the order that pictures were made.  hides: hidden
        cells were left out indeed.  shown: the views on the screen where they are not the planned ones; pending: those
        follow, when the network has run or more points have arrived."""
        self.picture.drew(plan, hides=hides, approximations=approximations, shown=shown, pending=pending)
        self.view_settings.worked()
        if self.preview:
            self.loads.preview_shown()
        self._shown_at.append((self._clock(), self.size))

    def learn(self, plan: Plan, stats: dict) -> None:
        """What a picture cost that was made as planned; ``stats`` as ``Frame.stats``."""
        self.picture.learn(plan, stats)
        now, size = self._shown_at.popleft() if self._shown_at else (self._clock(), self.size)
        if self.recording is not None:
            self.recording.add(now, stats, size, plan.views)

    def completed(self, approximations: Sequence[str], stats: dict) -> None:
        """The network of the last picture has run and its view is on the screen."""
        plan = self.picture.pending
        self.picture.completed(approximations, stats)
        if self.recording is not None and plan is not None:
            self.recording.add(self._clock(), stats, self.size, plan.views)

    @property
    def exact(self) -> bool:
        """Whether the picture on the screen is what the settings ask for, with nothing left out."""
        made, full = self.picture.made, self.full_plan
        return (made is not None and not self.refining and not made.hides
                and (made.views, made.level, made.scale) == (full.views, full.level, full.scale)
                and not (self.picture.stats or {}).get("points_missing"))

    @property
    def refining(self) -> bool:
        """Whether a better picture than that on the screen will follow by itself."""
        if self.scene is None or min(self.size) == 0:
            return False
        coming = self.picture.pending is not None or self.drawn != self.view_settings.sides
        return coming or self.flight.moving or self.needs_picture

    def failed(self, text: str) -> None:
        """A picture could not be made: says so and goes back to the settings that worked last."""
        self.notices.say("This picture cannot be made", text)
        self._shown_at.clear()
        self.picture.pending = None
        back = self.view_settings.fall_back()
        # with nothing left to try the window shows no picture until something changes
        self.picture.dirty, self.picture.made = back, None if back else self.plan

    @property
    def drawn(self) -> tuple[str, ...]:
        """The views on the screen, left first; those to come where there is no picture yet."""
        made, sides = self.picture.made, self.view_settings.sides
        return made.views if made is not None and len(made.views) == len(sides) else sides

    @property
    def approximations(self) -> list[str]:
        """Everything about the picture on the screen that is not exact, in words."""
        made = list(self.picture.approximations)
        picture = self.picture.made
        if picture is not None and picture.scale < 1.0:
            made.append(f"internal resolution {100 * picture.scale:.0f} %")
        if self.drawn != self.view_settings.sides and "neural" in self.view_settings.sides:
            resizing = "while resizing" if self._resizing_for > 0 else "until the network has run"
            made.append(f"filled {'while moving' if self.flight.moving else resizing}")
        elif self.picture.pending is not None:
            made.append("network running: this picture has the settings before")
        return made

    # -- time and movement -------------------------------------------------------------------------------------------

    def advance(self) -> bool:
        """Lets time pass since the last call.  Returns whether anything visible changed."""
        moved, expired = self.flight.advance(), self.notices.expire()
        if self.flight.set_up(self.document.up):
            self.picture.renew()
        self.picture.dirty |= moved
        return moved or expired

    def next_change(self) -> float | None:
        """Seconds until something changes by itself; 0: now; None: never."""
        if self.flight.under_way:
            return 0.0
        now = self._clock()
        times = [toast.until - now for toast in self.notices.toasts]
        rest = self.flight.rest_in
        if self.scene is not None and rest > 0 and self.picture.lacks(self.full_plan):
            times.append(rest)
        if self.scene is not None and (still := self._resizing_for) > 0 and self.drawn != self.view_settings.sides:
            times.append(still)
        return max(0.0, min(times)) if times else None

    def wheel(self, notches: float) -> None:
        """Changes the flying speed and shows it."""
        if self.scene is not None:
            self.flight.change_speed(notches)
            self.notices.toast(f"Speed {self.speed_text}", seconds=1.5, instead_of="Speed ")

    @property
    def speed_text(self) -> str:
        """The flying speed in metres where the file knows them, else in its own units."""
        metres = self.scene.meta.get("metres_per_unit") if self.scene is not None else None
        return f"{self.flight.state.speed * (metres or 1.0):.3g} {'m/s' if metres else 'units/s'}"

    def go_home(self) -> None:
        """Puts the camera where the visit began."""
        self.flight.go_home()
        self.picture.renew()

    def frame_scene(self) -> None:
        """Steps back, looking the same way, until everything is in view."""
        if self.scene is not None:
            self.flight.step_back(self.size[0] / self.size[1])
            self.picture.renew()

    def show_or_hide_interface(self) -> None:
        """Hides what is laid over the picture, and says for a moment how it comes back; or shows it again."""
        self.interface = not self.interface
        self.notices.drop(_HIDDEN)
        if not self.interface:
            self.notices.toast(_HIDDEN, seconds=2.0)

    def move_split(self, x: float) -> None:
        """The comparison's line was dragged.  x: pixels of the framebuffer."""
        self.view_settings.split_at = min(max(x / max(self.size[0], 1), 0.0), 1.0)

    def let_go(self) -> None:
        """Forgets every key and button held: the window lost the keyboard."""
        self.flight.let_go()
        self.dragging_handle = False

    def resize(self, size: tuple[int, int]) -> None:
        """The framebuffer's size in pixels; (0, 0) while minimised.  The picture has all of it until :meth:`arrange`."""
        if size != self.window_size:
            self.window_size = size
            self._place((0, 0), size)

    def arrange(self, scale: float) -> None:
        """Gives the picture the space that panels and status bar leave.  scale: interface pixels per design unit."""
        self._scale = scale
        if min(self.window_size) == 0:
            return
        width, height = (pixels / self.density for pixels in self.window_size)
        self.panels.fit(width, scale)
        if self.scene is None or not self.interface:
            self.layout = Layout(Rect(0.0, 0.0, width, height))
        else:
            self.layout = arrange(width, height, scale, self.panels)
        picture = self.layout.picture
        left, top = round(picture.left * self.density), round(picture.top * self.density)
        right = round((picture.left + picture.width) * self.density)
        bottom = round((picture.top + picture.height) * self.density)
        self._place((left, top), (max(right - left, 1), max(bottom - top, 1)))

    def _place(self, origin: tuple[int, int], size: tuple[int, int]) -> None:
        self.origin = origin
        if size != self.size:
            self.size, self._resized = size, self._clock()
            self.picture.renew()

    # -- scenes ------------------------------------------------------------------------------------------------------

    def open(self, paths: Sequence[Path], start: Camera | None = None) -> None:
        """Opens ``paths`` as one scene; folders that are no scan stand for the scans in them.

        start: where the visit begins.
        """
        self._start = start or self._start
        self.loads.open(paths)

    def act_on_notice(self, action: str) -> None:
        """Does what a ScanNotice offers."""
        if action == "as_scanned":
            self.loads.open(self.paths, as_scanned=True)
        elif action == "open_fully":
            self.loads.open(self.paths)
        elif action == "brighten" and self._seen is not None:
            look = replace(self.document.look, exposure=brightening(self._seen))
            self.work.edit("Brighten the dark scan", look=look)
            self.picture.renew()
        elif action.startswith("up ") and self._seen is not None and self.scene is not None:
            name = action.removeprefix("up ")
            self.work.edit(f"Up axis {name}", up=UP_AXES[name])
            self.flight.begin(start_state(self.scene, self._seen, self._aspect, UP_AXES[name]), self._seen)
            self.picture.renew()

    def poll(self) -> loading.Loaded | None:
        """News from the workers: a scene to upload, or None.  Errors become dialogs."""
        self.view_settings.poll()
        return self.loads.poll()

    def accept(self, loaded: loading.Loaded) -> None:
        """The scene was uploaded: visit it.

        After its preview, and with other colours, the camera stays; but a person who has not moved yet is let into a
        scan of which the preview showed too little to stand in it.
        """
        stays = self.scene is not None and (loaded.follows_preview or (bool(loaded.paths) and loaded.paths == self.paths))
        if stays and loaded.follows_preview and self.flight.at_home and not self._inside:
            stays = standing_view(loaded.scene, loaded.seen) is None
        self._inside = stays and self._inside
        self.scene, self.paths, self.preview, self._seen = loaded.scene, loaded.paths, loaded.preview, loaded.seen
        self._shown_at.clear()
        self.point = None
        document = self.work.document if stays and not self.work.opens_project else self.work.accept()
        if self._scale is not None:
            self.arrange(self._scale)  # the start viewpoint frames what the panels leave
        if stays:
            self.flight.continue_in(loaded.seen)
        else:
            state, start = start_state(loaded.scene, loaded.seen, self._aspect, document.up), self._start
            if start is not None:
                state, self._start = looking(start.position, start.view_rotation[2], state.speed, state.upright), None
            if document.view is not None:
                seen_from = document.view.camera(16, 9)
                state = looking(seen_from.position, seen_from.view_rotation[2], state.speed, state.upright)
                self.view_settings.request(document.settings)
                self.view_settings.background = document.background
            self._inside = standing_view(loaded.scene, loaded.seen) is not None
            self.flight.begin(state, loaded.seen)
        self.picture.begin(loaded.scene.count)
        self.notices.leave_scene()
        if loaded.preview:
            return
        self.notices.of_scan = loading.scan_notices(loaded.scene.meta)
        offers = darkness(loaded.seen), lying(loaded.seen, document.up)
        self.notices.of_scan += [offer for offer in offers if offer is not None]
        for notice in self.notices.of_scan[:2]:
            self.notices.toast(notice.text, seconds=_NOTE_SECONDS, of_scene=True)

    @property
    def _aspect(self) -> float:
        """Width over height of the picture."""
        width, height = self.size if min(self.size) > 0 else (16, 9)
        return width / height

    def close_scene(self) -> None:
        """Back to the start page.  The viewport must release its renderer before."""
        self.loads.cancel()
        self.scene, self.paths, self.preview, self.point = None, (), False, None
        self.flight.let_go()
        self.notices.leave_scene()
        self.picture.begin(0)
        self._shown_at.clear()

    @property
    def direction_to_scene(self) -> np.ndarray:
        """(2,) unit vector, right and down in the picture, in which the scene lies."""
        camera = self.camera
        x, y, z = camera.view_rotation @ (self.flight.middle - camera.position)
        length = float(np.hypot(x, y))
        return np.array([x, y]) / length if length > 1e-9 * abs(z) + 1e-300 else np.array([0.0, -1.0])

    @property
    def title(self) -> str:
        """The scene in a few words."""
        if self.scene is None:
            return "pointglass"
        sources = self.scene.meta.get("sources") or ["points in memory"]
        return Path(sources[0]).name + (f" and {len(sources) - 1} more" if len(sources) > 1 else "")

    def cancel_load(self) -> None:
        """Gives the load under way up and says so; the scene stays, and so does a preview."""
        self.loads.cancel()
        self.notices.toast("Loading cancelled")
        if self.preview:
            text = f"This is a preview of {counted(self.scene.count, 'point')}." if self.scene is not None else ""
            self.notices.of_scan = [ScanNotice(text, "open_fully", "Load all points")]

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
