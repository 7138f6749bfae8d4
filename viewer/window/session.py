"""What the window is doing, without the window: scene, camera, settings, comparison, loads, messages.

A Session is told what happened (a key, the mouse, a dropped file, time passing) and knows what to draw and whether that
has changed.  It owns no GL object: the app uploads a loaded scene and then calls :meth:`accept`.

Frame: file coordinates, world up = +z.  The clock counts seconds; any steady one will do.
"""

import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

from viewer.camera import Camera, from_fov
from viewer.paths import own_weights
from viewer.settings import VIEWS, Settings
from viewer.window import loading
from viewer.window.capture import FrameTimes
from viewer.window.navigation import FlyState, Motion, changed_speed, step
from viewer.window.pace import Pace
from viewer.window.start import FIELD_OF_VIEW, Survey, overview, start_state, survey
from viewer.window.worker import Worker

if TYPE_CHECKING:
    from viewer.cloud.scene import Scene

TOAST_SECONDS = 4.0
_NOTE_SECONDS = 10.0
_REST = 0.25  # seconds without a change of camera that count as rest
_LONGEST_STEP = 0.5  # seconds: a stall must not throw the camera through the wall


@dataclass(frozen=True)
class Message:
    """A dialog: something a person has to read."""

    title: str
    text: str


@dataclass(frozen=True)
class Toast:
    """A line that goes by itself.  until: on the session's clock."""

    text: str
    until: float


@dataclass(frozen=True)
class Plan:
    """How to make the next picture.  views: in the order of ``sides``.  level: of detail.  hides: cells that the last frame
    hid are left out.  moving: while the camera moves."""

    views: tuple[str, ...]
    level: float | None
    hides: bool = False
    moving: bool = False


