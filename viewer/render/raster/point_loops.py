"""Compiled decisions about one point: whether edits drop it, its colour, and its weight in view-dependent blending.

The same operations, in the same order and in float32, as shaders/common_edits.glsl, common_attributes.glsl and
common_stations.glsl.  References: viewer.picture.clip.contains, viewer.picture.colour_modes.levels and
model/reference/station_weights.py.
"""

from typing import NamedTuple

import numpy as np

from ....model.common.jit import compiled
from ....model.reference.station_constants import HEAVIEST, UNPLACED
from ...grid.records.point_marks import DROPPED, HAS_CLASS, SELECTED
from ...picture.colour_modes import PointValue
from .edit_block import BLOCK, DEFINES, DIMMED_LEAST, DIMMED_SHIFT

_F, _U = np.float32, np.uint32
_COLOUR, _CLASS, _STATION = int(PointValue.COLOUR), int(PointValue.CLASS), int(PointValue.STATION)
_INTENSITY, _ALONG = int(PointValue.INTENSITY), int(PointValue.ALONG)
_HAS_CLASS, _SELECTED, _DROPPED = _U(HAS_CLASS), _U(SELECTED), _U(DROPPED)
_SELECTED_HALF = DEFINES["SELECTED_HALF"]


class Edited(NamedTuple):
    """The fields of viewer.render.raster.edit_block.BLOCK; all empty where there are no edits."""

    clip_rows: np.ndarray
    clip_groups: np.ndarray
    hidden: np.ndarray
    upward: np.ndarray
    ramp: np.ndarray
    mode: np.ndarray
    table: np.ndarray
    hidden_classes: np.ndarray
    marks: np.ndarray

    @staticmethod
    def of(block: bytes | None) -> "Edited":
        """The edits of a picture.  block: of viewer.render.raster.edit_block.block_of, or None."""
        if block is None:
            return Edited(*(np.empty((0, *BLOCK[name].shape[1:]), BLOCK[name].base) for name in Edited._fields))
        made = np.frombuffer(block, BLOCK)[0]
        return Edited(*(np.array(made[name]) for name in Edited._fields))


@compiled(nogil=True)
def dropped(edits, x, y, z, second, station, mark):
    """Whether edits remove a point.  x, y, z: view frame.  second: word 1 of the point.  mark: its entry of Edited.marks."""
    if mark & _DROPPED:
        return True
    if edits.mode[3] != 0:
        code = class_of(second, edits.mode[1] != 0, mark)
        if edits.hidden_classes[code >> _U(5)] >> (code & _U(31)) & _U(1):
            return True
    if edits.hidden[station >> _U(5)] >> (station & _U(31)) & _U(1):
        return True
    inside, rows = _U(0), edits.clip_rows
    for clip in range(edits.clip_groups[0]):
        within = True
        for row in range(3 * clip, 3 * clip + 3):
            within &= abs(((rows[row, 0] * x + rows[row, 1] * y) + rows[row, 2] * z) + rows[row, 3]) <= _F(1.0)
        if within:
            inside |= _U(1) << _U(clip)
    keeping, slabs, removing = edits.clip_groups[1], edits.clip_groups[2], edits.clip_groups[3]
    return (keeping > 0 and inside & keeping == 0) or (slabs > 0 and inside & slabs == 0) or inside & removing > 0


@compiled(nogil=True)
def class_of(second, classes, mark):
    """The class of a point.  classes: whether points have them."""
    if mark & _HAS_CLASS:
        return mark & _U(255)
    return second >> _U(24) if classes else _U(0)


@compiled(nogil=True)
def recoloured(edits, second, third, x, y, z, mark):
    """The third word of a packed point with the colour of its attribute, tinted where it is selected; unchanged where points
    keep their colours.

    second, third: words 1 and 2 of the point, as viewer.grid.scene lays them out.  x, y, z: view frame.  mark: of the point."""
    third = _by_attribute(edits, second, third, x, y, z, mark)
    if mark & _SELECTED:
        return third & _U(0xFF000000) | ((third >> _U(1) & _U(0x7F7F7F)) + _U(_SELECTED_HALF))
    return third


@compiled(nogil=True)
def _by_attribute(edits, second, third, x, y, z, mark):
    mode, ramp = edits.mode, edits.ramp
    classes = mode[1] != 0
    if mode[2] == _U(1) + (third >> _U(24)):
        grey = _U(77) * (third & _U(0xFF)) + _U(150) * (third >> _U(8) & _U(0xFF)) + _U(29) * (third >> _U(16) & _U(0xFF))
        return third & _U(0xFF000000) | (_U(DIMMED_LEAST) + (grey >> _U(8 + DIMMED_SHIFT))) * _U(0x010101)
    if mode[0] == _COLOUR:
        return third
    if mode[0] == _CLASS:
        row = class_of(second, classes, mark)
    elif mode[0] == _STATION:
        row = third >> _U(24)
    else:
        if mode[0] == _INTENSITY:
            bits = second >> _U(16)
            intensity = np.rint(_F(bits & _U(0xFF)) * ramp[3] + ramp[2]) if classes else _F(bits)
            above = intensity - ramp[0]
        elif mode[0] == _ALONG:
            up = edits.upward
            above = ((up[0] * x + up[1] * y) + up[2] * z) + up[3]
        else:  # PointValue.DISTANCE
            above = np.sqrt((x * x + y * y) + z * z) - ramp[0]
        level = above * ramp[1]
        row = _U((min(level, _F(255.0)) if level > _F(0.0) else _F(0.0)) + _F(0.5))
    return third & _U(0xFF000000) | edits.table[row]


@compiled(nogil=True)
def point_weight(stations, x, y, z, station):
    """The weight of a point, 1..HEAVIEST; UNPLACED where its scanner's position is unknown.

    stations: (256, 4) float32, view position of each scan's scanner, and 1, or 0 where unknown.  x, y, z: view frame.
    """
    if stations[station, 3] < _F(0.5):
        return _U(UNPLACED)
    bx, by, bz = stations[station, 0] - x, stations[station, 1] - y, stations[station, 2] - z
    eye = (x * x + y * y) + z * z
    scanner = (bx * bx + by * by) + bz * bz
    along = (bx * x + by * y) + bz * z
    turned = _F(0.5) - _F(0.5) * ((along / eye) * abs(along / scanner))
    square = turned * turned
    value = (_F(2.0 * HEAVIEST) * (square * square)) * (scanner / (scanner + eye)) + _F(0.5)
    return _U(min(value, _F(HEAVIEST + 0.5))) if value >= _F(1.0) else _U(1)  # NaN is not at least 1
