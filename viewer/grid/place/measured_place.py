"""What is measured of a place as a whole, kept in the cache beside the grids: gains between stations, point spacing, and where
black is no colour.

It is found again where a grid comes, goes or changes, from what is kept for each grid (viewer.grid.place.station_colours) and a
few cells of all: a second for hundreds of files.
"""

import contextlib
import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from ....model.common.files.atomic_write import write_atomic
from ...common.paths import cache_dir
from ...common.progress import progress
from ..cache import checksums
from ..scene import Scene
from .join_grids import joined
from .joined_exposures import applied_gains, has_missing_black, solved_gains, station_counts
from .station_colours import identity_of_grid

VERSION = 2
"""Of what is kept."""


@dataclass(frozen=True)
class Measured:
    """gains: (S, 3), of all stations.  matched: of how many they could be found.  spacing: file units.  missing_black: of each
    grid whether its black points have no colour."""

    gains: np.ndarray
    matched: int
    spacing: float
    missing_black: list[bool]


def scene_of_grids(scenes: Sequence[Scene], folders: Sequence[Path], *, match: bool = True, more: Sequence[Scene] = ()
                   ) -> Scene:
    """The scene of several grids, with their exposures compensated, if ``match``.  Raises InputError as
    viewer.grid.place.join_grids.

    scenes: as read from ``folders``; at least one.  more: grids that are in memory only, which stay as they are.
    """
    found = measured(scenes, folders, match)
    by_grid, summary = applied_gains(found.gains, found.matched, station_counts(scenes))
    scene = joined_in_memory(more, scenes, folders, by_grid, found.missing_black)
    scene = scene if more else replace(scene, spacing=found.spacing)
    return replace(scene, meta=replace(scene.meta, exposures=summary)) if match else scene


def measured(scenes: Sequence[Scene], folders: Sequence[Path], match: bool) -> Measured:
    """What is measured of the place, from the cache or found now and kept there.  Others as for :func:`scene_of_grids`."""
    kept, stations = _kept(scenes, folders, match), station_counts(scenes)
    found = _read(kept, sum(stations), len(scenes))
    if found is None:
        from .joined_spacing import joined_spacing  # compiled loops

        with progress(0, "joining the grids") as meter:
            meter.update(0)
            gains, matched = solved_gains(scenes, folders, stations) if match else (np.ones((sum(stations), 3)), 0)
            spacing = joined_spacing(joined(scenes, folders))
            found = Measured(gains, matched, spacing, has_missing_black(scenes, folders))
        _write(kept, found)
    return found


def joined_in_memory(more: Sequence[Scene], scenes: Sequence[Scene] = (), folders: Sequence[Path] = (),
                     gains: Sequence[np.ndarray | None] = (), missing_black: Sequence[bool] = ()) -> Scene:
    """The scene of grids in memory, and of others behind them, which are as for viewer.grid.place.join_grids."""
    known = [replace(scene, checksums=checksums(scene.points)[0]) for scene in more]
    scene = joined([*known, *scenes], [*[None] * len(known), *folders], [*[None] * len(known), *gains],
                   [*(scene.unlit for scene in known), *missing_black])
    return replace(scene, live=tuple(source for one in known for source in one.live))


def _kept(scenes: Sequence[Scene], folders: Sequence[Path], match: bool) -> Path:
    """The file in the cache for these grids."""
    key = [VERSION, match, [identity_of_grid(scene, folder) for scene, folder in zip(scenes, folders)]]
    return cache_dir() / "places" / f"{hashlib.sha256(json.dumps(key).encode()).hexdigest()[:32]}.json"


def _read(kept: Path, stations: int, grids: int) -> Measured | None:
    with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
        known = json.loads(kept.read_text("utf-8"))
        gains, spacing = np.array(known["gains"], np.float64), float(known["spacing"])
        usable = gains.shape == (stations, 3) and np.isfinite(gains).all() and gains.min() > 0 and 0 < spacing < np.inf
        black = [bool(one) for one in known["missing_black"]]
        return Measured(gains, int(known["matched"]), spacing, black) if usable and len(black) == grids else None
    return None


def _write(kept: Path, found: Measured) -> None:
    text = json.dumps(asdict(found) | {"gains": found.gains.tolist()})
    with contextlib.suppress(OSError):  # a cache that cannot be written costs time only
        kept.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        write_atomic(kept, lambda part: part.write_text(text, "utf-8"))
