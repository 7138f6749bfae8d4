"""Flying: how held keys and mouse movement become a camera pose, the same at every frame rate.

Frame: file coordinates.  ``upright`` turns the axes of a world whose z is up into those of the file: the identity, unless a
person called another direction up.  yaw: radians about up, 0 looks along the first of these axes.  pitch: radians, positive
looks up.
Speeds are file units a second.  Pure functions of state: no window, no clock.
"""

from dataclasses import dataclass, field, replace

import numpy as np

EASE = 0.09
"""Seconds in which the velocity comes within 1/e of what the keys ask for."""
FAST, SLOW = 4.0, 0.25
WHEEL_STEP = 1.25
LOOK = 0.0032
"""Radians a (logical) pixel of mouse movement."""
PITCH_LIMIT = np.radians(89.0)
"""Steepest direction of view: short of straight up, where the horizon has no direction."""
_AT_REST = 1e-3  # of the flying speed: below it, standing still


@dataclass(frozen=True)
class Motion:
    """What keys and mouse ask for in one frame.

    forward, right, up: -1 to 1.  strength: share of the speed, 0 to 1.
    look: (horizontal, vertical) mouse movement in logical pixels, right and down
    positive.
    """

    forward: float = 0.0
    right: float = 0.0
    up: float = 0.0
    fast: bool = False
    slow: bool = False
    strength: float = 1.0
    look: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True, eq=False)
class FlyState:
    """position: (3,) float64.  velocity: (3,) float64, file units a second.  speed: the cruising speed.

    upright: (3, 3) rotation, whose last column is the direction that is up.
    """

    position: np.ndarray
    yaw: float = 0.0
    pitch: float = 0.0
    speed: float = 1.0
    velocity: np.ndarray = field(default_factory=lambda: np.zeros(3))
    upright: np.ndarray = field(default_factory=lambda: np.eye(3))

    @property
    def moving(self) -> bool:
        """Whether time alone would change the picture."""
        return bool(np.any(self.velocity))

    @property
    def forward(self) -> np.ndarray:
        """(3,) unit vector."""
        cos = np.cos(self.pitch)
        return self.upright @ np.array([np.cos(self.yaw) * cos, np.sin(self.yaw) * cos, np.sin(self.pitch)])

    @property
    def right(self) -> np.ndarray:
        """(3,) unit vector, level."""
        return self.upright @ np.array([np.sin(self.yaw), -np.cos(self.yaw), 0.0])

    @property
    def camera_to_world(self) -> np.ndarray:
        """(4, 4) float64, OpenGL axes (x right, y up, -z forward)."""
        back, right = -self.forward, self.right
        matrix = np.eye(4)
        matrix[:3, 0], matrix[:3, 1], matrix[:3, 2] = right, np.cross(back, right), back
        matrix[:3, 3] = self.position
        return matrix


def view_along(position, direction, speed: float, upright: np.ndarray | None = None) -> FlyState:
    """At rest at ``position`` (3,), looking along ``direction`` (3,), not zero; both in file coordinates."""
    upright = np.eye(3) if upright is None else upright
    x, y, z = upright.T @ (np.asarray(direction, np.float64) / np.linalg.norm(direction))
    pitch = float(np.clip(np.arcsin(np.clip(z, -1.0, 1.0)), -PITCH_LIMIT, PITCH_LIMIT))
    return FlyState(np.array(position, np.float64), float(np.arctan2(y, x)), pitch, float(speed), upright=upright)


def step(state: FlyState, motion: Motion, dt: float) -> FlyState:
    """The state ``dt`` seconds later, with the keys held as they are.

    The velocity eases toward what the keys ask for; both it and the path are integrated exactly, so that ten steps of
    10 ms end where one of 100 ms does (while the direction of view stays).
    """
    dx, dy = motion.look
    yaw = (state.yaw - LOOK * dx + np.pi) % (2 * np.pi) - np.pi if dx else state.yaw
    pitch = float(np.clip(state.pitch - LOOK * dy, -PITCH_LIMIT, PITCH_LIMIT))
    state = replace(state, yaw=float(yaw), pitch=pitch)
    wish = motion.forward * state.forward + motion.right * state.right + motion.up * state.upright[:, 2]
    length = np.linalg.norm(wish)
    pace = state.speed * (FAST if motion.fast else 1.0) * (SLOW if motion.slow else 1.0)
    wanted = wish / length * pace * motion.strength if length > 1e-9 else np.zeros(3)
    excess = state.velocity - wanted
    fade = np.exp(-dt / EASE)
    position = state.position + wanted * dt + excess * (EASE * (1.0 - fade))
    velocity = wanted + excess * fade
    if length <= 1e-9 and np.linalg.norm(velocity) < _AT_REST * state.speed:
        velocity = np.zeros(3)
    return replace(state, position=position, velocity=velocity)


def changed_speed(state: FlyState, notches: float, limits: tuple[float, float]) -> FlyState:
    """The cruising speed after so many notches of the wheel, within ``limits`` (file units a second)."""
    return replace(state, speed=float(np.clip(state.speed * WHEEL_STEP**notches, *limits)))
