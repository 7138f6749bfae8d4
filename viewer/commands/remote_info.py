"""What the header of a LAS, LAZ or COPC file at an address says, or the hierarchy of a Potree or EPT octree there, for
``pointglass info``: under a hundredth of a large scan is read.  What only the points tell (their spacing, noise, classes) is
unknown until the scan is there."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

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
    if (octree := octree_at(address)) is not None:
        root, parts = described_octree(octree)
        if parts.bounds is None:
            return None
        source = open_source(root)
        count, bounds, address = int(parts.points.sum()), parts.bounds, octree
        share = float(parts.points[parts.levels == parts.levels.min()].sum()) / count
    elif (found := described(address)) is not None:
        source = LasSource(found[0])
        share, count, bounds = found[1], source.count, source.stated_bounds()
    else:
        return None
    low, high = bounds.tolist()
    return {
        "sources": [address.text],
        "format": source.format,
        "points": count,
        "bounds": {"min": low, "max": high},
        "size": [b - a for a, b in zip(low, high, strict=True)],
        "spacing": None,
        "units": source.units,
        "metres_per_unit": source.metres_per_unit,
        "crs": source.crs,
        "noise": None,
        "scans": [],
        "warnings": source.warnings,
        "read": share,
    }


def stated_text(facts: dict[str, Any]) -> str:
    """The facts as lines for a terminal."""
    corner = ["(" + ", ".join(f"{value:.12g}" for value in facts["bounds"][end]) + ")" for end in ("min", "max")]
    metres = facts["metres_per_unit"]
    rows = [
        ("file", facts["sources"][0]),
        ("format", facts["format"]),
        ("points", f"{facts['points']:,}"),
        ("from", corner[0]),
        ("to", corner[1]),
        ("size", " x ".join(f"{side:.4g}" for side in facts["size"]) + f" {unit_name(metres)}"),
        ("units", f"{facts['units']} ({f'1 unit = {metres:.10g} m' if metres else 'length not given by the file'})"),
        ("CRS", facts["crs"] or "not given"),
        *(("warning", text) for text in facts["warnings"]),
        ("read", f"{100 * facts['read']:.2g} % of the file; its spacing, noise and classes are known once it is opened"),
    ]
    return "\n".join(f"{name:<8} {text}" for name, text in rows)
