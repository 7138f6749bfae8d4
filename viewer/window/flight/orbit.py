"""Moving the camera about a point of the scene: orbit, pan and zoom.  Pure functions of the camera's state.

Frame: file coordinates; pixels as in viewer.picture.camera.  All three keep the horizon level.  Orbit and zoom keep the pixel
of the point; pan moves the point to another pixel at the same view depth.
"""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from .navigation import PITCH_LIMIT, FlyState

if TYPE_CHECKING:
    from ...picture.camera import Camera

ORBIT = 0.006
"""Radians a logical pixel of mouse movement.  OrbitControls of three.js makes a full turn over the height of the picture; this
is its rule for a height of 1047 pixels, a window that fills 1920 x 1080."""
ZOOM_STEP = 0.85
"""Distance to the point after a notch of the wheel, as a share of that before."""


def orbited(state: FlyState, pivot: np.ndarray, dx: float, dy: float, steepest: float = PITCH_LIMIT) -> FlyState:
    """Turned about ``pivot`` (3,), which keeps its distance and its pixel.

    dx, dy: mouse movement in logical pixels, right and down positive; the scene follows the mouse.  steepest: radians; the
    usual pitch stops short of straight up and down.
    """
    yaw = (state.yaw - ORBIT * dx + np.pi) % (2 * np.pi) - np.pi
    pitch = float(np.clip(state.pitch - ORBIT * dy, -steepest, steepest))
    turned = replace(state, yaw=float(yaw), pitch=pitch)
    rotation = turned.camera_to_world[:3, :3] @ state.camera_to_world[:3, :3].T
    return replace(turned, position=pivot + rotation @ (state.position - pivot))


def panned(state: FlyState, camera: "Camera", point: np.ndarray, pixel: tuple[float, float]) -> FlyState:
    """Moved across the line of sight until ``point`` (3,) is seen at ``pixel``.

    camera: the lens; its pose is that of ``state``.  The point must lie in front of the camera; otherwise nothing moves.
    """
    depth = float((camera.project([point])[1])[0])
    if depth <= 0:
        return state
    return replace(state, position=state.position + point - camera.unproject([pixel], depth)[0])


def zoomed(state: FlyState, pivot: np.ndarray, notches: float, nearest: float) -> FlyState:
    """Moved along the line through ``pivot`` (3,), by a share of the distance for each notch of the wheel; positive: nearer.

    nearest: distance, file units, below which no notch leads; a camera that is nearer already does not approach.
    """
    away = state.position - pivot
    distance = float(np.linalg.norm(away))
    if distance == 0.0:
        return state
    wanted = distance * ZOOM_STEP**notches
    reached = max(wanted, min(nearest, distance)) if notches > 0 else wanted
    return replace(state, position=pivot + away * (reached / distance))
