"""What many distances say together: figures, a histogram, and the colours of a picture.

Distances and uncertainties: (n,) float64, file units, NaN without a counterpart.
"""

from dataclasses import dataclass

import numpy as np

QUANTILES = (0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99)
BINS = 60
"""Of a histogram between both ends of the colours."""
_LARGEST_NOISE_SHARE = 3.0
"""The colours end at this many median uncertainties at least, so that noise alone stays pale."""
_CHANGE_SHARE = 2.0
"""The colours end at this many medians of the distances that are larger than their uncertainty: such a change has half the
saturation."""
_CERTAIN, _CERTAIN_SHARE = 2.0, (0.9, 1.1)
"""Changes above so many uncertainties are no chance: the colours end at a tenth more than nine in ten of them at least."""
_STEPS = (1.0, 1.5, 2.0, 3.0, 5.0, 7.5, 10.0)
RAMP = np.array([(5, 48, 97), (33, 102, 172), (67, 147, 195), (146, 197, 222), (209, 229, 240), (240, 240, 238),
                 (253, 219, 199), (244, 165, 130), (214, 96, 77), (178, 24, 43), (103, 0, 31)], np.float64)  # fmt: skip
"""sRGB from the lowest to the highest distance: RdBu of ColorBrewer (Brewer 2003), blue for negative, its middle less white."""
FADED = 0.5
"""Uncertainty, as a share of the colours' limit, above which a distance is drawn paler: on edges and in leaves."""
NO_COUNTERPART = (96, 96, 104)
"""sRGB of points without a distance."""


@dataclass(frozen=True, eq=False)
class Statistics:
    """count: points.  known: of these with a distance.  mean, sd, rms: file units, NaN where none is known.  quantiles: as
    QUANTILES.  changed: of the known ones whose distance is larger than its uncertainty.  uncertainty: the median.
    edges: (BINS + 1,) and bins: (BINS + 2,) of the histogram, its first and last count what lies beyond.
    """

    count: int
    known: int
    mean: float
    sd: float
    rms: float
    quantiles: tuple[float, ...]
    changed: int
    uncertainty: float
    edges: np.ndarray
    bins: np.ndarray

    @property
    def median(self) -> float:
        return self.quantiles[QUANTILES.index(0.5)] + 0.0  # -0 is 0

    @property
    def limit(self) -> float:
        """Where the colours and the histogram end, to both sides."""
        return float(self.edges[-1])


def statistics_of(distance: np.ndarray, uncertainty: np.ndarray, limit: float | None = None) -> Statistics:
    """limit: where colours and histogram end; None: see :func:`colour_limit`."""
    known = np.isfinite(distance)
    some, unsure = distance[known], uncertainty[known]
    limit = colour_limit(some, unsure) if limit is None else limit
    edges = np.linspace(-limit, limit, BINS + 1)
    bins = np.histogram(some, np.concatenate([[-np.inf], edges, [np.inf]]))[0]
    if not len(some):
        nan = float("nan")
        return Statistics(len(distance), 0, nan, nan, nan, (nan,) * len(QUANTILES), 0, nan, edges, bins)
    return Statistics(len(distance), len(some), float(some.mean()), float(some.std()), float(np.sqrt((some**2).mean())),
                      tuple(np.quantile(some, QUANTILES).tolist()), int((np.abs(some) > unsure).sum()),
                      float(np.median(unsure)), edges, bins)  # fmt: skip


def change_words(found: Statistics) -> list[str]:
    """Lines for a person: what share is changed for certain, and what such a share may mean."""
    lines = []
    if found.known:
        lines.append(f"{100 * found.changed / found.known:.3g} % changed by more than their uncertainty; "
                     "of points that did not change, about 5 % do so by chance")
    if found.known < found.count:
        why = ": another place, another unit, or not aligned?" if 2 * found.known < found.count else ""
        lines.append(f"{100 - 100 * found.known / found.count:.3g} % of the points have no counterpart{why}")
    return lines


def colour_limit(distance: np.ndarray, uncertainty: np.ndarray) -> float:
    """Where the colours end: a round number above both limits of noise and of change.  (n,) known distances."""
    if not len(distance):
        return 1.0
    size = np.abs(distance)
    wanted = _LARGEST_NOISE_SHARE * float(np.median(uncertainty))
    if len(changed := size[size > uncertainty]) > (least := 0.001 * len(distance)):
        wanted = max(wanted, _CHANGE_SHARE * float(np.median(changed)))
    if len(certain := size[size > _CERTAIN * uncertainty]) > least:
        wanted = max(wanted, _CERTAIN_SHARE[1] * float(np.quantile(certain, _CERTAIN_SHARE[0])))
    if not wanted > 0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(power * next(step for step in _STEPS if step * power >= wanted * (1 - 1e-9)))


def colours_of(distance: np.ndarray, uncertainty: np.ndarray, limit: float) -> np.ndarray:
    """(n, 3) uint8 of (n,) distances; what lies beyond the limit has the colour of its end.  Distances whose uncertainty is
    above FADED of the limit are paler: they have the colour of a smaller distance, in proportion."""
    known = np.isfinite(distance)
    share = np.clip(np.where(known, distance, 0.0) / limit, -1, 1)
    share *= np.minimum(FADED * limit / np.maximum(np.where(known, uncertainty, 0.0), 1e-300), 1.0)
    at = (share + 1) / 2 * (len(RAMP) - 1)
    low = np.minimum(at.astype(np.int64), len(RAMP) - 2)
    share = (at - low)[:, None]
    rgb = np.rint(RAMP[low] * (1 - share) + RAMP[low + 1] * share).astype(np.uint8)
    rgb[~known] = NO_COUNTERPART
    return rgb
