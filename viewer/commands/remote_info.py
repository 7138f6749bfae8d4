"""What the header of a LAS, LAZ or COPC file at an address says, the XML of an E57, or the hierarchy of a Potree or EPT octree
there, for ``pointglass info``: under a hundredth of a large scan is read.  What only the points tell (their spacing,
noise, classes) is unknown until the scan is there."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..common.text import place_text, printable
from ..readers.e57.e57_stated import stated_bounds
from ..readers.las.las_source import LasSource
from ..readers.remote.address import address_in
from ..work.measuring.measure_text import unit_name


def stated_facts_of(paths: Sequence[Path]) -> dict[str, Any] | None:
    """Facts about one file at an address, with the keys of viewer.commands.info.facts (None: unknown) and ``read``, the share
    of the file that was read; None where the points have to be read: of files here, of several, of other formats.

    Raises InputError, one line, where the file cannot be had or is damaged.
    """
    address = address_in(paths[0]) if len(paths) == 1 else None
    if address is None:
        return None
    from ..readers.formats import check_address, open_source
    from ..readers.remote.fetch import described
    from ..readers.remote.octree_fetch import described_octree, octree_at

    check_address(paths[0])
    found = None
    if (octree := octree_at(address)) is not None:
        root, parts = described_octree(octree)
        if parts.bounds is None:
            return None
        source = open_source(root)
        count, bounds, address = int(parts.points.sum()), parts.bounds, octree
        share = float(parts.points[parts.levels == parts.levels.min()].sum()) / count
    elif (found := described(address)) is not None:
        path, share = found
        source = open_source(path)
        count = source.count
        bounds = source.stated_bounds() if isinstance(source, LasSource) else stated_bounds(path)
    else:
        return None
    low, high = (None, None) if bounds is None else bounds.tolist()
    return {
        "sources": [address.text],
        "format": source.format,
        "points": count,
        "bounds": {"min": low, "max": high},
        "size": [b - a for a, b in zip(low, high, strict=True)] if low and high else None,
        "spacing": None,
        "units": source.units,
        "metres_per_unit": source.metres_per_unit,
        "crs": source.crs,
        "noise": None,
        "scans": [{"name": scan.name, "count": None, "position": scan.position} for scan in source.scans if found is not None],
        "warnings": source.warnings,
        "read": share,
    }


def stated_text(facts: dict[str, Any]) -> str:
    """The facts as lines for a terminal."""
    ends, metres = facts["bounds"], facts["metres_per_unit"]
    size = facts["size"] and " x ".join(f"{side:.4g}" for side in facts["size"]) + f" {unit_name(metres)}"
    rows = [
        ("file", facts["sources"][0]),
        ("format", facts["format"]),
        ("points", f"{facts['points']:,}"),
        ("from", _vector(ends["min"])),
        ("to", _vector(ends["max"])),
        ("size", size or "known once it is opened"),
        ("units", f"{facts['units']} ({f'1 unit = {metres:.10g} m' if metres else 'length not given by the file'})"),
        ("CRS", facts["crs"] or "not given"),
        *(("scan", f"{scan['name']}: {f'scanner at {_vector(place)}' if (place := scan['position']) else 'no pose'}")
          for scan in facts["scans"]),
        *(("warning", text) for text in facts["warnings"]),
        ("read", f"{100 * facts['read']:.2g} % of the file; its spacing, noise and classes are known once it is opened"),
    ]
    return "\n".join(f"{name:<8} {printable(text)}" for name, text in rows)


def _vector(values: Sequence[float] | None) -> str:
    return place_text(values) if values else "known once it is opened"
