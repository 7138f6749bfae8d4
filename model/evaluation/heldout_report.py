"""The figures at withheld points as text."""

from model.evaluation.report import Column, table

COLUMNS = (
    Column("withheld", "withheld", "{}"), Column("points", "density", "{:.4g}%"), Column("views", "views", "{:d}"),
    Column("PSNR", "psnr", "{:.2f}"), Column("in gaps", "psnr_gaps", "{:.2f}"), Column("gaps", "gaps", "{:.3f}"),
    Column("slope", "slope", "{:.3f}"), Column("judged", "points", "{:,}"),
)
LEVELS = (
    Column("withheld", "withheld", "{}"), Column("points", "density", "{:.4g}%"), Column("noise", "sigma", "{:.3f}"),
    Column("PSNR", "psnr", "{:.2f}"), Column("slope", "slope", "{:.3f}"),
)


def format_withheld(result: dict) -> str:
    """The table, lowest PSNR first within what is withheld and a density; figures by noise level below, where it is known."""
    rows = sorted(result["rows"], key=lambda r: (r["withheld"], -r["density"], r["psnr"]))
    lines = [
        f"{result['scan']}, {result['points']:,} points, {100 * result['withheld']:.4g} % of them withheld; "
        f"{len(result['views'])} views of {result['size'][0]}x{result['size'][1]}",
        "PSNR at withheld points that are visible; their own noise bounds it: compare pictures, not scans",
        "in gaps: the same where the picture had no point that the filter keeps; gaps: share of the points there",
        "slope: of true on shown differences of colour; 1: contrast is right, below: shown too strong, above: too weak",
    ]
    lines += table(rows, COLUMNS)
    levels = [{**row, **level} for row in rows for level in row["noise"] or ()]
    if levels:
        lines += ["", "by the noise level around the withheld points, from the quietest third of them to the noisiest"]
        lines += table(levels, LEVELS)
    return "\n".join(lines)
