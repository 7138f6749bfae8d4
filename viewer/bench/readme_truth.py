"""The README's and the model card's tables of pictures judged against truth, from what ``evaluate`` left."""

from typing import Any


def _judged(rows: list[dict[str, Any]]) -> list[str]:
    lines = ["| picture | points | PSNR | SSIM | distance |", "|---|---|---|---|---|"]
    for row in sorted(rows, key=lambda r: (-r["density"], r["psnr"] or 0)):
        method = row["method"]
        name = f"**neural**, {method.removeprefix('network ')}" if method.startswith("network ") else method
        lines.append(f"| {name} | {row['density']:.0%} | {row['psnr']:.2f} | {row['ssim']:.3f} | {row['distance']:.3f} |")
    return lines


def truth(files: dict[str, dict]) -> str:
    """Pictures against registered truth."""
    found = files["evaluate"]
    by_exposure = {kind: [row for row in found["rows"] if row["exposure"] == kind] for kind in ("matched", "scanned")}
    lines = [f"{found['scene']}, {found['views']} views, {found['points'] / 1e6:.1f} M points; distance: "
             f"{found['distance']}.", "", *_judged(by_exposure["matched"])]
    if by_exposure["scanned"]:
        lines += ["", "<details><summary>the same with exposures as scanned</summary>", ""]
        lines += [*_judged(by_exposure["scanned"]), "", "</details>"]
    if found["flicker"]:
        lines += ["", f"Along {found['frames']} frames of a slow move, against the truth's own change and gradient energy:", "",
                  "| picture | points | change | gradient energy |", "|---|---|---|---|"]
        lines += [f"| {row['method'].removeprefix('network ')} | {row['density']:.0%} | {row['flicker']:.2f} | "
                  f"{row['gradient']:.2f} |" for row in found["flicker"]
                  if row["method"].startswith("network") or row["method"].startswith("pull-push, our filter")]
    return "\n".join(lines)


def precision(files: dict[str, dict]) -> str:
    """Half precision against fp32."""
    lines = ["| weights | numbers | unit | largest | 99.9th percentile | PSNR | NaN |", "|---|---|---|---|---|---|---|"]
    units = {1e-3: "kilometre", 1.0: "metre", 1e3: "millimetre"}
    for row in files["evaluate"].get("precision") or []:
        unit = units.get(row["scale"], row["scale"])
        lines.append(f"| {row['method']} | {row['precision']} | {unit} | {row['largest']:.4f} | {row['percentile']:.4f} | "
                     f"{row['psnr']:.2f} | {row['nan']} |")
    return "\n".join(lines)
