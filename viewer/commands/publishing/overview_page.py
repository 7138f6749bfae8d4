"""The index page of a place of several files: a plan with the outline of each, and a table of names, dates and points.

One HTML file without scripts.  The plan is an SVG; a row of the table leads to its outline, which is then highlighted.  Frame
of the plan: the upright world seen from above, file units.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ....model.common.printable import printable
from ...common.errors import InputError
from ...common.text import counted
from ...grid.scene import unpack
from ...picture.edits import Edits
from ...work.measuring.measure_text import unit_name
from ...work.places.up_axis import upright_axes
from ...work.selection import Selection
from .data_scripts import alpha_png, base64_text
from .plan_picture import plan_of

if TYPE_CHECKING:
    from ...grid.scene import Scene
    from .places import Place

_POINTS = 2_000_000
"""Points of the coarse layers that are looked at, at most."""
_SQUARES = 48
"""Squares along the longer side of a file in which its outline is drawn, at most."""
_OF_SQUARE = 6
"""Points of the sample for each square, at least: by chance exp(-6) of the squares of a surface then hold none."""
_WIDTH, _HEIGHT = 1600, 1000
"""The plan has at most this size, in its own pixels."""
_BAR = 0.2
"""Share of the width of the plan that the scale bar has at most."""
_LETTERS = 9, 22
"""Height of a name in pixels of the plan, least and most."""
_STYLE = """body{margin:0;background:#16191c;color:#dde1e4;font:14px/1.5 system-ui,sans-serif}
main{max-width:1600px;margin:auto;padding:16px}h1{font-size:20px;font-weight:600}
svg{width:100%;height:auto;background:#1f2327;border-radius:6px}
.file path{fill:#5ec8c4;fill-opacity:.05;stroke:#5ec8c4;stroke-opacity:.6;stroke-width:.7;vector-effect:non-scaling-stroke}
.name,.file text{fill:#dde1e4;pointer-events:none;text-anchor:middle;dominant-baseline:central}
.name,.file text{paint-order:stroke;stroke:#16191c;stroke-width:.2em}
.file text{display:none}.file:hover text,.file:target text{display:inline;fill:#fff}
.file:hover path,.file:target path{fill:#ffb84d;fill-opacity:.4;stroke:#ffb84d}
.place circle{fill:#ffb84d}.place:hover circle{fill:#fff}
table{border-collapse:collapse;margin-top:16px}td,th{padding:2px 18px 2px 0;text-align:left}td.n,th.n{text-align:right}
a{color:#5ec8c4}.bar{stroke:#dde1e4;stroke-width:2}.bartext{fill:#dde1e4;font-size:16px}"""


@dataclass(frozen=True)
class _File:
    """name: for a person.  changed: date of the last change, "" where it is not known.  points: of the scene.  outline: closed
    polygons (n, 2).  middle: (2,) median of its points."""

    name: str
    changed: str
    points: int
    outline: tuple[np.ndarray, ...]
    middle: np.ndarray


def overview_page(scene: "Scene", title: str, *, edits: Edits | None = None, up: Sequence[float] = (0.0, 0.0, 1.0),
                  places: "Sequence[Place]" = ()) -> str:
    """The page.  edits: of the document: what they do not draw is not on the plan.  places: of a publication beside the page,
    to which it leads.  Raises InputError where the scene does not say which points are of which file."""
    axes = upright_axes(up)
    flat, source, counts = _sample(scene, edits or Edits(), axes)
    low, high = flat[:, :2].min(axis=0), flat[:, :2].max(axis=0)
    whole = plan_of(flat, np.stack([[*low, 0.0], [*high, 0.0]]), None, 1.0)
    low, high = np.minimum(low, whole.low), np.maximum(high, whole.high)
    scale = min(_WIDTH / (high - low)[0], _HEIGHT / (high - low)[1])
    size = (high - low) * scale
    names, dates = _names(scene), _dates(scene)
    order = np.argsort(source, kind="stable")
    of_file = np.split(flat[order, :2], np.searchsorted(source[order], np.arange(1, len(names))))
    files = [_File(name, date, int(count), _outline(own, float((high - low).max())),
                   np.median(own, axis=0) if len(own) else low)
             for name, date, count, own in zip(names, dates, counts, of_file, strict=True)]

    def at(points: np.ndarray) -> np.ndarray:
        return np.stack([(points[..., 0] - low[0]) * scale, (high[1] - points[..., 1]) * scale], axis=-1)

    corner, end = at(np.array([[whole.low[0], whole.high[1]], [whole.high[0], whole.low[1]]]))
    width, height = end - corner
    drawn = [f'<image x="{corner[0]:.1f}" y="{corner[1]:.1f}" width="{width:.1f}" height="{height:.1f}" '
             f'preserveAspectRatio="none" style="filter:invert(1)" href="data:image/png;base64,'
             f'{base64_text(alpha_png(whole.alpha))}"/>']
    labels = _Labels()
    drawn += [_drawn(number, file, [at(ring) for ring in file.outline], at(file.middle), labels)
              for number, file in enumerate(files) if file.outline]
    drawn += labels.shown
    for number, place in enumerate(places, 1):
        x, y = at((place.position @ axes)[:2])
        drawn.append(f'<a class="place" href="index.html#place={number}"><circle cx="{x:.1f}" cy="{y:.1f}" r="6"/>'
                     f"<title>{_text(place.name)}</title></a>")
    drawn.append(_bar(float(high[0] - low[0]), scale, size, unit_name(scene.meta.metres_per_unit)))
    rows = "\n".join(f'<tr><td><a href="#file{number}">{_text(file.name)}</a></td><td>{file.changed}</td>'
                     f'<td class="n">{file.points:,}</td></tr>' for number, file in enumerate(files))
    walk = '<p><a href="index.html">Panoramas</a>: the dots on the plan.</p>' if places else ""
    return f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<meta name="generator" content="pointglass">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; style-src 'unsafe-inline'; img-src data:">
<title>{_text(title)}</title><style>{_STYLE}</style></head><body><main>
<h1>{_text(title)}</h1><p>{counted(len(files), "file")}, {scene.count:,} points</p>{walk}
<svg viewBox="0 0 {size[0]:.0f} {size[1]:.0f}" role="img" aria-label="plan">
{chr(10).join(drawn)}
</svg>
<table><tr><th>file</th><th>last change</th><th class="n">points</th></tr>
{rows}
</table></main></body></html>
"""


def _sample(scene: "Scene", edits: Edits, axes: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of some points in sight: (n, 3) upright positions and (n,) numbers of their files; and the points of each file."""
    records = scene.records
    if records is None:
        raise InputError("was made by an earlier version, which did not keep the file of each point",
                         remedy="convert the scan again")
    head = scene.coarse_points(_POINTS)
    some = slice(0, head, -(-head // _POINTS))
    xyz, _, _, station = unpack(scene, some)
    source, _ = records.places(records.numbers(some))
    seen = Selection.in_sight(scene, edits).keeps(xyz, station, some)
    counts = np.diff(records.first)
    return xyz[seen] @ axes, source[seen], counts


def _outline(flat: np.ndarray, extent: float) -> tuple[np.ndarray, ...]:
    """The rings around the squares that hold points (n, 2).  extent: of the whole plan, for files of no size."""
    from scipy import ndimage

    if not len(flat):
        return ()
    low = flat.min(axis=0)
    squares = min(_SQUARES, max(int(np.sqrt(len(flat) / _OF_SQUARE)), 1))
    side = max(float(np.ptp(flat, axis=0).max()) / squares, extent / 2000)
    size = np.maximum(np.ceil(np.ptp(flat, axis=0) / side - 1e-9).astype(int), 1)
    held = np.zeros(size + 4, bool)
    held[tuple(np.minimum(((flat - low) / side).astype(int), size - 1).T + 2)] = True
    held = ndimage.binary_closing(held, np.ones((3, 3)))  # squares between those with points
    return tuple(low + (ring - 2) * side for ring in _rings(np.asarray(held)))


def _rings(held: np.ndarray) -> list[np.ndarray]:
    """The closed polygons (n, 2) along the edges of the squares that are held (W, H), whose border is not."""
    follows: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for (dx, dy), start, step in (((0, -1), (0, 0), (1, 0)), ((1, 0), (1, 0), (0, 1)), ((0, 1), (1, 1), (-1, 0)),
                                  ((-1, 0), (0, 1), (0, -1))):
        edge = held & ~np.roll(held, (-dx, -dy), (0, 1))
        for x, y in np.argwhere(edge).tolist():
            begin = x + start[0], y + start[1]
            follows.setdefault(begin, []).append((begin[0] + step[0], begin[1] + step[1]))
    rings = []
    while follows:
        first = at = next(iter(follows))
        ring = [first]
        while True:
            following = follows[at]
            before, at = at, following.pop()
            if not following:
                del follows[before]
            if at == first:
                break
            ring.append(at)
        turns = [p for p, q, r in zip(ring, ring[-1:] + ring[:-1], ring[1:] + ring[:1])
                 if (p[0] - q[0], p[1] - q[1]) != (r[0] - p[0], r[1] - p[1])]
        rings.append(np.array(turns, np.float64))
    return rings


class _Labels:
    """Names on the plan, those that cover none before them.  shown: SVG, to be drawn above all outlines."""

    def __init__(self) -> None:
        self.shown: list[str] = []
        self._taken: list[tuple[np.ndarray, np.ndarray]] = []

    def add(self, name: str, middle: np.ndarray, width: float) -> str:
        """The name at ``middle``, about as wide as ``width``, as SVG without a class: for the file under the pointer."""
        letter = float(np.clip(1.4 * width / max(len(name), 1), *_LETTERS))
        reach = letter * np.array([0.3 * len(name), 0.6])
        attributes = f'x="{middle[0]:.1f}" y="{middle[1]:.1f}" font-size="{letter:.1f}"'
        if not any((np.abs(middle - other) < reach + far).all() for other, far in self._taken):
            self._taken.append((middle, reach))
            self.shown.append(f'<text class="name" {attributes}>{_text(name)}</text>')
        return f"<text {attributes}>{_text(name)}</text>"


def _drawn(number: int, file: _File, rings: list[np.ndarray], middle: np.ndarray, labels: _Labels) -> str:
    path = "".join("M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in ring) + "Z" for ring in rings)
    width = max(np.ptp(ring[:, 0]) for ring in rings)
    told = _text(", ".join(filter(None, (file.name, file.changed, f"{file.points:,} points"))))
    return (f'<g class="file" id="file{number}"><path d="{path}" fill-rule="evenodd"/><title>{told}</title>'
            f"{labels.add(file.name, middle, float(width))}</g>")


def _bar(extent: float, scale: float, size: np.ndarray, unit: str) -> str:
    """A scale bar of 1, 2 or 5 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(_BAR * extent))
    length = max(step * power for step in (1, 2, 5) if step * power <= _BAR * extent)
    y, end = size[1] - 14, 14 + length * scale
    return (f'<path class="bar" d="M14 {y:.1f}H{end:.1f}"/><text class="bartext" x="14" y="{y - 8:.1f}">'
            f"{length:g} {_text(unit)}</text>")


def _names(scene: "Scene") -> list[str]:
    return [Path(source).stem for source in scene.meta.sources]


def _dates(scene: "Scene") -> list[str]:
    """The days on which the files were changed last, "" where that is not known."""
    files = scene.meta.records.files if scene.meta.records is not None else None
    if files is None or len(files) != len(scene.meta.sources):
        return [""] * len(scene.meta.sources)
    return [datetime.fromtimestamp(changed / 1e9).strftime("%Y-%m-%d") for _, _, changed in files]


def _text(text: str) -> str:
    return escape(printable(text))
