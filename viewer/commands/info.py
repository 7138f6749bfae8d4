"""Facts about a scan: ``pointglass info``.  All lengths in file units."""

import logging
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...model.appearance.noise import NoiseModel
from ...model.common.printable import printable
from ...model.common.scanner_positions import stations_differ
from ..common.rigid_transform import motion_text
from ..common.text import counted, place_text
from ..grid.cache import CacheError
from ..grid.open_scene import open_scene
from ..grid.scene import Scene
from ..picture.json_values import to_json
from ..preprocess.point_attributes import described
from ..preprocess.scan_description import ExposureSummary, ScanDescription
from ..readers.e57.e57_pictures import StoredPicture, pictures_in
from ..readers.remote.local_copies import shown_source
from ..work.project import moves_of
from ..work.reference import with_reference

if TYPE_CHECKING:
    from ..work.document import ScanFile

_log = logging.getLogger(__name__)


def scene_of(paths: list[Path], *, cache: bool = True, columns: str | None = None,
             assigned: "Sequence[ScanFile]" = ()) -> Scene:
    """The scene that facts are wanted of.  cache, columns: as for open_scene.  assigned: the scans of a document, with the
    unit, the reference system and the transformations that it assigns.

    Counting the points and measuring their spacing needs the grid, so the scan is read and its grid built, and stored in the
    cache where that can be written.  Raises InputError as open_scene and with_reference do.
    """
    try:
        scene = open_scene(paths, cache=cache, columns=columns, moves=moves_of(assigned))
    except CacheError as error:
        _log.warning("%s; the grid is built in memory", error)
        scene = open_scene(paths, cache=False, columns=columns, moves=moves_of(assigned))
    return replace(scene, meta=with_reference(scene.meta, assigned))


def facts(scene: Scene, full: bool = False) -> dict:
    """Facts about a scene, ready for JSON.  full: include the grid."""
    meta = scene.meta
    low, high = scene.bounds.tolist()
    out = {
        "sources": list(map(shown_source, meta.sources)),
        "format": meta.format,
        "points": scene.count,
        "stations": "weighed" if stations_differ(scene.station_places) else "equal",
        "bounds": {"min": low, "max": high},
        "size": [b - a for a, b in zip(low, high, strict=True)],
        "spacing": scene.spacing if low != high else None,  # of one place it is not known
        "units": meta.units,
        "metres_per_unit": meta.metres_per_unit,
        "crs": meta.crs,
        "colour": to_json(meta.colour),
        "exposures": to_json(meta.exposures),
        "passes": to_json(meta.passes),
        "noise": _noise_facts(scene),
        "attributes": to_json(meta.attributes),
        "scans": to_json(meta.scans),
        "photographs": [{"file": str(one.file), "name": one.name, "width": one.width, "height": one.height,
                         "geometry": one.kind, "pose": one.placed} for one in pictures_in(meta.sources)],
        "dropped": to_json(meta.dropped),
        "warnings": meta.warning_texts,
    }
    if full:
        out["grid"] = {
            "cell_size": scene.cell_size,
            "step": scene.step,
            "cells": len(scene.cell_coords),
            "layers": np.diff(scene.layer_ends, prepend=0).tolist(),
            "bytes": scene.count * 12,
        }
    if meta.assigned:
        out["assigned"] = meta.assigned.names
    if meta.records is not None and meta.records.moves:
        out["moves"] = to_json(meta.records.moves)
    return out


def _moves(meta: ScanDescription, middle: np.ndarray) -> list[str]:
    """What the project moves, a line for each file."""
    moves = () if meta.records is None else meta.records.moves
    return [f"{Path(source).name}: {motion_text(rows, middle)}, by the project" for source, rows in zip(meta.sources, moves)
            if rows is not None]


