"""A procedural scan of any size: a floor of furnished rooms, scanned from two stations in each.

Frame: metres, z up, floor at 0.  Rooms of 6 x 5 x 2.8 m form a square grid; doors connect neighbours.  A station emits rays at
equal angles, column by column as a scanner does, so that the density falls with the square of the distance; rays pass through
doors into other rooms.  Each ray hits a surface, so that a scan of n points has exactly n.  A point depends only on the seed
and its index: any chunk can be made at any time, on any thread, and the memory is bounded.
"""

import math
from collections import deque
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from ...model.common.jit import compiled
from ..common.errors import InputError
from ..common.text import counted
from ..grid.building.grid_threads import processors
from ..grid.scene import Scene
from ..readers.source import Chunk, ScanInfo, Source

POINTS_PER_ROOM = 5_000_000
"""Default number of points per room, from two stations.  Two real rooms of this size have 3 and 12 million."""
PITCH = np.array([6.0, 5.0, 2.8])
"""Distance of rooms along x and y, and their height, metres.  This and the sizes below are of an invented building."""
WALL = 0.2
"""Thickness of walls, metres."""
EYE = 1.5
"""Height of stations and cameras, metres."""
STATIONS = ((-0.9, -0.5), (0.9, 0.6))
"""x and y of the stations in each room, metres from its middle."""
NOISE = 0.0015
"""Noise standard deviation along the ray, metres."""
DOOR = 0.9, 2.05
"""Width and height of a door, metres."""
_CHUNK = 1 << 19
"""Points per chunk, which limits the memory."""
_STEEPEST = math.radians(-65.0)
"""Lowest elevation of a ray, radians: the tripod occludes the cone below."""
_ROOMS_THROUGH = 64
"""Limit of rooms that a ray passes, more than any ray needs: rays that end in a doorway would form a visible veil."""


def rooms_for(points: int) -> int:
    """Number of rooms with about POINTS_PER_ROOM points each."""
    return max(1, round(points / POINTS_PER_ROOM))


