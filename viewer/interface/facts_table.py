"""What a notebook shows of a scan that is the value of a cell: a table of facts, as HTML."""

import html
from typing import TYPE_CHECKING

import numpy as np

from ..common.text import counted

if TYPE_CHECKING:
    from ..grid.scene import Scene


def facts_table(name: str, scene: "Scene") -> str:
    """The table, every text escaped."""
    meta = scene.meta
    extent = " × ".join(f"{side:.6g}" for side in np.ptp(scene.bounds, axis=0))
    rows = [
        ("scan", name), ("points", f"{scene.count:,}"), ("extent", extent), ("spacing", f"{scene.spacing:.3g}"),
        ("unit", meta.units), ("CRS", meta.crs or "unknown"),
        ("stations", counted(len(scene.station_places), "station") if len(scene.station_places) else "not told apart"),
    ]  # fmt: skip
    cells = "".join(f"<tr><th>{name}</th><td>{html.escape(str(value))}</td></tr>" for name, value in rows)
    return f"<table>{cells}</table>"
