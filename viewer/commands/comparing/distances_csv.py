"""``distances.csv``: what was compared and how, statistics, and a histogram, one figure a row.

Columns: table (comparison, statistic or histogram), name, from, to, value, unit.  ``from`` and ``to`` are those of a bin.
"""

import csv
import io
import os
from pathlib import Path

from ...common.text import table_bytes
from ...work.comparing.compare import Distances
from ...work.comparing.distance_statistics import QUANTILES, Statistics
from ...work.comparing.facing import TEXTS
from .read_cloud import Cloud

NAME = "distances.csv"
Row = tuple[str, str, object, object, object, str]


def write_csv(path: Path, before: Cloud, after: Cloud, distances: Distances, found: Statistics, unit: str) -> None:
    """unit: of both scans, a name."""
    out = io.StringIO()
    writer = csv.writer(out)
    writer.writerow(("table", "name", "from", "to", "value", "unit"))
    writer.writerows(tuple(_text(value) for value in row) for row in rows_of(before, after, distances, found, unit))
    path.write_bytes(table_bytes(out.getvalue()))


def rows_of(before: Cloud, after: Cloud, distances: Distances, found: Statistics, unit: str) -> list[Row]:
    """The rows below the head."""
    sizes = distances.sizes
    facts: list[tuple[str, object, str]] = [
        *zip(("before", "after"), names_apart(before.path, after.path), ("", "")), ("method", distances.method, ""),
        ("positive", TEXTS[distances.rule], ""), ("points before", len(before.xyz), ""), ("points after", len(after.xyz), ""),
        ("spacing before", distances.before.spacing, unit), ("spacing after", distances.after.spacing, unit),
        ("noise before (standard deviation)", distances.before.noise, unit),
        ("noise after (standard deviation)", distances.after.noise, unit), ("search depth", sizes.depth, unit),
        *([("core points", distances.cores, ""), ("normal scale D", sizes.scale, unit), ("cylinder diameter d", sizes.diameter,
          unit)] if distances.method == "m3c2" else []),
        *([("plane radius", sizes.radius, unit)] if distances.method == "c2c" else []),
        ("registration uncertainty (95 %)", distances.registration, unit),
    ]  # fmt: skip
    share = found.known / found.count if found.count else float("nan")
    figures: list[tuple[str, object, str]] = [
        ("points", found.count, ""), ("points with a distance", found.known, ""), ("share without counterpart", 1 - share, ""),
        ("mean", found.mean, unit), ("median", found.median, unit), ("standard deviation", found.sd, unit),
        ("root mean square", found.rms, unit),
        *((f"quantile {100 * quantile:g} %", value, unit) for quantile, value in zip(QUANTILES, found.quantiles, strict=True)),
        ("median uncertainty (95 %)", found.uncertainty, unit),
        ("points changed by more than the uncertainty", found.changed, ""),
        ("share of these", found.changed / found.known if found.known else float("nan"), ""),
    ]  # fmt: skip
    edges = ["", *found.edges.tolist(), ""]
    return [*(("comparison", name, "", "", value, of) for name, value, of in facts),
            *(("statistic", name, "", "", value, of) for name, value, of in figures),
            *(("histogram", "points", low, high, int(count), unit)
              for low, high, count in zip(edges[:-1], edges[1:], found.bins.tolist(), strict=True))]  # fmt: skip


def names_apart(one: Path, other: Path) -> tuple[str, str]:
    """The names of two files, with as many of their folders as tell them apart, with ``/``: a table that is handed on names no
    folder of the machine it was made on."""
    parts, others = (Path(os.path.abspath(path)).parts for path in (one, other))
    count = next((n for n in range(1, max(len(parts), len(others))) if parts[-n:] != others[-n:]), 1)
    return "/".join(parts[-count:]), "/".join(others[-count:])


def _text(value: object) -> object:
    return f"{value:.9g}" if isinstance(value, float) else value
