"""Photographs in memory as the compiled loops and the shader read them: one array of pixels, one of numbers.

A slot holds a photograph's mip levels, RGBA8 in a word, alpha 0 where the photograph holds nothing, and behind them its shadow
map as float32 bits.  Slots have one size, that of the largest photograph; the photograph used longest ago makes room.
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ....model.reference.photo_colours import MOST_LEVELS
from ...readers.photographs.posed_photograph import Lens

if TYPE_CHECKING:
    from ...picture.camera import Camera

NUMBERS, PLACES = 32, 32
"""Float32 and int32 values of a record."""
TURN, SHIFT, LENS, GAINS, PRESENCE = 0, 9, 12, 16, 19
"""Where a record's numbers begin: rotation view frame -> photograph by rows, the camera's place in its frame, fx fy cx cy,
gains, presence."""
KIND, AROUND, WIDTH, HEIGHT, MAP, MAP_WIDTH, MAP_HEIGHT, LEVELS, LEVEL = range(9)
"""Of a record's whole numbers: LEVEL and the next ones are the first words of each mip level, MAP that of the shadow map."""


@dataclass(frozen=True, eq=False)
class PreparedPhoto:
    """A photograph ready to colour pictures.

    words: (n,) uint32 as a slot holds them.  places: (PLACES,) int32, offsets from the slot's beginning.  lens: fx, fy, cx, cy.
    camera_to_world: (4, 4) float64, file coordinates.  gains: (3,) to the points' colours.
    """

    words: np.ndarray
    places: np.ndarray
    lens: tuple[float, float, float, float]
    camera_to_world: np.ndarray
    gains: np.ndarray


def prepared_photo(picture: np.ndarray, valid: np.ndarray | None, kind: int, lens: Lens, around: bool,
                   camera_to_world: np.ndarray, nearest: np.ndarray, gains: np.ndarray) -> PreparedPhoto:
    """picture: (H, W, 3) uint8 sRGB.  valid: (H, W) bool, None: everywhere.  nearest: (m, n) float32, the shadow map."""
    places = np.zeros(PLACES, np.int32)
    levels = mip_levels(picture, valid)
    places[[KIND, AROUND, HEIGHT, WIDTH]] = kind, around, *picture.shape[:2]
    places[[MAP_HEIGHT, MAP_WIDTH, LEVELS]] = *nearest.shape, len(levels)
    ends = np.cumsum([level.size // 4 for level in levels])
    places[LEVEL : LEVEL + len(levels)] = [0, *ends[:-1]]
    places[MAP] = ends[-1]
    words = np.concatenate([*(level.reshape(-1).view(np.uint32) for level in levels),
                            np.ascontiguousarray(nearest, np.float32).reshape(-1).view(np.uint32)])
    return PreparedPhoto(words, places, lens, camera_to_world, np.asarray(gains, np.float64))


def mip_levels(picture: np.ndarray, valid: np.ndarray | None) -> list[np.ndarray]:
    """Levels (h, w, 4) uint8, each the mean of 2 x 2 of the one before, a last odd row or column repeated; alpha is the
    least."""
    alpha = np.full(picture.shape[:2], 255, np.uint8) if valid is None else np.where(valid, 255, 0).astype(np.uint8)
    levels = [np.dstack([picture, alpha])]
    while len(levels) < MOST_LEVELS and min(levels[-1].shape[:2]) > 1:
        last = levels[-1]
        last = np.pad(last, ((0, last.shape[0] % 2), (0, last.shape[1] % 2), (0, 0)), mode="edge")
        a, b, c, d = (last[y::2, x::2] for y in (0, 1) for x in (0, 1))
        mean = ((a.astype(np.uint16) + b) + (c.astype(np.uint16) + d) + 2) >> 2
        mean[..., 3] = np.minimum(np.minimum(a[..., 3], b[..., 3]), np.minimum(c[..., 3], d[..., 3]))
        levels.append(mean.astype(np.uint8))
    return levels


class PhotoPool:
    """Slots for ``count`` photographs of at most ``size`` words.  words: (count * size,) uint32; memory is taken as it is
    filled.

    changed: the slots that were filled since it was last cleared, for who keeps a copy.  presence: of photographs that fade in,
    0..1; the others are there in full.
    """

    def __init__(self, count: int, size: int):
        self.count, self.size = count, size
        self.words = np.empty(count * size, np.uint32)
        self._photos: list[PreparedPhoto | None] = [None] * count
        self._slots: dict[int, int] = {}  # photograph -> slot, the one used last at the end
        self.changed: set[int] = set()
        self.presence: dict[int, float] = {}

    @property
    def filled(self) -> int:
        """Slots that hold a photograph: the first ones."""
        return len(self._slots)

    def __contains__(self, number: int) -> bool:
        return number in self._slots

    def put(self, number: int, photo: PreparedPhoto, keep: frozenset[int] = frozenset()) -> None:
        """Fills a slot with photograph ``number``.  keep: photographs that may not make room; fewer than there are slots."""
        if len(self._slots) < self.count:
            slot = len(self._slots)
        else:
            slot = self._slots.pop(next(other for other in self._slots if other not in keep))
        self._slots[number] = slot
        self.words[slot * self.size : slot * self.size + len(photo.words)] = photo.words
        self._photos[slot] = replace(photo, words=photo.words[:0])
        self.changed.add(slot)

    def records(self, numbers: list[int], camera: "Camera") -> tuple[np.ndarray, np.ndarray]:
        """(n, NUMBERS) float32 and (n, PLACES) int32 of photographs that are here, for a camera."""
        floats, places = np.zeros((len(numbers), NUMBERS), np.float32), np.zeros((len(numbers), PLACES), np.int32)
        for row, number in enumerate(numbers):
            slot = self._slots.pop(number)
            self._slots[number] = slot
            photo = self._photos[slot]
            assert photo is not None
            to_photo = photo.camera_to_world[:3, :3].T
            floats[row, TURN : TURN + 9] = (to_photo @ camera.view_rotation.T).ravel()
            floats[row, SHIFT : SHIFT + 3] = to_photo @ (camera.position - photo.camera_to_world[:3, 3])
            floats[row, LENS : LENS + 4] = photo.lens
            floats[row, GAINS : GAINS + 3] = photo.gains
            floats[row, PRESENCE] = self.presence.get(number, 1.0)
            places[row] = photo.places
            places[row, LEVEL : LEVEL + photo.places[LEVELS]] += slot * self.size
            places[row, MAP] += slot * self.size
        return floats, places
