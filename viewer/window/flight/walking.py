"""Walking: like flying, but on the floor and not through walls.  Pure functions of state and of the map of the scan.

Frame: file coordinates; heights and horizontal places are those of the upright world (viewer.work.places.up_axis).
"""

from dataclasses import replace

import numpy as np

from ...work.places.walk_map import BODY, WalkMap
from .navigation import FlyState, Motion, step

EYE_HEIGHT = 1.65
"""Metres from the floor to the eye of a standing adult."""
PACE = 1.4
"""Metres a second: a usual walking speed."""
_SETTLE = 0.12
"""Seconds in which the eye comes within 1/e of its height after a step.  Computed for a stair of 0.18 x 0.29 m at PACE: the eye
rises at up to 1.7 m/s and is 0.10 m behind on average.  With half it rises at up to 2.7 m/s, 4.5 cm from one picture to the
next at 60 Hz; with twice it is 0.20 m behind, more than a step."""
_LEVEL = 2e-3  # metres within which the eye has settled


class Walker:
    """A person on the floor of a scan.  feet: height of the floor under them, upright coordinates."""

    def __init__(self, walk_map: WalkMap, feet: float):
        self.walk_map, self.feet = walk_map, feet
        self.settled = False

    def step(self, state: FlyState, motion: Motion, dt: float) -> FlyState | None:
        """The state ``dt`` seconds later; None where there is no floor any more.  Keys for up and down do nothing."""
        walk_map, upright = self.walk_map, state.upright
        state = step(state, Motion(look=motion.look), 0.0)
        level = upright.T @ state.velocity
        level[2] = 0.0
        start = replace(state, pitch=0.0, velocity=upright @ level)
        moved = step(start, replace(motion, up=0.0, look=(0.0, 0.0)), dt)
        before, velocity = upright.T @ start.position, upright.T @ moved.velocity
        wanted = (upright.T @ moved.position - before)[:2]
        place, feet, met = walk(walk_map, before[:2], self.feet, wanted)
        if feet is None:
            return None
        for normal in met:
            velocity[:2] -= min(float(velocity[:2] @ normal), 0.0) * normal
        self.feet = feet
        target = feet + EYE_HEIGHT * walk_map.metre
        height = target + (before[2] - target) * float(np.exp(-dt / _SETTLE))
        self.settled = abs(height - target) < _LEVEL * walk_map.metre
        return replace(moved, position=upright @ np.array([*place, target if self.settled else height]), pitch=state.pitch,
                       velocity=upright @ velocity)


def stand(walk_map: WalkMap, state: FlyState) -> Walker | None:
    """A walker below the eye of ``state``; None where no floor lies below it."""
    x, y, z = state.upright.T @ state.position
    feet = walk_map.floor_below(x, y, z - EYE_HEIGHT * walk_map.metre)
    if feet is None or feet > z:
        return None
    return Walker(walk_map, feet)


def walk(walk_map: WalkMap, place: np.ndarray, feet: float,
         way: np.ndarray) -> tuple[np.ndarray, float | None, list[np.ndarray]]:
    """From ``place`` (2,) along ``way`` (2,), sliding along what is met.

    Returns the place, the height of its floor (None: there is none), and the normals (2,) of what was met.
    """
    length, met = float(np.linalg.norm(way)), []
    stretches = max(1, int(np.ceil(length / (0.5 * BODY * walk_map.metre))))
    for _ in range(stretches):
        place, normal = _stretch(walk_map, place, feet, way / stretches)
        if normal is not None:
            met.append(normal)
        floor = walk_map.floor_below(place[0], place[1], feet)
        if floor is None:
            return place, None, met
        feet = floor
    return place, feet, met


def _stretch(walk_map: WalkMap, place: np.ndarray, feet: float, way: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
    """One short straight way.  Where it is blocked, the part of it along the obstacle; where that is blocked too, none.

    A body that touches something already, because it came flying, may move away from it.
    """
    here = len(walk_map.blocking(place, feet))
    there = walk_map.blocking(place + way, feet)
    if len(there) <= here:
        return place + way, None
    normal = -there.mean(axis=0)
    size = float(np.linalg.norm(normal))
    if size < 1e-9:
        return place, -way / max(float(np.linalg.norm(way)), 1e-12)
    normal /= size
    if (into := float(way @ normal)) < 0:
        slid = way - into * normal
        if len(walk_map.blocking(place + slid, feet)) <= here:
            return place + slid, normal
    for axis in np.argsort(-np.abs(way)):  # a wall along an axis, whose blocks are met on one side more than the other
        slid = np.where(np.arange(2) == axis, way, 0.0)
        if np.any(slid) and len(walk_map.blocking(place + slid, feet)) <= here:
            return place + slid, normal
    return place, normal
