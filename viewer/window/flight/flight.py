"""Where the camera is, and how held keys, the mouse and time move it.  The steps themselves are in ``navigation``, ``orbit``
and ``glide``.

Frame: file coordinates; up is the direction that the document calls up.  Speeds are file units a second; the
clock counts seconds.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ...picture.camera import Camera, from_fov
from ...work.measuring.measure_text import unit_name
from ...work.places.up_axis import turned, upright_axes
from . import mouse
from .framing import from_side, overview
from .gamepad import STILL, Push
from .glide import Glide, Turn
from .held_keys import HeldKeys
from .navigation import LOOK, FlyState, Motion, changed_speed, step, view_along
from .orbit import ORBIT, orbited
from .parallel_flight import REST as REST
from .parallel_flight import ParallelFlight
from .space_mouse import added, of_scene, scaled
from .start_viewpoint import FIELD_OF_VIEW, Survey
from .walking import Walker

STICK = 2.2
"""Radians a second that a fully pushed stick turns the camera.  What appears at the top edge of the picture is in its middle
after 0.24 s, the time in which a person sees, decides and moves (Card, Moran and Newell 1983): FIELD_OF_VIEW / 2 in 0.24 s."""
_LONGEST_STEP = 0.5  # seconds: a stall must not throw the camera through the wall
_WAYS = {"forward", "back", "left", "right", "up", "down"}


class Flight(ParallelFlight):
    """One camera through one scene after another; before the first there is nowhere to fly.

    state: position, direction, speed.  field_of_view: vertical, degrees.  home: the start viewpoint.
    Of the class it is made from: orthographic, plane.
    held: actions of the keys held down.
    mouse: what drags and the wheel do, a key of viewer.window.flight.mouse.PRESETS.
    looking: whether the mouse turns the camera.  push: what the gamepad asks for.  twist: what the 3D mouse asks for, None
    where there is none; twist_speed: its axes are multiplied by it.
    walker: the person who walks on the floor, None while flying.
    floor_lost: whether a walk ended because there was no floor any more.
    """

    def __init__(self, clock: Callable[[], float]):
        self._clock = clock
        self._seen: Survey | None = None
        self.state = self.home = FlyState(np.zeros(3))
        self.field_of_view = FIELD_OF_VIEW
        self.orthographic = None
        self.held = HeldKeys()
        self.looking = self.floor_lost = False
        self.mouse = mouse.DEFAULT
        self.walker: Walker | None = None
        self.push = STILL
        self.twist: Push | None = None
        self.twist_speed = 1.0
        self._look = [0.0, 0.0]
        self._glide: tuple[float, Glide | Turn] | None = None  # since when
        self._dragged = False  # since the last call of advance
        self._moved = clock()
        self._camera: tuple[tuple, FlyState, Camera] | None = None
        self._time: float | None = None  # until when the camera has flown, None: at rest
        self._called = clock()

    def camera(self, size: tuple[int, int]) -> Camera:
        """The camera of a picture of so many pixels; the same object until something changes."""
        made, key, state = self._camera, (size, self.field_of_view, self.orthographic), self.state  # states are replaced
        if made is None or made[0] != key or made[1] is not state:
            lens = from_fov(*size, self.field_of_view, state.camera_to_world)
            made = self._camera = key, state, replace(lens, orthographic=self.orthographic) if self.orthographic else lens
        return made[2]

    def begin(self, state: FlyState, seen: Survey) -> None:
        """Shows another scene, from ``state`` on, with the usual field of view."""
        self.field_of_view, self.orthographic = FIELD_OF_VIEW, None
        self._seen, self.state, self.home = seen, state, state
        self._glide = self.walker = None
        self._moved = self._clock() - REST

    def continue_in(self, seen: Survey) -> None:
        """Another scene of the same place: the camera stays where it is."""
        self._seen = seen

    @property
    def at_home(self) -> bool:
        """Whether the camera is at the start viewpoint."""
        return _place(self.state) == _place(self.home)

    @property
    def moving(self) -> bool:
        """Whether the camera moves now or did a moment ago."""
        return self.under_way or self._clock() - self._moved < REST

    @property
    def under_way(self) -> bool:
        """Whether time alone, or a movement of the mouse not yet followed, changes the picture."""
        by_itself = self._glide is not None or (self.walker is not None and not self.walker.settled)
        return by_itself or self._keys_move() or self.state.moving or any(self._look) or self._dragged

    @property
    def rest_in(self) -> float:
        """Seconds until the camera counts as at rest, if nothing moves it; below zero where it does already."""
        return self._moved + REST - self._clock()

    def _keys_move(self) -> bool:
        return bool(self.held.asked & _WAYS) or any(push.moves or push.looks for push in (self.push, self.twist or STILL))

    def advance(self) -> bool:
        """Lets time pass since the last call.  Returns whether the camera is elsewhere or looks elsewhere."""
        now = self._clock()
        dt = 0.0 if self._time is None else min(now - self._time, _LONGEST_STEP)
        moves, before, scale = self.under_way, self.state, self.orthographic
        moved_by_hand = self._keys_move() or any(self._look)
        spans = self.held.spans(dt, now - self._called)
        self._called, self._time = now, now if moves else None
        if moved_by_hand:
            self._glide = None
        if self._glide is not None:
            self._follow_glide(now)
        elif moves and self._seen is not None:
            if self._twists_scene:
                self._orbit(dt)
            for held, seconds in spans:
                self._step(held, seconds)
        self._look = [0.0, 0.0]
        changed, self._dragged = self._dragged or _place(before) != _place(self.state) or self.orthographic != scale, False
        if changed:
            self._moved = now
        return changed

    def _step(self, held: set[str], dt: float) -> None:
        motion = self._motion(held, dt)
        self._look = [0.0, 0.0]
        if self.height is not None:
            self._step_orthographic(motion, self.height, dt)
        else:
            self.state = step(self.state, motion, dt) if self.walker is None else self._walk(self.walker, motion, dt)

    def _motion(self, held: set[str], dt: float) -> Motion:
        """What keys, mouse, gamepad and 3D mouse ask for.  A stick moves as fast as it is pushed; its look is squared, for fine
        turns."""
        push = self.push
        if self.twist is not None:
            twist = scaled(self.twist, self.twist_speed)
            push = added(push, of_scene(twist) if self._twists_scene else twist)
        forward, right, up = (("forward" in held) - ("back" in held), ("right" in held) - ("left" in held),
                              ("up" in held) - ("down" in held))
        pushed = float(np.linalg.norm([push.forward, push.right, push.up]))
        strength = 1.0 if held & _WAYS else min(pushed, 1.0)
        turn = STICK / LOOK * dt
        return Motion(
            forward=forward + push.forward, right=right + push.right, up=up + push.up, fast="fast" in held,
            slow="slow" in held, strength=strength if pushed else 1.0,
            look=(self._look[0] + turn * push.turn * abs(push.turn), self._look[1] - turn * push.tilt * abs(push.tilt)),
        )  # fmt: skip

    @property
    def _twists_scene(self) -> bool:
        """Whether the 3D mouse moves the scene, as drags do that orbit, and not the camera."""
        return self.twist is not None and self.walker is None and (self.mouse != mouse.DEFAULT or self.orthographic is not None)

    def _orbit(self, dt: float) -> None:
        """Turns the scene about its middle as the cap of the 3D mouse is twisted."""
        assert self.twist is not None
        twist = scaled(self.twist, self.twist_speed)
        turn, tilt = (STICK / ORBIT * dt * value * abs(value) for value in (twist.turn, twist.tilt))
        if turn or tilt:
            self.state = orbited(self.state, self.middle, -turn, tilt, self.steepest)

    def _walk(self, walker: Walker, motion: Motion, dt: float) -> FlyState:
        """The camera after a time on foot; where there is no floor any more it stops and flies from now on."""
        walked = walker.step(self.state, motion, dt)
        if walked is not None:
            return walked
        self.walker, self.floor_lost = None, True
        return replace(self.state, velocity=np.zeros(3))

    def walk(self, walker: Walker, speed: float) -> None:
        """Goes on on foot.  speed: file units a second."""
        self.to_perspective()
        self.walker, self.floor_lost, self._glide = walker, False, None
        self.state = replace(self.state, speed=speed)

    def fly(self, speed: float) -> None:
        """Goes on flying at ``speed``, file units a second."""
        self.walker = None
        self.state = replace(self.state, speed=speed)

    def _follow_glide(self, now: float) -> None:
        """Moves the camera to where the flight under way has brought it by ``now``."""
        assert self._glide is not None
        since, glide = self._glide
        self.state = replace(glide.at(now - since), speed=self.state.speed)
        if isinstance(glide, Turn) and (scale := glide.scale_at(now - since)) is not None:
            self.orthographic = scale
        if now - since >= glide.seconds:
            self._glide = None

    def drag(self, state: FlyState) -> None:
        """Puts the camera somewhere else as part of a movement: a drag or the wheel.  This ends a walk."""
        self.state, self._dragged, self._moved = state, True, self._clock()
        self._glide = self.walker = None

    def glide_to(self, state: FlyState) -> None:
        """Begins a short flight to ``state``; a key, a drag or another flight ends it where it is.  This ends a walk, and an
        orthographic view."""
        self.to_perspective()
        self.state, self.walker = replace(self.state, velocity=np.zeros(3)), None
        self._glide = self._clock(), Glide(self.state, state)

    def stop_glide(self) -> None:
        """Ends a short flight where it is."""
        self._glide = None

    @property
    def gliding(self) -> bool:
        """Whether a short flight is under way."""
        return self._glide is not None

    def look(self, dx: float, dy: float) -> None:
        """The mouse moved by logical pixels while looking."""
        self._look[0] += dx
        self._look[1] += dy

    def change_speed(self, notches: float) -> None:
        """The wheel turned: faster or slower, within what the scene's size makes sensible."""
        if self._seen is not None:
            self.state = changed_speed(self.state, notches, self._seen.limits)

    def speed_text(self, metres_per_unit: float | None) -> str:
        """The flying speed in the file's unit a second, in which lengths are shown too; in metres where that has no name."""
        unit = unit_name(metres_per_unit)
        if unit.startswith("x "):
            return f"{self.state.speed * (metres_per_unit or 1.0):.3g} m/s"
        return f"{self.state.speed:.3g} {unit}/s"

    def direction_to_middle(self, camera: Camera) -> np.ndarray:
        """(2,) unit vector, right and down in the camera's picture, in which the middle of the scene lies."""
        x, y, z = camera.view_rotation @ (self.middle - camera.position)
        length = float(np.hypot(x, y))
        return np.array([x, y]) / length if length > 1e-9 * abs(z) + 1e-300 else np.array([0.0, -1.0])

    def go(self, state: FlyState) -> None:
        """Puts the camera somewhere else at once, keeping the flying speed.  This ends an orthographic view."""
        self.to_perspective()
        self.state = view_along(state.position, state.forward, self.state.speed, self.state.upright)
        self._glide = self.walker = None
        self._moved = self._clock() - REST

    def carry(self, state: FlyState) -> None:
        """Puts the camera somewhere else as one step of a movement, so that it counts as moving."""
        self.state, self._moved = state, self._clock()

    def set_up(self, up: Sequence[float]) -> bool:
        """Levels the camera to another direction that is up, (3,); it looks the same way.  Returns whether that is another."""
        if np.allclose(self.state.upright[:, 2], up):
            return False
        self.to_perspective()
        self.state = view_along(self.state.position, self.state.forward, self.state.speed, upright_axes(up))
        self._glide = self.walker = None
        self._moved = self._clock() - REST
        return True

    def go_home(self) -> None:
        """Back to the start viewpoint, at the speed and with the field of view it began with."""
        self.field_of_view = FIELD_OF_VIEW
        self.to_perspective()
        self.state = self.home
        self.go(self.home)

    def step_back(self, aspect: float) -> None:
        """Looks the same way from where everything is in view.  aspect: width over height."""
        if self.orthographic is not None:
            self.fit(aspect)
        elif self._seen is not None:
            upright = self.state.upright
            seen, ahead = turned(self._seen, upright), upright.T @ self.state.forward
            place = upright @ overview(seen, aspect, ahead, self.state.speed).position
            self.go(view_along(place, self.state.forward, self.state.speed, upright))

    def look_from(self, side: str, aspect: float) -> None:
        """Flies to where everything is in view from one of viewer.window.flight.framing.SIDES, with the usual field of view."""
        if self._seen is not None:
            upright = self.state.upright
            if self.orthographic is not None:
                self.turn_to_side(side, aspect)
                return
            there = from_side(turned(self._seen, upright), aspect, side, self.state.speed)
            self.field_of_view = FIELD_OF_VIEW
            self.glide_to(view_along(upright @ there.position, upright @ there.forward, self.state.speed, upright))

    def let_go(self) -> None:
        """Forgets every key and button held."""
        self.held.clear()
        self.looking, self._glide, self.push = False, None, STILL
        self.twist = None if self.twist is None else STILL


def _place(state: FlyState) -> tuple:
    return (*state.position.tolist(), state.yaw, state.pitch)