class ProceduralScan(Source):
    """``points`` points of ``rooms`` rooms (default: by POINTS_PER_ROOM).  The same seed gives the same scan.

    doors: (rooms, 4) metres, start of the door along each wall of a room (at x low, x high, y low, y high), -1 without a door.
    Raises InputError for fewer than one point per station.
    """

    worth_keeping = False

    def __init__(self, points: int, rooms: int | None = None, seed: int = 1):
        self.rooms = rooms_for(points) if rooms is None else rooms
        self.stations = len(STATIONS) * self.rooms
        if self.rooms < 1 or points < self.stations:
            size = f"{counted(points, 'point')} in {counted(self.rooms, 'room')}"
            raise InputError(f"a procedural scan of {size}: at least {self.stations} are needed")
        self.columns = math.ceil(math.sqrt(self.rooms))
        self.seed = seed
        self._boxes, self.doors = _furnish(self.rooms, self.columns, seed)
        middle = self.station(len(STATIONS) * self.middle_room)
        super().__init__(
            Path(f"procedural-{points}-{self.rooms}-{seed}"), "procedural", count=points, units="metres", metres_per_unit=1.0,
            scans=[ScanInfo("procedural", (float(middle[0]), float(middle[1]), float(middle[2])))],
        )

    @property
    def label(self) -> str:
        """Description for results."""
        return f"procedural scan, {self.count:,} points, {self.rooms} rooms, seed {self.seed}"

    @property
    def middle_room(self) -> int:
        """Index of the room in the middle of the floor."""
        rows = -(-self.rooms // self.columns)
        return min((rows // 2) * self.columns + self.columns // 2, self.rooms - 1)

    def room_middle(self, room: int) -> np.ndarray:
        """(3,) middle of a room's floor, metres."""
        return np.array([room % self.columns + 0.5, room // self.columns + 0.5, 0.0]) * PITCH

    def station(self, number: int) -> np.ndarray:
        """(3,) scanner position of a station, metres."""
        room, which = divmod(number, len(STATIONS))
        return self.room_middle(room) + (*STATIONS[which], EYE)

    def points(self, start: int, stop: int) -> tuple[np.ndarray, np.ndarray]:
        """Points start to stop - 1 of the scan: xyz (n, 3) float64 metres, rgb (n, 3) uint8."""
        xyz, rgb = np.empty((stop - start, 3)), np.empty((stop - start, 3), np.uint8)
        total = self.count or 0
        number = start * self.stations // total
        while start < stop:
            first, after = (-(-total * n // self.stations) for n in (number, number + 1))
            upto = min(after, stop)
            if upto > start:
                done = len(xyz) - (stop - start)
                part = slice(done, done + upto - start)
                _scan_rays(self.station(number), number // len(STATIONS), start - first, after - first, start, self.seed,
                           self.columns, self._boxes, self.doors, xyz[part], rgb[part])
                start = upto
            number += 1
        return xyz, rgb

    def chunks(self) -> Iterator[Chunk]:
        """All points in order, made by all processors a few chunks ahead."""
        edges = range(0, self.count or 0, _CHUNK)
        with ThreadPoolExecutor(processors(), "procedural") as pool:
            coming: deque = deque()
            for edge in edges:
                coming.append(pool.submit(self.points, edge, min(edge + _CHUNK, self.count or 0)))
                if len(coming) > processors():
                    yield Chunk(*coming.popleft().result())
            while coming:
                yield Chunk(*coming.popleft().result())


def procedural_scene(scan: ProceduralScan, folder: Path | None = None) -> Scene:
    """The scan's grid: in memory (a large one in an unnamed file), or written to ``folder`` and opened from there.

    The folder has the format of ``convert``.  Raises InputError if the disk has too little space.
    """
    from ..grid import cache
    from ..grid.build_scene import in_memory
    from ..grid.building.two_passes import build_grid
    from ..preprocess.scan_description import ColourSummary, ScanDescription

    def build(_files, allocate, folder: Path | None = None) -> Scene:
        known = ScanDescription((scan.label,), scan.format, scan.units, scan.metres_per_unit,
                                colour=ColourSummary("rgb", 8, "procedural"))
        return build_grid([scan], colours=None, allocate=allocate, known=known, folder=folder)

    return build([], in_memory) if folder is None else cache.build_into(folder, [], build, keep_old=True)


def _furnish(rooms: int, columns: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """(rooms, B, 6) low and high corners of the furniture, metres; (rooms, 4) doors of :class:`ProceduralScan`."""
    random = np.random.default_rng(seed)
    across = np.arange(rooms) % columns
    middle = np.stack([across + 0.5, np.arange(rooms) // columns + 0.5, np.zeros(rooms)], 1) * PITCH
    half = PITCH / 2 - (WALL / 2, WALL / 2, 0)

    def box(centre, size) -> np.ndarray:
        return np.concatenate([centre - size / 2, centre + size / 2], axis=1)

    def spread(*ranges: tuple[float, float]) -> np.ndarray:
        low, high = np.array(ranges).T
        return random.uniform(low, high, (rooms, len(ranges)))

    parts = []
    for sx, sy in ((-1, -1), (1, -1), (1, 1), (-1, 1)):  # cupboards in the corners, away from the doors
        size = spread((0.5, 1.4), (0.35, 0.6), (0.7, 2.2))
        corner = np.array([sx, sy, 0.0])
        parts.append(box(middle + corner * (half - size / 2) + size * (0, 0, 0.5), size))
    table = middle + spread((-0.6, 0.6), (-0.5, 0.5), (0.0, 0.0))
    top = np.concatenate([spread((1.0, 1.6), (0.6, 0.9)), np.full((rooms, 1), 0.04)], 1)
    parts.append(box(table + (0, 0, 0.74), top))
    for sx, sy in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
        leg = table + np.array([sx, sy, 0]) * (top / 2 - 0.05) + (0, 0, 0.36)
        parts.append(box(leg, np.tile((0.05, 0.05, 0.72), (rooms, 1))))
    for side in (-1, 1):  # chairs: seat, back
        chair = table + spread((-0.3, 0.3), (0.65, 0.9), (0.0, 0.0)) * (1, side, 0)
        parts.append(box(chair + (0, 0, 0.44), np.tile((0.42, 0.42, 0.05), (rooms, 1))))
        parts.append(box(chair + (0, 0.2 * side, 0.7), np.tile((0.42, 0.03, 0.45), (rooms, 1))))
    parts.append(box(middle + (0, 0, 2.35), spread((0.3, 0.5), (0.3, 0.5), (0.15, 0.25))))  # the lamp
    pipe = middle + np.array([1, 0, 0]) * (half - 0.15) + spread((0.0, 0.0), (1.0, 1.3), (1.4, 1.4))
    parts.append(box(pipe, np.tile((0.08, 0.08, 2.8), (rooms, 1))))

    doors = np.full((rooms, 4), -1.0)
    here = np.arange(rooms)
    for axis, neighbour in ((0, here + 1), (1, here + columns)):
        there = (neighbour < rooms) & ((across < columns - 1) | (axis == 1))
        begin = PITCH[1 - axis] * random.uniform(0.45, 0.55, rooms) - DOOR[0] / 2
        doors[here[there], 2 * axis + 1] = begin[there]
        doors[neighbour[there], 2 * axis] = begin[there]
    return np.ascontiguousarray(np.stack(parts, axis=1)), doors


@compiled(inline="always")
def _mixed(a, b):
    """64-bit hash of two numbers (SplitMix64)."""
    z = np.uint64(a) * np.uint64(0x9E3779B97F4A7C15) + np.uint64(b) * np.uint64(0xD1B54A32D192ED03) + np.uint64(0x632BE5AB)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@compiled(inline="always")
def _part(bits, number):
    """Number in [0, 1) from one of the four 16-bit parts of 64 bits."""
    return np.float64((bits >> np.uint64(16 * number)) & np.uint64(0xFFFF)) * (1.0 / 65536.0)


@compiled(inline="always")
def _smooth(u, v, salt):
    """Value noise 0..1 with lattice cells of side 1 in u and v."""
    i, j = math.floor(u), math.floor(v)
    s, t = u - i, v - j
    a, b = np.int64(i), np.int64(j)
    row = np.uint64(salt) + np.uint64(b) * np.uint64(0x9E3779B1)
    low, high = _mixed(np.uint64(a), row), _mixed(np.uint64(a + 1), row)  # one hash serves both rows
    p, q = _part(low, 0) * (1 - s) + _part(high, 0) * s, _part(low, 1) * (1 - s) + _part(high, 1) * s
    return p * (1 - t) + q * t


@compiled(nogil=True)
def _scan_rays(station, room, skip, rays, first, seed, columns, boxes, doors, xyz, rgb):
    """Traces rays skip, skip + 1, ... of a station with ``rays`` rays.

    first: index in the scan of the first point; station (3,) metres; boxes, doors as in _furnish.  Writes xyz (n, 3) float64
    and rgb (n, 3) uint8.
    """
    rows = max(1, int(math.sqrt(rays * (0.5 * math.pi - _STEEPEST) / (2 * math.pi))))
    across = (rays + rows - 1) // rows
    high, rise = 0.5 * math.pi, (0.5 * math.pi - _STEEPEST) / rows
    ox, oy, oz = station[0], station[1], station[2]
    wall, width, tall = WALL / 2, DOOR[0], DOOR[1]
    px, py, pz = PITCH[0], PITCH[1], PITCH[2]
    for k in range(xyz.shape[0]):
        ray = skip + k
        bits = _mixed(first + k, seed)
        turn = (ray // rows + _part(bits, 0)) * (2 * math.pi / across)
        lift = high - (ray % rows + _part(bits, 1)) * rise
        flat = math.cos(lift)
        dx, dy, dz = flat * math.cos(turn), flat * math.sin(turn), math.sin(lift)
        ix = 1 / dx if abs(dx) > 1e-12 else 1e12
        iy = 1 / dy if abs(dy) > 1e-12 else 1e12
        iz = 1 / dz if abs(dz) > 1e-12 else 1e12
        here, best, face, what = room, 0.0, 0, -1
        for _ in range(_ROOMS_THROUGH):
            x0, y0 = (here % columns) * px, (here // columns) * py
            tx = ((x0 + px - wall if ix > 0 else x0 + wall) - ox) * ix
            ty = ((y0 + py - wall if iy > 0 else y0 + wall) - oy) * iy
            tz = ((pz if iz > 0 else 0.0) - oz) * iz
            best, face, what = tz, 4 + (iz > 0), -1
            if tx < best:
                best, face = tx, 0 + (ix > 0)
            if ty < best:
                best, face = ty, 2 + (iy > 0)
            for b in range(boxes.shape[1]):
                near, far, side = 0.0, best, 0
                a, c = (boxes[here, b, 0] - ox) * ix, (boxes[here, b, 3] - ox) * ix
                if a > c:
                    a, c = c, a
                near, far = max(near, a), min(far, c)
                a, c = (boxes[here, b, 1] - oy) * iy, (boxes[here, b, 4] - oy) * iy
                if a > c:
                    a, c = c, a
                if a > near:
                    near, side = a, 2
                far = min(far, c)
                a, c = (boxes[here, b, 2] - oz) * iz, (boxes[here, b, 5] - oz) * iz
                if a > c:
                    a, c = c, a
                if a > near:
                    near, side = a, 4
                far = min(far, c)
                if 0.0 < near < far:
                    best, face, what = near, side, b
            if what >= 0 or face >= 4 or doors[here, face] < 0:
                break
            # a wall with a door: the ray passes the opening, or hits the frame or the wall
            along = oy + best * dy - y0 if face < 2 else ox + best * dx - x0
            if not (0 < along - doors[here, face] < width and oz + best * dz < tall):
                break
            low = doors[here, face] + (y0 if face < 2 else x0)
            through = best + WALL * abs(ix if face < 2 else iy)
            side = ((low + width if iy > 0 else low) - oy) * iy if face < 2 else ((low + width if ix > 0 else low) - ox) * ix
            lid = ((tall if iz > 0 else 0.0) - oz) * iz
            if side < through or lid < through:
                best, what = min(side, lid), 99
                face = 4 if lid < side else (2 if face < 2 else 0)
                break
            here += (1 if face == 1 else -1) if face < 2 else (columns if face == 3 else -columns)
        more = _mixed(bits, 7)
        spread = _part(more, 0) + _part(more, 1) + _part(more, 2) + _part(more, 3) - 2.0
        t = best + spread * (NOISE * 1.7320508)
        x, y, z = ox + t * dx, oy + t * dy, oz + t * dz
        xyz[k, 0], xyz[k, 1], xyz[k, 2] = x, y, z
        # colour: paint, grain and pattern of the surface, lit by the lamp of the point's room
        u, v = (y, z) if face < 2 else ((x, z) if face < 4 else (x, y))
        salt = here * 131 + (what + 2) * 17 + (face if what < 0 else 0)
        paint = _mixed(salt, seed)
        shade = 0.82 + 0.36 * _smooth(3 * u, 3 * v, salt) * _smooth(31 * u, 47 * v, salt + 1)
        if what < 0 and face == 4:  # floor tiles and their joints
            i, j = math.floor(u * 2.5), math.floor(v * 2.5)
            joint = min(u * 2.5 - i, v * 2.5 - j) < 0.02
            shade *= 0.45 if joint else 0.8 + 0.2 * ((int(i) + int(j)) & 1)
        elif what < 0 and face < 4:  # posters
            i, j = math.floor(u / 1.1), math.floor(v / 1.3)
            if 0.25 < u / 1.1 - i < 0.8 and 0.3 < v / 1.3 - j < 0.85:
                paint = _mixed(np.uint64(np.int64(math.floor(u * 16)) * 1009 + np.int64(math.floor(v * 16))), paint)
        elif what >= 0:  # boards
            shade *= 0.7 + 0.3 * _part(_mixed(np.uint64(np.int64(math.floor(7 * u))), salt), 0)
        lx, ly = ((here % columns) + 0.5) * px - x, ((here // columns) + 0.5) * py - y
        light = 0.55 + 0.9 / (1.0 + 0.35 * (lx * lx + ly * ly + (2.2 - z) * (2.2 - z)))
        for c in range(3):
            base = 90.0 + 130.0 * _part(paint, c) if face != 5 or what >= 0 else 215.0
            value = base * shade * light + 6.0 * (_part(bits, 2 + (c & 1)) - 0.5)
            rgb[k, c] = np.uint8(min(max(value, 0.0), 255.0))
