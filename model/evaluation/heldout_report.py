"""The metrics at withheld points as text."""

from .report import Column, table

COLUMNS = (
    Column("withheld", "withheld", "{}"), Column("points", "density", "{:.4g}%"), Column("views", "views", "{:d}"),
    Column("PSNR", "psnr", "{:.2f}"), Column("in gaps", "psnr_gaps", "{:.2f}"), Column("gaps", "gaps", "{:.3f}"),
    Column("slope", "slope", "{:.3f}"), Column("compared", "points", "{:,}"),
)
"""Columns of the table."""
LEVELS = (
    Column("withheld", "withheld", "{}"), Column("points", "density", "{:.4g}%"), Column("noise", "sigma", "{:.3f}"),
    Column("PSNR", "psnr", "{:.2f}"), Column("slope", "slope", "{:.3f}"),
)
"""Columns of the table by noise level."""


def format_withheld(result: dict) -> str:
    """The table, and below it the metrics by noise level, if the noise is known.

    Rows are ordered by the withheld points, then density, then PSNR, the lowest first.
    """
    rows = sorted(result["rows"], key=lambda r: (r["withheld"], -r["density"], r["psnr"]))
    lines = [
        f"{result['scan']}, {result['points']:,} points, {100 * result['withheld']:.4g} % of them withheld; "
        f"{len(result['views'])} views of {result['size'][0]}x{result['size'][1]}",
        "PSNR at visible withheld points; their noise limits it: compare pictures, not scans",
        "in gaps: the same at pixels without a point that the filter keeps; gaps: share of the withheld points there",
        "slope: regression of true on shown local contrast; 1: correct, below 1: shown too strong, above 1: too weak",
    ]
    lines += table(rows, COLUMNS)
    levels = [{**row, **level} for row in rows for level in row["noise"] or ()]
    if levels:
        lines += ["", "by the noise level around the withheld points, in thirds, the lowest noise first"]
        lines += table(levels, LEVELS)
    return "\n".join(lines)
