"""Splats of the points in sight as GLB, SPZ or PLY.  The table of formats is SPLATS.

Frame of a file: upright, metres where the unit is known, relative to ``Splats.origin``; the way back to the scan's coordinates
is written where the format has a place for it.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ... import __version__
from ...common.errors import InputError
from ...common.progress import progress
from ...common.text import number_text
from ...preprocess.scan_description import ScanDescription
from ...readers.splats.splat_frame import OF_SPLATS
from ...work.places.up_axis import upright_axes
from ...work.selection import Selection
from ...work.splats.make_splats import splats_of
from ...work.splats.splat_cloud import Splats
from .crs_records import Reference, reference_of, without_sources
from .formats.splat_glb import write_splat_glb
from .formats.splat_ply import UNIT, write_splat_ply
from .formats.splat_spz import write_splat_spz
from .losses import Losses
from .record_stream import sources_of, why_gone

BUDGET, LEAST_BUDGET, MOST_BUDGET = 2_000_000, 1_000, 32_000_000
"""Splats of a file: the default, which browsers draw; and limits.  GLB holds 42 million of 100 bytes."""
NAME = "splats.ply"
"""A PLY whose name ends so holds splats, any other measured points unless ``--splats`` is given."""
MOST_WKT = 8000
"""Characters of a definition, below what readers take of a line of PLY's header and SPZ of a comment."""
_MEASURED = "measured points"
_DOWN = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
"""From a world whose z is up to x right, y down, z forward."""
_UP = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
"""From a world whose z is up to x right, y up, z back."""


@dataclass(frozen=True)
class SplatTarget:
    """name: in help and messages.  bytes: of a splat of degree 1, about.  axes: from a world whose z is up to the file's frame.
    write: called with path, splats in the file's frame, Placed, and what is called with the number of splats written."""

    name: str
    bytes: float
    axes: np.ndarray
    write: Callable[..., None]


@dataclass(frozen=True)
class Placed:
    """to_scan: (3, 4), from the file's coordinates to the scan's.  about: facts for a comment or ``extras``, by name."""

    to_scan: np.ndarray
    about: dict[str, Any]


def _write_ply(path: Path, splats: Splats, placed: Placed, advance: Callable[[int], None]) -> None:
    write_splat_ply(path, splats, placed.to_scan, [f"{name} {value}" for name, value in placed.about.items()], advance)


def _write_glb(path: Path, splats: Splats, placed: Placed, advance: Callable[[int], None]) -> None:
    extras = {"to_scan": placed.to_scan.tolist(), **placed.about}
    write_splat_glb(path, splats, extras, f"pointglass {__version__}", advance)


def _write_spz(path: Path, splats: Splats, placed: Placed, advance: Callable[[int], None]) -> None:
    write_splat_spz(path, splats, {"to_scan": placed.to_scan.tolist(), **placed.about}, advance)


SPLATS: dict[str, SplatTarget] = {
    ".glb": SplatTarget("GLB", 100, _UP, _write_glb),
    ".spz": SplatTarget("SPZ", 18, _UP, _write_spz),
    NAME: SplatTarget("PLY", 108, _DOWN, _write_ply),
}
"""End of a file's name -> its format of splats."""


def splat_target(out: Path, splats: bool = False) -> SplatTarget | None:
    """The format of splats that a name asks for; None where it asks for measured points.  splats: also where the name is that
    of any PLY."""
    name = out.name.lower()
    found = next((target for end, target in SPLATS.items() if name.endswith(end)), None)
    return SPLATS[NAME] if found is None and splats and name.endswith(".ply") else found


def budget_of(text: str) -> int:
    """A number of splats, such as 2M, 500k or 300000.  Raises InputError."""
    found = re.fullmatch(r"(\d+(?:\.\d+)?)([kKmM]?)", text)
    count = 0 if found is None else round(float(found[1]) * {"": 1, "k": 1e3, "m": 1e6}[found[2].lower()])
    if not LEAST_BUDGET <= count <= MOST_BUDGET:
        raise InputError(f"expected a number of splats from {LEAST_BUDGET:,} to {MOST_BUDGET:,}, such as 0.5M, 2M or 8M",
                         option="--budget", value=text)
    return count


def splat_bytes(target: SplatTarget, selection: Selection, budget: int) -> int:
    """A low estimate of a file's size; 0 where a selection decides it."""
    return int(min(budget, selection.scene.count) * target.bytes / 2) if selection.everything else 0


def write_splats(path: Path, target: SplatTarget, selection: Selection, budget: int, up: tuple[float, float, float],
                 losses: Losses) -> int:  # fmt: skip
    """Writes the file; returns the number of splats.  up: direction in the scan's coordinates.

    Raises InputError, also where the selection leaves no point."""
    meta = selection.scene.meta
    splats, points = splats_of(selection, budget)
    metre = meta.metres_per_unit
    if metre is None:
        losses.add("the unit of length is not known and is taken for metres")
    if points.share < 1:
        losses.add(f"made from {len(points.xyz):,} points, {points.share:.1%} of those in sight, chosen at random")
    factor, turn = metre or 1.0, target.axes @ upright_axes(up).T
    to_scan = np.concatenate([turn.T / factor, splats.origin[:, None]], axis=1)
    if target.name == "SPZ":
        moved = splats.origin.any() or factor != 1
        x, y, z = splats.origin.tolist()
        place = f"the origin {number_text(x)}, {number_text(y)}, {number_text(z)}, " if moved else ""
        losses.add(f"SPZ has no place for {place}the scan's axes, unit and reference system (they are in a comment that "
                   "pointglass reads and others skip) nor for the number of points of each splat (GLB and PLY have)")
    about: dict[str, Any] = {"crs": meta.crs or "unknown", "unit": meta.units,
                             "splats_from": f"{len(points.xyz)} {_made_from(meta)}"}
    about |= {} if metre is None else {UNIT: metre}
    wkt = " ".join((_reference(selection, losses).wkt or "").split())
    if len(wkt) > MOST_WKT:
        losses.add(f"the definition of the reference system has {len(wkt):,} characters, over {MOST_WKT:,}, and is left out")
    elif wkt:
        about["wkt"] = wkt
    if (made_from := _made_from(meta)) != _MEASURED:
        losses.add(f"splats are made anew from the {made_from}: {len(points.xyz):,} become {len(splats):,}")
    placed = splats.turned(turn, factor)
    with progress(len(splats), "writing", "splat") as meter:
        target.write(path, placed, Placed(to_scan, about), meter.update)
    return len(splats)


def _made_from(meta: ScanDescription) -> str:
    """What the splats of an export are made from, in words."""
    splats = [name.endswith(OF_SPLATS) for name in (meta.format or "").split(", ")]
    return "centres of splats" if all(splats) else f"{_MEASURED} and centres of splats" if any(splats) else _MEASURED


def _reference(selection: Selection, losses: Losses) -> Reference:
    """The reference system as the files define it: the name alone is often not enough."""
    from ...readers.moved_source import unmoved

    scene = selection.scene
    if scene.meta.crs is None or why_gone(scene) is not None:
        return without_sources(scene.meta)
    return reference_of(scene.meta, [unmoved(source)[0] for source in sources_of(scene)], losses)
