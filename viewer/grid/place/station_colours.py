"""What exposure compensation needs to know about a grid of a place, kept in the cache: measured once for each grid.

A sample of its points is averaged in voxels of a lattice that is fixed in file coordinates.  It depends on the grid alone, and
on two powers of two that all grids of a place share: points of a station, and the side of a voxel.  So where a grid comes, goes
or changes, only that grid is read, and the gains are to the byte those of measuring all of them again.
"""

import contextlib
import hashlib
import json
import math
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ....model.appearance.exposure import VOXEL_SPACINGS, StationVoxels
from ....model.common.files.atomic_write import write_atomic
from ...common.paths import cache_dir
from ...preprocess.exposure_compensation import SAMPLE
from ...preprocess.point_colour import BLACK_TO_DARK, DARK_LEVEL
from ..scene import Scene, unpack

VERSION = 1
"""Of what is kept."""
OF_STATION = 32_768
"""Points of a station that are compared, at least.  Of a procedural campus (60 stations, two in a room) rooms are then linked
through their walls, and gains have an error of 0.2 % (standard deviation); with half, pairs in a room still share 1,500 voxels,
but neighbouring rooms 300, too few (model.appearance.exposure.SHARED_VOXELS)."""
MOST_SAMPLED = 6_000_000
"""Points of a grid at most: 250 MB."""
_OVERLAP = 2.0
"""Stations that see a surface together: a voxel is VOXEL_SPACINGS spacings of the points of so many."""
_BITS = 21
"""Bits of a voxel's number along an axis; 2**21 voxels farther along it, numbers repeat."""
_QUERIES = 1024
"""Points around which the spacing of a sample is measured: its median has a standard error of 1 %."""


@dataclass(frozen=True, eq=False)
class StationColours:
    """spacing: of the sample, file units.  exponent: voxels have a side of 2**exponent.  frequent_black: whether black points
    are so frequent among dark ones that black is no colour.  starts: (S + 1,) where each station's voxels begin; voxels (M,)
    int64, means (M, 3) float32: as in StationVoxels."""

    spacing: float
    exponent: int
    frequent_black: bool
    starts: np.ndarray
    voxels: np.ndarray
    means: np.ndarray

    def stations(self) -> list[StationVoxels]:
        """Of each station of the grid."""
        return [StationVoxels(self.voxels[a:b], self.means[a:b]) for a, b in zip(self.starts[:-1], self.starts[1:])]


def identity_of_grid(scene: Scene, folder: Path) -> list:
    """What tells a grid from all others: its folder, and a sum over the checksums of its points."""
    return [str(folder), scene.count, 0 if scene.checksums is None else int(np.bitwise_xor.reduce(np.asarray(scene.checksums)))]


def station_colours(scenes: Sequence[Scene], folders: Sequence[Path], stations: Sequence[int]) -> list[StationColours]:
    """Of each grid, from the cache or measured and kept there.  stations: of each grid, those with a gain of their own."""
    total = sum(stations)
    share = max(OF_STATION, 1 << int(math.log2(max(SAMPLE / total, 1))))
    kept = [_kept(scene, folder, own, share) for scene, folder, own in zip(scenes, folders, stations)]
    found = [_read(path, own) for path, own in zip(kept, stations)]
    for number, (scene, own) in enumerate(zip(scenes, stations)):
        if found[number] is None:
            found[number] = _measured(scene, own, share, None)
            _write(kept[number], found[number])
    known = [one for one in found if one is not None]
    exponent = _exponent(float(np.median([one.spacing for one in known])))
    for number, (scene, own) in enumerate(zip(scenes, stations)):
        if known[number].exponent != exponent:
            known[number] = _measured(scene, own, share, exponent, known[number].spacing)
            _write(kept[number], known[number])
    return known


def _exponent(spacing: float) -> int:
    return round(math.log2(VOXEL_SPACINGS / math.sqrt(_OVERLAP) * spacing))


def _measured(scene: Scene, stations: int, share: int, exponent: int | None, spacing: float | None = None) -> StationColours:
    """exponent: None: as the grid's own sample asks for."""
    from ....model.appearance.spacing import median_spacing

    xyz, rgb, _, station = unpack(scene, _sample(scene, min(share * stations, MOST_SAMPLED)))
    spacing = median_spacing(xyz, samples=_QUERIES) if spacing is None else spacing
    exponent = _exponent(spacing) if exponent is None else exponent
    steps = np.floor(np.ldexp(xyz, -exponent)).astype(np.int64) & ((1 << _BITS) - 1)
    key = steps[:, 0] | steps[:, 1] << _BITS | steps[:, 2] << 2 * _BITS
    owner = np.minimum(station.astype(np.int64), stations - 1)
    order = np.lexsort((key, owner)) if stations > 1 else np.argsort(key)
    key, owner, rgb = key[order], owner[order], rgb[order]
    first = np.flatnonzero(np.r_[True, (key[1:] != key[:-1]) | (owner[1:] != owner[:-1])])
    sums = np.add.reduceat(rgb.astype(np.int64), first, axis=0)
    means = (sums / np.diff(np.r_[first, len(key)])[:, None]).astype(np.float32)
    starts = np.searchsorted(owner[first], np.arange(stations + 1))
    return StationColours(spacing, exponent, _exceeds_dark(rgb), starts, key[first], means)


def _exceeds_dark(rgb: np.ndarray) -> bool:
    """Whether black points (n, 3) are so frequent among dark ones that black is no colour."""
    highest = rgb.max(axis=1, initial=0)
    black, dark = np.count_nonzero(highest == 0), np.count_nonzero((highest > 0) & (highest <= DARK_LEVEL))
    return bool(black > BLACK_TO_DARK * dark / DARK_LEVEL)


def _sample(scene: Scene, wanted: float) -> slice:
    """About ``wanted`` points, spread evenly: whole coarse layers, or each so many of them."""
    head = scene.coarse_points(wanted)
    return slice(0, head, max(1, math.ceil(head / max(wanted, 1))))


def _kept(scene: Scene, folder: Path, stations: int, share: int) -> Path:
    key = json.dumps([VERSION, stations, share, *identity_of_grid(scene, folder)])
    return cache_dir() / "places" / "grids" / f"{hashlib.sha256(key.encode()).hexdigest()[:32]}.npz"


_DAMAGE = (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile, IndexError, OverflowError, SyntaxError)


def _read(path: Path, stations: int) -> StationColours | None:
    """None where there is nothing usable.  The members of an .npz file have checksums."""
    with contextlib.suppress(*_DAMAGE), np.load(path, allow_pickle=False) as kept:
        spacing, exponent, black = (float(value) for value in kept["facts"])
        starts, voxels, means = kept["starts"], kept["voxels"], kept["means"]
        usable = 0 < spacing < math.inf and starts.shape == (stations + 1,) and means.shape == (len(voxels), 3)
        if usable and starts[0] == 0 and starts[-1] == len(voxels) and (np.diff(starts) >= 0).all():
            return StationColours(spacing, int(exponent), bool(black), starts, voxels, means)
    return None


def _write(path: Path, found: StationColours | None) -> None:
    if found is None:
        return
    facts = np.array([found.spacing, found.exponent, found.frequent_black], np.float64)

    def save(part: Path) -> None:
        with part.open("wb") as file:
            np.savez(file, facts=facts, starts=found.starts, voxels=found.voxels, means=found.means)

    with contextlib.suppress(OSError):  # a cache that cannot be written costs time only
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        write_atomic(path, save)