def format_text(scene: Scene, full: bool = False) -> str:
    """The :func:`facts` as lines for a terminal."""
    meta, (low, high) = scene.meta, scene.bounds.tolist()
    unit = {"metre": "m", "foot": "ft", "US survey foot": "ft (US survey)", "unknown": "units"}.get(meta.units, meta.units)
    metres = meta.metres_per_unit
    lengths = f"1 unit = {metres:.10g} m" if metres else "length not given by the file"
    rows = [
        ("file", ", ".join(map(shown_source, meta.sources)) or "-"),
        ("format", meta.format),
        ("points", f"{scene.count:,}"),
        ("from", place_text(low)),
        ("to", place_text(high)),
        ("size", " x ".join(f"{b - a:.4g}" for a, b in zip(low, high, strict=True)) + f" {unit}"),
        ("spacing", f"{scene.spacing:.3g} {unit}" if low != high else "unknown: all points lie in one place"),
        ("units", f"{meta.units} ({lengths}{', assigned in the project' if meta.assigned else ''})"),
        ("CRS", f"{meta.crs or 'not given'}{' (assigned in the project)' if meta.assigned.crs else ''}"),
        ("colour", "-" if meta.colour is None else meta.colour.note),
        ("noise", _noise(scene.noise)),
        *described(meta.attributes),
    ]
    if meta.exposures is not None:
        rows.append(("exposure", _exposures(meta.exposures)))
    if meta.passes is not None and meta.passes.applied:
        removed = f"{1 - meta.passes.variance_left:.0%} of the variance between neighbours removed"
        rows.append(("passes", f"exposures of runs of points compensated, {removed} (--exposures as-scanned keeps them)"))
    for scan in meta.scans:
        place = f"scanner at {place_text(scan.position)}" if scan.position else "no pose"
        how = ", inferred from the order of the points" if scan.inferred else ""
        rows.append(("scan", f"{scan.name}: {counted(scan.count, 'point')}, {place}{how}"))
    if photographs := pictures_in(meta.sources):
        rows.append(("photos", _photographs_text(photographs)))
    if stations_differ(scene.station_places):
        rows.append(("stations", "view-dependent blending by the angle to each scanner's ray (--stations equal averages them)"))
    if full:
        rows.append(("grid", f"{len(scene.cell_coords):,} cells of {scene.cell_size:g}, {scene.layers} layers"))
        rows.append(("packed", f"{scene.count * 12 / 1e6:,.1f} MB, positions {scene.step:.2g} apart"))
    rows += [("moved", text) for text in _moves(meta, scene.bounds.mean(axis=0))]
    rows += [("warning", text) for text in meta.warning_texts]
    return "\n".join(f"{name:<8} {printable(value)}" for name, value in rows)  # a name in a file may hold tabs and newlines


_NAMED = 8
"""Photographs whose names ``info`` lists."""


def _photographs_text(found: Sequence[StoredPicture]) -> str:
    without = sum(not one.placed for one in found)
    names = [f"{one.name} ({one.width} x {one.height}{'' if one.placed else ', without a pose'})" for one in found]
    more = f" and {len(found) - _NAMED} more" if len(found) > _NAMED else ""
    poses = f", {without} without a pose" if 0 < without < len(found) else ""
    used = "" if without == len(found) else f"; {len(found) - without} with a pose may colour pictures (--photos)"
    return f"{counted(len(found), 'photograph')}{poses}: {', '.join(names[:_NAMED])}{more}{used}"


def _noise_facts(scene: Scene) -> dict | None:
    """The noise for --json: standard deviation of a point's luma, 0..1, over the scan, by place and by luma."""
    if (noise := scene.noise) is None:
        return None
    return {"sigma": noise.overall, "lowest": float(noise.sigma.min()), "highest": float(noise.sigma.max()),
            "curve": [round(float(factor), 4) for factor in noise.curve], "neighbourhoods": noise.neighbourhoods}  # fmt: skip


def _noise(noise: NoiseModel | None) -> str:
    if noise is None:
        return "unknown: the folder was made by an earlier version; convert the scan again"
    if not noise.neighbourhoods:
        return "unknown: too few points lie close together to tell it"
    return (f"{noise.overall:.3f} of full brightness a point ({noise.overall:.1%}), {float(noise.sigma.min()):.3f} to "
            f"{float(noise.sigma.max()):.3f} by place, from {counted(noise.neighbourhoods, 'neighbourhood')}")  # fmt: skip


def _exposures(found: ExposureSummary) -> str:
    if not found.matched:
        return f"as scanned: {found.stations} stations, they overlap too little to compensate exposures"
    if not found.applied:
        return f"{found.stations} stations with equal exposures"
    return (
        f"{found.matched} of {found.stations} stations compensated, gains {found.smallest_gain:.2f} to "
        f"{found.largest_gain:.2f} (--exposures as-scanned keeps them)"
    )
