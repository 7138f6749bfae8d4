"""A scan from arrays: points that a program has in memory are drawn as those of a file are."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..common.errors import InputError
from ..picture.settings import Memory
from .arguments import memory_of, python_names

if TYPE_CHECKING:
    from .open_scan import Scan

_MOST_STATIONS = 255
"""Stations that the 8 bits of a packed point tell apart."""
_WHOLE = {"u1": 255, "u2": 65535}


def from_points(
    xyz: npt.ArrayLike,
    rgb: npt.ArrayLike,
    *,
    intensity: npt.ArrayLike | None = None,
    classification: npt.ArrayLike | None = None,
    station: npt.ArrayLike | None = None,
    stations: npt.ArrayLike | None = None,
    metres_per_unit: float | None = None,
    name: str = "points",
    gpu_memory: int | None = None,
) -> Scan:
    """A scan in memory, from arrays of N points.

    xyz: (N, 3) numbers, any frame, z up; points that are not finite are left out.
    rgb: (N, 3) sRGB: uint8; uint16, of which the upper 8 bits are drawn; or floats from 0 to 1.
    intensity: (N,) whole numbers from 0 to 65535.  classification: (N,) whole numbers from 0 to 255, as in LAS.
    station: (N,) whole numbers, the row of ``stations`` from which each point was measured.
    stations: (S, 3) where each scanner stood, NaN where that is not known; S is at most 255.  With one row ``station`` may be
        left out.  Colours are blended by the angle between the viewing ray and the scanner's ray where positions are known.
    metres_per_unit: length of a unit of xyz in metres, None where it is not known.  name: what the scan is called.
    gpu_memory: as for :func:`open`.

    The scan refers to the arrays: leave them as they are while it is open.  ``Scan.points`` gives their values, in the order of
    the grid.  Raises InputError naming the first argument that does not fit.
    """
    from ..grid.open_scene import scene_from_arrays
    from ..preprocess.scan_description import ScanDescription, ScanSummary
    from .open_scan import Scan

    places = _coordinates(xyz)
    count = len(places)
    scan, scanners = _stations(count, station, stations)
    length = _length(metres_per_unit)
    counts = np.bincount(scan, minlength=len(scanners))
    known_places = [None if np.isnan(place).any() else tuple(place.tolist()) for place in scanners]
    scans = tuple(ScanSummary(f"station {n + 1}", int(counts[n]), p) for n, p in enumerate(known_places))
    known = ScanDescription(scans=scans)
    if length is not None:
        units = "metre" if length == 1.0 else f"unit of {length:g} m"
        known = replace(known, metres_per_unit=length, units=units)
    with python_names():
        scene = scene_from_arrays(
            places, _colours(rgb, count), intensity=_whole("intensity", intensity, count, "u2"),
            classification=_whole("classification", classification, count, "u1"), scan=scan if scans else None, meta=known,
        )  # fmt: skip
    return Scan(scene, str(name), Memory(gpu=memory_of(gpu_memory)))


def _array(name: str, value: npt.ArrayLike, shape: tuple[int | None, ...], words: str) -> np.ndarray:
    """``value`` as an array of real numbers.  shape: None where any length fits."""
    try:
        array = np.asarray(value)
    except (TypeError, ValueError):
        array = np.empty(0, object)
    fits = array.ndim == len(shape) and all(want in (None, have) for want, have in zip(shape, array.shape))
    if not fits or array.dtype.kind not in "fiu":
        raise InputError(f"{name}: expected {words}, got shape {array.shape} of {array.dtype}")
    return array


def _coordinates(xyz: npt.ArrayLike) -> np.ndarray:
    places = _array("xyz", xyz, (None, 3), "(N, 3) numbers")
    if len(places) == 0:
        raise InputError("holds no points", option="xyz")
    return places


def _colours(rgb: npt.ArrayLike, count: int) -> npt.NDArray[np.uint8]:
    colours = _array("rgb", rgb, (count, 3), f"({count:,}, 3) numbers, one colour for each row of xyz")
    if colours.dtype == np.uint8:
        return colours
    low, high = colours.min(), colours.max()
    if colours.dtype.kind == "f":
        if not (low >= 0 and high <= 1):
            raise InputError(f"floats from {low:g} to {high:g}; expected floats from 0 to 1, or uint8", option="rgb")
        return np.rint(colours * 255).astype(np.uint8)
    if colours.dtype == np.uint16:
        return (colours >> 8).astype(np.uint8)
    if not (low >= 0 and high <= 255):
        raise InputError(f"{colours.dtype} from {low} to {high}; expected 0 to 255, uint16, or floats from 0 to 1",
                         option="rgb")
    return colours.astype(np.uint8)


def _whole(name: str, value: npt.ArrayLike | None, count: int, kind: str) -> np.ndarray | None:
    """Whole numbers of a point each, in the unsigned type ``kind``."""
    if value is None:
        return None
    most = _WHOLE[kind]
    array = _array(name, value, (count,), f"({count:,},) whole numbers from 0 to {most}, one for each row of xyz")
    low, high = array.min(), array.max()
    if not (low >= 0 and high <= most) or (array.dtype.kind == "f" and not (array == np.rint(array)).all()):
        raise InputError(f"{name}: {array.dtype} from {low:g} to {high:g}; expected whole numbers from 0 to {most}")
    return array.astype(kind)


def _stations(count: int, station: npt.ArrayLike | None, stations: npt.ArrayLike | None) -> tuple[np.ndarray, np.ndarray]:
    """(count,) uint8 rows, and the (S, 3) positions; S is 0 where nothing is known."""
    places = np.empty((0, 3))
    if stations is not None:
        places = _array("stations", stations, (None, 3), "(S, 3) numbers").astype(np.float64)
        if len(places) > _MOST_STATIONS:
            raise InputError(f"{len(places):,} rows; at most {_MOST_STATIONS} stations are told apart", option="stations")
        if np.isinf(places).any():
            raise InputError("a position is infinite", option="stations", remedy="give NaN where it is not known")
    if station is None:
        if len(places) > 1:
            raise InputError(f"missing; stations has {len(places)} rows, so give the row of each point", option="station")
        return np.zeros(count, np.uint8), places
    rows = _whole("station", station, count, "u1")
    assert rows is not None
    needed = int(rows.max()) + 1
    if needed > _MOST_STATIONS:
        raise InputError(f"row {needed - 1}; at most {_MOST_STATIONS} stations are told apart", option="station")
    if stations is None:
        return rows, np.full((needed, 3), np.nan)
    if needed > len(places):
        raise InputError(f"row {needed - 1} of stations, which has {len(places)} rows", option="station")
    return rows, places


def _length(metres_per_unit: float | None) -> float | None:
    if metres_per_unit is None:
        return None
    if isinstance(metres_per_unit, bool) or not isinstance(metres_per_unit, (int, float, np.number)) or not (
            0 < metres_per_unit < np.inf):
        raise InputError("expected a number above 0, such as 1 or 0.3048, or None", option="metres_per_unit",
                         value=metres_per_unit)
    return float(metres_per_unit)
