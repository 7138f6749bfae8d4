"""The description of a place from those of its grids: files, scans, warnings, colours, attributes."""

from collections import Counter
from collections.abc import Sequence

import numpy as np

from ...preprocess.point_attributes import AttributeLayout, common_ends
from ...preprocess.scan_description import (
    ColourSummary,
    DroppedPoints,
    ExposureSummary,
    RecordOrigin,
    RunSummary,
    ScanDescription,
    ScanWarning,
)
from ...preprocess.scan_table import MOST_NUMBERS
from ...readers.source import AS_STORED
from ..building.cluster_check import place_warnings
from ..differences import differences
from ..records.point_records import IN_MEMORY
from ..scene import Scene

_SHADES = ("rgb", "intensity", "height")


def joined_facts(scenes: Sequence[Scene]) -> tuple[ScanDescription, list[int]]:
    """The description, and the number that the first scan of each grid has among all."""
    metas = [scene.meta for scene in scenes]
    scans = tuple(scan for meta in metas for scan in meta.scans)
    first = np.cumsum([0, *(len(meta.scans) for meta in metas)]).tolist()[:-1]
    names = [meta.title for meta in metas]
    warnings = [warning for meta in metas for warning in meta.warnings]
    warnings += [*differences([(meta.metres_per_unit, meta.crs) for meta in metas]),
                 *place_warnings({k: (scene.bounds[0], scene.bounds[1]) for k, scene in enumerate(scenes)}, names)]
    if len(scans) > MOST_NUMBERS:
        warnings.append(ScanWarning(f"{len(scans)} scans: the picture colours those from the {MOST_NUMBERS}th on as one, and "
                                    "hides them by file; picking, export and Python tell all apart"))  # fmt: skip
    return ScanDescription(
        sources=tuple(source for meta in metas for source in meta.sources),
        format=", ".join(dict.fromkeys(meta.format for meta in metas if meta.format)) or None,
        units=_common([meta.units for meta in metas], "mixed"),
        metres_per_unit=_common([meta.metres_per_unit for meta in metas], None),
        crs=_common([meta.crs for meta in metas], "mixed"),
        match=_common([meta.match for meta in metas], None),
        warnings=tuple(dict.fromkeys(warnings)),
        records=_origin(scenes),
        colour=_colour(metas, [scene.count for scene in scenes]),
        exposures=_exposures(metas), passes=_passes(metas),
        attributes=joined_layout([meta.attributes for meta in metas]),
        dropped=DroppedPoints(*(sum(getattr(meta.dropped, name) for meta in metas) for name in ("nan", "invalid", "stray"))),
        scans=scans,
    ), first  # fmt: skip


def _origin(scenes: Sequence[Scene]) -> RecordOrigin:
    known = [scene.meta.records or RecordOrigin() for scene in scenes]
    first, scan_first, scans, turns, moves = [0], [], [], {}, []
    for scene, origin in zip(scenes, known):
        records = scene.records
        assert records is not None
        base, sources = first[-1], len(records.first) - 1
        turns |= {len(first) - 1 + source: tuple(at + base for at in where) for source, where in origin.turns.items()}
        scan_first.append(None if records.scans is None else (records.scans + base).tolist())
        first += (records.first[1:] + base).tolist()
        scans += origin.scans
        moves += [origin.move_of(source) for source in range(sources)]
    files = [(IN_MEMORY,) * (len(scene.records.first) - 1) if scene.live and scene.records else origin.files
             for scene, origin in zip(scenes, known)]
    columns = next((origin.columns for origin in known if origin.columns), None)
    return RecordOrigin(
        tuple(first), None if None in scan_first else tuple(at for starts in scan_first for at in starts), tuple(scans), turns,
        None if None in files else tuple(file for some in files for file in some or ()), columns,
        tuple(moves) if any(moves) else (),
    )  # fmt: skip


def _colour(metas: Sequence[ScanDescription], counts: Sequence[int]) -> ColourSummary | None:
    known = [(meta.colour, count) for meta, count in zip(metas, counts) if meta.colour is not None]
    if not known:
        return None
    kinds = {colour.source for colour, _ in known}
    source = next((kind for kind in _SHADES if kind in kinds), "height")
    first = next(colour for colour, _ in known if colour.source == source)
    others = " and ".join(sorted(kinds - {source}))
    note = f"{first.note}; parts without colour shown by {others}" if others else first.note
    lost = sum((colour.uncoloured or 0.0) * count for colour, count in known) / max(sum(count for _, count in known), 1)
    return ColourSummary(source, max(colour.bits for colour, _ in known), note, lost)


def _exposures(metas: Sequence[ScanDescription]) -> ExposureSummary | None:
    found = [meta.exposures for meta in metas if meta.exposures is not None]
    if not found:
        return None
    return ExposureSummary(
        sum(one.stations for one in found), sum(one.matched for one in found), any(one.applied for one in found),
        min(one.smallest_gain for one in found), max(one.largest_gain for one in found),
    )  # fmt: skip


def _passes(metas: Sequence[ScanDescription]) -> RunSummary | None:
    found = [meta.passes for meta in metas if meta.passes is not None]
    if not found:
        return None
    return RunSummary(float(np.mean([one.variance_left for one in found])), any(one.applied for one in found))


def joined_layout(layouts: Sequence[AttributeLayout]) -> AttributeLayout:
    """One layout for the attribute bits of all grids."""
    classes: Counter[int] = Counter()
    for layout in layouts:
        classes.update(layout.classes)
    known = [layout for layout in layouts if layout.low is not None]
    ordered = {code: classes[code] for code in sorted(classes)}
    if not known:
        return AttributeLayout(ordered)
    ends = {layout.ends for layout in known}
    shared = None if None in ends else common_ends([of_grid for of_grid in ends if of_grid is not None] or [AS_STORED])
    return AttributeLayout(ordered, min(layout.low or 0 for layout in known), max(layout.high or 0 for layout in known), shared)


def attribute_tables(layouts: Sequence[AttributeLayout]) -> list[np.ndarray | None]:
    """For each grid (65536,) uint32: the bits in the joined layout by the bits that the grid stores; None where they agree."""
    whole, tables = joined_layout(layouts), []
    stored = np.arange(65536, dtype=np.uint16)
    for layout in layouts:
        same = not whole.has_classes and not layout.has_classes
        same |= whole.has_classes and layout.has_classes and (layout.low, layout.high) == (whole.low, whole.high)
        if same:
            tables.append(None)
            continue
        classes = layout.class_of(stored) if layout.has_classes else np.zeros(len(stored), np.uint8)
        intensity = layout.intensity_of(stored) if layout.low is not None else None
        changed = whole.pack(classes if whole.has_classes else None, intensity, len(stored))
        tables.append(changed.astype(np.uint32))
    return tables


def _common(values: list, otherwise):
    return values[0] if len(set(values)) == 1 else otherwise

