"""What single views give in an evaluation of a room, and the means over all views, in their order."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...common.errors import DataError
from ...data.stations import RoomView, StationScene
from ..metrics.figures import Figures
from ..metrics.image_metrics import WINDOW
from ..worse import Case, summary

Score = tuple[str, float, str]
"""Method, density and exposure of a figure."""


@dataclass(frozen=True)
class ViewScores:
    """What one view gives.  figures: those of Figures, and the shares of mask_shares.  cases: comparisons of the networks with
    their inputs.
    mac: of each method.  absent: methods and metrics left out, with
    the reasons.  times: milliseconds by method and density, of all and of the network alone."""

    figures: dict[Score, tuple[float, ...]]
    cases: dict[Score, Case]
    mac: dict[str, float]
    absent: dict[str, str]
    times: dict[tuple[str, float], tuple[float, float | None]]


def view_rows(views: Sequence[ViewScores]) -> list[dict]:
    """Mean metrics over the views, in their order, of each method, density and exposure.

    ``against_filled`` of a network's row is the :func:`model.evaluation.worse.summary` of its comparison with the filled
    pictures; None in other rows.
    """
    figures: dict[Score, list[tuple[float, ...]]] = {}
    cases: dict[Score, list[Case]] = {}
    times: dict[tuple[str, float], tuple[float, float | None]] = {}
    for view in views:
        for key, values in view.figures.items():
            figures.setdefault(key, []).append(values)
        for key, case in view.cases.items():
            cases.setdefault(key, []).append(case)
        times = view.times | times  # those of the first
    fields = [*(field.name for field in dataclasses.fields(Figures)), "kept", "leaked"]
    rows = []
    for (name, density, exposed), values in figures.items():
        if len(values) < len(views):  # Open3D failed after some views
            continue
        ms, network_ms = times.get((name, density), (None, None))
        means = dict(zip(fields, column_means(np.array(values)), strict=True))
        against = cases.get((name, density, exposed))
        rows.append({"method": name, "density": density, "exposure": exposed, **means, "ms": ms, "network_ms": network_ms,
                     "mac": views[0].mac.get(name), "against_filled": summary(against) if against else None})
    return rows


def pick_views(scene: StationScene, count: int | None) -> list[RoomView]:
    """``count`` evenly spaced views; None: all.  Raises DataError without views, or if one is smaller than SSIM's window."""
    if count is not None and count < 1:
        raise DataError(f"{count} views: at least 1 is required")
    total = len(scene.views)
    picked = range(total) if count is None else np.unique(np.linspace(0, total - 1, min(count, total)).astype(int))
    shots = [scene.views[int(i)] for i in picked]
    if not shots:
        raise DataError(f"scene {scene.name}: it has no views")
    small = [shot.rgb_file for shot in shots if min(shot.width, shot.height) < WINDOW]
    if small:
        raise DataError(f"scene {scene.name}: views smaller than {WINDOW} pixels cannot be evaluated: {', '.join(small[:10])}")
    return shots


def column_means(values: np.ndarray) -> list[float]:
    """Column means over views without NaN (no invented pixels, no distance); NaN for a column of NaN."""
    known = ~np.isnan(values)
    count = known.sum(0)
    return np.where(count > 0, np.where(known, values, 0.0).sum(0) / np.maximum(count, 1), np.nan).tolist()