class Session:
    """State of one window.

    settings: what pictures are made with.  wanted: settings that wait for their network to load, else None.
    open_scene, load_network, clock, wake: what it depends on, replaceable in tests.
    """

    def __init__(
        self,
        settings: Settings,
        size: tuple[int, int],
        *,
        open_scene: "Callable[[list[Path]], Scene] | None" = None,
        load_network: Callable[[Settings], None] | None = None,
        clock: Callable[[], float] = perf_counter,
        wake: Callable[[], None] = lambda: None,
    ):
        self._open_scene = open_scene or loading.open_scene
        self._load_network = load_network or loading.load_network
        self._clock, self._wake = clock, wake
        self.size = size
        self.own_weights = own_weights()
        self.settings = replace(settings, view="filled") if settings.view == "neural" else settings
        self.wanted: Settings | None = None
        self._left_wanted: str | None = None
        self._networks: set[tuple] = set()
        self._last_good = replace(settings, view="raw")
        self._failed: set[Settings] = set()
        self.scene: Scene | None = None
        self.seen: Survey | None = None
        self.fly = FlyState(np.zeros(3))
        self.home = self.fly
        self.held: set[str] = set()
        self.looking = False
        self._look = [0.0, 0.0]
        self.split, self.split_at, self.left = False, 0.5, "raw"
        self._right = "filled"
        self.dragging_handle = False
        self.help, self.interface, self.panel = False, True, True
        self.message: Message | None = None
        self.toasts: list[Toast] = []
        self.load: Worker | None = None
        self.network_load: Worker | None = None
        self._abandoned: list[Worker] = []
        self.recording: FrameTimes | None = None
        self.stats: dict | None = None
        self.pace = Pace()
        self._drawn: Plan | None = None
        self.dirty = True
        self._moved = self._clock()
        self._time: float | None = None
        if settings != self.settings:
            self.request(settings)

    # -- what to draw ------------------------------------------------------------------------------------------------

    @property
    def shown_settings(self) -> Settings:
        """What the panel shows: the settings asked for, even while their network loads."""
        return self.wanted or self.settings

    @property
    def camera(self) -> Camera:
        """The camera of the picture, at the framebuffer's size."""
        return from_fov(*self.size, FIELD_OF_VIEW, self.fly.camera_to_world)

    @property
    def sides(self) -> tuple[str, ...]:
        """The view shown, or the two that are compared, left first."""
        return (self.left, self.settings.view) if self.split else (self.settings.view,)

    @property
    def moving(self) -> bool:
        """Whether the camera moves now or did a moment ago."""
        return self.fly.moving or self._motion_keys() or self._clock() - self._moved < _REST

    @property
    def plan(self) -> Plan:
        """The picture to make now."""
        moving, pace = self.moving, self.pace
        views = tuple(pace.stand_in(view, moving=moving) for view in self.sides)
        levels = [level for level in (self.settings.lod, pace.level(moving=moving)) if level is not None]
        return Plan(views, min(levels) if levels else None, pace.hides(moving=moving), moving)

    @property
    def full_plan(self) -> Plan:
        """The picture as the settings have it, however long it takes."""
        return Plan(self.sides, self.settings.lod)

    @property
    def drawn(self) -> tuple[str, ...]:
        """The views on the screen, in the order of ``sides``; those to come where there is no picture yet."""
        return self._drawn.views if self._drawn is not None and len(self._drawn.views) == len(self.sides) else self.sides

    @property
    def needs_picture(self) -> bool:
        """Whether the picture on the screen is not the one to be shown."""
        return self.scene is not None and min(self.size) > 0 and (self.dirty or self._differs(self.plan))

    def _differs(self, plan: Plan) -> bool:
        """Whether the picture on the screen lacks something of ``plan``, or has another view."""
        drawn = self._drawn
        return drawn is None or (drawn.views, drawn.level) != (plan.views, plan.level) or (drawn.hides and not plan.hides)

    def drew(self, plan: Plan, stats: dict) -> None:
        """A picture was made as planned; ``stats`` as ``Frame.stats``."""
        self.dirty, self._drawn, self.stats = False, replace(plan, hides="occlusion" in stats), stats
        self._last_good = self.settings
        self._failed.clear()
        self.pace.drew(plan.level, stats, moving=plan.moving)
        if self.recording is not None:
            self.recording.add(self._clock(), stats, self.size, plan.views)

    def failed(self, text: str) -> None:
        """A picture could not be made: says so and goes back to the settings that worked last."""
        self.say("This picture cannot be made", text)
        self._failed.add(self.settings)
        tries = [self._last_good, replace(self._last_good, view="raw", raster="auto", soft_z="auto", lod=None)]
        back = next((settings for settings in tries if settings not in self._failed), None)
        self.split = False
        self.settings = back or self.settings
        # with nothing left to try the window shows no picture until something changes
        self.dirty, self._drawn = back is not None, None if back is not None else self.plan

    @property
    def approximations(self) -> list[str]:
        """Everything about the picture on the screen that is not exact, in words."""
        made = list(self.stats["approximations"]) if self.stats else []
        if self.drawn != self.sides and "neural" in self.sides:
            made.append("filled while moving")
        return made

    # -- time and movement -------------------------------------------------------------------------------------------

    def advance(self) -> bool:
        """Lets time pass since the last call.  Returns whether anything visible changed."""
        now = self._clock()
        dt = 0.0 if self._time is None else min(now - self._time, _LONGEST_STEP)
        moves = self._motion_keys() or self.fly.moving or any(self._look)
        self._time = now if moves else None
        changed = False
        if moves and self.scene is not None:
            held = self.held
            motion = Motion(
                forward=("forward" in held) - ("back" in held), right=("right" in held) - ("left" in held),
                up=("up" in held) - ("down" in held), fast="fast" in held, slow="slow" in held,
                look=(self._look[0], self._look[1]),
            )  # fmt: skip
            before, self.fly = self.fly, step(self.fly, motion, dt)
            if self._place(before) != self._place(self.fly):
                self._moved, self.dirty, changed = now, True, True
        self._look = [0.0, 0.0]
        kept = [toast for toast in self.toasts if toast.until > now]
        changed |= len(kept) != len(self.toasts)
        self.toasts = kept
        return changed

    def next_change(self) -> float | None:
        """Seconds until something changes by itself; 0: now; None: never."""
        if self._motion_keys() or self.fly.moving or any(self._look):
            return 0.0
        now = self._clock()
        times = [toast.until - now for toast in self.toasts]
        if self.scene is not None and self._moved + _REST > now and self._differs(self.full_plan):
            times.append(self._moved + _REST - now)
        return max(0.0, min(times)) if times else None

    @staticmethod
    def _place(state: FlyState) -> tuple:
        return (*state.position.tolist(), state.yaw, state.pitch)

    def _motion_keys(self) -> bool:
        return bool(self.held & {"forward", "back", "left", "right", "up", "down"})

    def look(self, dx: float, dy: float) -> None:
        """The mouse moved by logical pixels while looking."""
        self._look[0] += dx
        self._look[1] += dy

    def wheel(self, notches: float) -> None:
        """Changes the flying speed and shows it."""
        if self.seen is None:
            return
        self.fly = changed_speed(self.fly, notches, self.seen.limits)
        self.toasts = [toast for toast in self.toasts if not toast.text.startswith("Speed ")]
        self.toast(f"Speed {self.speed_text}", seconds=1.5)

    @property
    def speed_text(self) -> str:
        """The flying speed in metres where the file knows them, else in its own units."""
        metres = self.scene.meta.get("metres_per_unit") if self.scene is not None else None
        return f"{self.fly.speed * (metres or 1.0):.3g} {'m/s' if metres else 'units/s'}"

    def go(self, state: FlyState) -> None:
        """Puts the camera somewhere else at once, keeping the flying speed."""
        self.fly = replace(state, speed=self.fly.speed, velocity=np.zeros(3))
        self.dirty, self._moved = True, self._clock() - _REST
        self.pace.jump()

    def go_home(self) -> None:
        self.fly = self.home
        self.go(self.home)

    def frame_scene(self) -> None:
        """Steps back, looking the same way, until everything is in view."""
        if self.seen is not None:
            self.go(overview(self.seen, self.size[0] / self.size[1], self.fly.forward, self.fly.speed))

    def let_go(self) -> None:
        """Forgets every key and button held: the window lost the keyboard."""
        self.held.clear()
        self.looking = self.dragging_handle = False

    def resize(self, size: tuple[int, int]) -> None:
        """The framebuffer's size in pixels; (0, 0) while minimised."""
        if size != self.size:
            self.size, self.dirty = size, True
            self.pace.jump()

    # -- settings and comparison -------------------------------------------------------------------------------------

    def request(self, settings: Settings) -> None:
        """Asks for settings.  Where they need a network that is not loaded, the picture stays until it is."""
        if settings == self.shown_settings:
            return
        if settings.view != "raw":
            self._right = settings.view
        neural = settings.view == "neural" or (self.split and self.left == "neural")
        network, shown = (operator.attrgetter("quality", "weights", "precision")(s) for s in (settings, self.settings))
        neural |= network != shown  # said at once if there are no such weights
        if neural and loading.network_key(settings) not in self._networks:
            self.wanted = settings
            if self.network_load is None:
                self._start_network(settings)
            return
        self.settings, self.wanted, self.dirty = settings, None, True
        self.pace.jump()

    def show(self, view: str) -> None:
        """Chooses the view (in a comparison: the right side)."""
        self.request(replace(self.shown_settings, view=view))

    def compare(self, on: bool) -> None:
        """Splits the picture, raw on the left unless chosen otherwise, or undoes it."""
        self.split, self.dirty = on, True
        if on and self.shown_settings.view == self.left:
            self.show(self._right if self._right != self.left else next(v for v in VIEWS if v != self.left))

    def choose_left(self, view: str) -> None:
        """The left side of the comparison."""
        before, self.left, self.dirty = self.left, view, True
        if view == "neural" and loading.network_key(self.shown_settings) not in self._networks:
            self.left = before  # shown once its network is there; see _network_arrived
            self._left_wanted = view
            self.wanted = self.shown_settings
            if self.network_load is None:
                self._start_network(self.wanted)

    def move_split(self, x: float) -> None:
        """x: pixels of the framebuffer."""
        self.split_at = float(np.clip(x / max(self.size[0], 1), 0.0, 1.0))

    def _start_network(self, settings: Settings) -> None:
        def work() -> Settings:
            self._load_network(settings)
            return settings

        self.network_load = Worker(work, "Loading the network", self._wake)

    def _network_arrived(self, work: Worker) -> None:
        self.network_load = None
        wanted, left = self.wanted, self._left_wanted
        if work.error is not None:
            self.wanted = self._left_wanted = None
            self.say("The network cannot be used", work.error)
            return
        self._networks.add(loading.network_key(work.result))
        if wanted is not None:
            self.wanted = self._left_wanted = None
            self.left = left or self.left
            self.dirty = True
            self.request(wanted)

    # -- loading -----------------------------------------------------------------------------------------------------

    def open(self, paths: Sequence[Path]) -> None:
        """Starts loading ``paths`` as one scene, instead of a load under way; the present scene stays until then."""
        self.cancel_load()
        files = list(paths)

        def work() -> loading.Loaded:
            scene = self._open_scene(files)
            return loading.Loaded(scene, survey(scene))

        names = files[0].name if len(files) == 1 else f"{len(files)} files"
        self.load = Worker(work, f"Opening {names}", self._wake)

    def cancel_load(self) -> None:
        """Stops the load under way; the scene stays."""
        if self.load is not None:
            self.load.cancel()
            self._abandoned.append(self.load)
            self.load = None

    def poll(self) -> loading.Loaded | None:
        """News from the workers: a scene to upload, or None.  Errors become dialogs."""
        self._abandoned = [work for work in self._abandoned if not work.finished]
        if self.network_load is not None and self.network_load.finished:
            self._network_arrived(self.network_load)
        if self.load is None or not self.load.finished:
            return None
        work, self.load = self.load, None
        if work.error is not None:
            self.say("This scan cannot be opened", work.error)
        return work.result if not work.cancelled else None

    def accept(self, loaded: loading.Loaded) -> None:
        """The app uploaded the scene: visit it."""
        self.scene, self.seen = loaded.scene, loaded.seen
        self.pace.begin(loaded.scene.count)
        width, height = self.size if min(self.size) > 0 else (16, 9)
        self.fly = self.home = start_state(loaded.scene, loaded.seen, width / height)
        self.stats, self.dirty, self._drawn, self._moved = None, True, None, self._clock() - _REST
        for note in loading.notes(loaded.scene.meta)[:3]:
            self.toast(note, seconds=_NOTE_SECONDS)

    @property
    def title(self) -> str:
        """The scene in a few words."""
        if self.scene is None:
            return "pointglass"
        sources = self.scene.meta.get("sources") or ["points in memory"]
        return Path(sources[0]).name + (f" and {len(sources) - 1} more" if len(sources) > 1 else "")

    def close(self) -> None:
        """Stops workers, and waits until what they were writing is gone."""
        self.cancel_load()
        for work in self._abandoned:
            work.join(15.0)
        if self.network_load is not None:
            self.network_load.join(15.0)

    # -- messages ----------------------------------------------------------------------------------------------------

    def say(self, title: str, text: str) -> None:
        """Opens a dialog."""
        self.message = Message(title, text)

    def toast(self, text: str, *, seconds: float = TOAST_SECONDS) -> None:
        """Shows a line for a moment."""
        self.toasts = [*self.toasts[-2:], Toast(text, self._clock() + seconds)]

    def escape(self) -> None:
        """Closes one thing, the topmost."""
        if self.message is not None:
            self.message = None
        elif self.help:
            self.help = False
        elif self.load is not None:
            self.cancel_load()
            self.toast("Loading cancelled")
        elif not self.interface:
            self.interface = True
