"""How long a metre is in a scan whose file states no unit: told by how high its rooms are."""

from ..walk_map import WalkMap

FEET = 1 / 0.3048
"""Feet in a metre."""
_ROOMS = (2.0, 4.2)
"""Metres of free height above a floor: of rooms, from under a beam to a hall."""
_CLEARLY = 1.5
"""How many times as much floor must have the height of rooms in feet as has it in metres.  Measured: street_corner.laz, which
is in feet, 2.7; studio.laz, plant_room.laz, demo.laz, living-room-2 and the atrium, in metres, 0 to 0.11."""
_FEWEST = 100
"""Blocks of floor below which nothing is told: 4 square metres of feet."""
_COLUMN = 21  # bits of a key below its column


def metre_of(walk: WalkMap) -> float:
    """File units in a metre: 1, or FEET where the heights of rooms say so.  walk: made as if the units were metres."""
    same = walk.keys[1:] >> _COLUMN == walk.keys[:-1] >> _COLUMN
    free = (walk.heights[1:] - walk.heights[:-1])[same]
    metres, feet = (int(((free > low * unit) & (free < high * unit)).sum()) for unit in (1.0, FEET) for low, high in [_ROOMS])
    return FEET if feet >= _FEWEST and feet > _CLEARLY * metres else 1.0
