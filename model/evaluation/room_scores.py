"""Evaluates all methods on a scene folder in the format of ``renders/``: its views at several densities, and its camera path.

The scan is made once and projected once per view.  A density keeps the points of lowest rank; an exposure changes only their
colours.  ``scanned``: colours as recorded; ``matched``: with exposure compensation (:mod:`model.appearance.exposure`), as in
the viewer.
"""

import dataclasses
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor
from tqdm import tqdm

from ..appearance.exposure import Exposures, exposures_of
from ..appearance.noise import estimate_noise
from ..common.errors import DataError
from ..data.dataset import MergedScan, TruePicture
from ..data.stations import RoomView, load_scene, scan_stations
from ..data.surfaces.projected import Projected, project_scan, scan_spacing
from .made_with import made_with
from .methods import (
    OURS,
    TRUE,
    WEIGHTED,
    Method,
    Open3DMethod,
    ViewPoints,
    network_method,
    own_method,
    own_network_method,
    plain_methods,
    thinned,
    timings,
    true_visibility,
    view_points,
)
from .metrics.figures import Figures, Truth
from .metrics.flicker import Key, measure_flicker, middle_stretch
from .metrics.flip import ABSENT, flip_metric
from .metrics.perceptual import perceptual
from .open3d_points import Open3DError, Open3DPoints
from .outside import Outside, open_outside
from .own_methods import OwnNetwork, OwnPicture
from .rooms.view_scores import ViewScores, pick_views, view_rows
from .worse import Case, Worst

EXPOSURES = ("scanned", "matched")
"""Names of the exposures."""
FRAMES = 20
"""Default number of frames, from the middle of the path: 19 steps, of which flicker is the mean."""


def matched_colours(rgb: Tensor, station: Tensor, gains: np.ndarray) -> Tensor:
    """(M, 3) uint8 with each station's gains (S, 3) applied, exactly as in
    :func:`model.appearance.exposure.match_exposures`."""
    gain = torch.from_numpy(gains.astype(np.float32))[station.long()]
    return (rgb.float() * gain).round().clamp(0, 255).to(torch.uint8)


def truth_of(shot: TruePicture) -> Tensor:
    """The true picture (3, H, W) in 0..1."""
    return torch.from_numpy(shot.rgb().copy()).permute(2, 0, 1) / 255


class Evaluation:
    """Scan, methods and metrics of an evaluation; ``rows`` and ``flicker`` run it.

    fast: without durations and the perceptual distance of invented pixels.  worst: collects the pictures of the worst view.
    """

    def __init__(self, name: str, scan: MergedScan, methods: list[Method], *, densities: Sequence[float],
                 exposures: Sequence[str], seed: int, open3d: Open3DMethod | None, outside: list[Outside],
                 distance: torch.nn.Module | None,
                 fast: bool = False, worst: Worst | None = None):
        self.name, self.scan, self.methods, self.seed = name, scan, methods, seed
        self.densities, self.exposures = densities, exposures
        self.fast, self.worst, self.flip = fast, worst, flip_metric()
        self.open3d, self.outside, self.distance = open3d, outside, distance
        self.spacing = scan_spacing(scan)
        self.solved: Exposures | None = None
        if "matched" in exposures:
            self.solved = exposures_of(scan.xyz, scan.rgb, scan.station)
        # Estimated within stations, so that exposures change it by a few percent only.
        self.noise = estimate_noise(scan.xyz, scan.rgb, scan.station)
        self.absent: dict[str, str] = {} if self.flip else {"FLIP": ABSENT}
        self.times: dict[tuple[str, float], tuple[float, float | None]] = {}

    def exposed(self, seen: Projected, exposure: str) -> Projected:
        """The points with the colours of an exposure."""
        if exposure == "scanned":
            return seen
        assert self.solved is not None
        return dataclasses.replace(seen, rgb=matched_colours(seen.rgb, seen.station, self.solved.gains))

    def _open3d(self, view: ViewPoints, density: float) -> dict[str, Tensor]:
        """Open3D's pictures by method; empty once it has failed, with the reason in ``absent``."""
        if self.open3d is None:
            return {}
        try:
            drawn = self.open3d.pictures(view)
        except Open3DError as error:
            self.absent["Open3D"] = str(error)
            self.open3d = None
            return {}
        for name, (_, ms) in drawn.items():
            self.times.setdefault((name, density), (ms, None))
        return {name: picture for name, (picture, _) in drawn.items()}

    def rows(self, shots: Sequence[RoomView]) -> list[dict]:
        """Mean metrics over the views, of each method, density and exposure; see view_rows."""
        found = []
        with tqdm(total=len(shots), desc="views", disable=None) as meter:
            for number, shot in enumerate(shots):
                found.append(self.view(number, shot))
                meter.update(1)
        return view_rows(found)

    def view(self, number: int, shot: RoomView, *, timed: bool = True) -> ViewScores:
        """One view.  number: of the view, from which its random numbers come.  timed: durations are measured at the first."""
        self.times = {}
        scores = ViewScores({}, {}, {method.name: method.mac for method in self.methods}, self.absent, self.times)
        seen = project_scan(self.scan, shot, seed=self.seed + number)
        truth = Truth(truth_of(shot), self.distance, self.flip)
        depth = torch.from_numpy(shot.depth())
        for density in self.densities:
            left, masks = thinned(seen, density), {}
            for exposure in self.exposures:
                spacing, shown = self.spacing / density**0.5, self.exposed(left, exposure)
                view = view_points(shown, depth, spacing, masks, noise=self.noise)
                found, pictures = {}, {}
                for name, exposed, picture, mask in self._pictures(view, shot, density, exposure):
                    kept, leaked = _mask_shares(mask, view)
                    found[name] = truth.figures(picture, ~view.mask(OURS), invented_distance=not self.fast)
                    pictures[name] = picture
                    scores.figures[name, density, exposed] = (*dataclasses.astuple(found[name]), kept, leaked)
                for case in self._cases(view, truth, found, pictures, Path(shot.rgb_file).stem, density, exposure):
                    scores.cases[case.method, density, exposure] = case
                if timed and number == 0 and exposure == self.exposures[0] and not self.fast:
                    for name, spent in timings(self.methods, view).items():
                        self.times[name, density] = spent
        return scores

    def _cases(self, view: ViewPoints, truth: Truth, found: dict[str, Figures], pictures: dict[str, Tensor], shot: str,
               density: float, exposure: str) -> list[Case]:
        """Comparisons of each network's picture with the filled picture.

        The filled picture is evaluated here if it is not the picture of another method.
        """
        names = {(m.mask, m.weighted): m.name for m in self.methods if m.network is None and m.name != "raw"}
        cases = []
        for method in self.methods:
            if method.network is None or method.mask is None:
                continue
            name = names.get((method.mask, method.weighted))
            if name is None:
                name = names[method.mask, method.weighted] = f"input of {method.name}"
                pictures[name] = view.filled(method.mask, weighted=method.weighted)
                found[name] = truth.figures(pictures[name], ~view.mask(OURS), invented_distance=False)
            cases.append(Case(self.name, shot, method.name, density, exposure, found[method.name], found[name]))
            if self.worst is not None:
                self.worst.look(cases[-1], pictures[name], pictures[method.name], truth.rgb)
        return cases

    def _pictures(self, view: ViewPoints, shot: RoomView, density: float, exposure: str):
        """Yields (method, exposure, picture, mask or None); methods without exposures only for the first one."""
        for method in self.methods:
            mask = None if method.mask is None else view.mask(method.mask)
            yield method.name, exposure, method.picture(view), mask
        if exposure == self.exposures[0]:
            for name, picture in self._open3d(view, density).items():
                yield name, exposure, picture, None
            for other in self.outside:
                yield other.name, "-", other.picture(shot, density), None

    def flicker(self, frames: Sequence[RoomView]) -> list[dict]:
        """Flicker along frames, at the last exposure.  The seed is constant, so that all frames keep the same points."""
        exposure = self.exposures[-1]

        def draw(shot: TruePicture) -> dict[Key, Tensor]:
            assert isinstance(shot, RoomView)
            seen = self.exposed(project_scan(self.scan, shot, seed=self.seed), exposure)
            depth = torch.from_numpy(shot.depth())
            pictures: dict[Key, Tensor] = {}
            for density in self.densities:
                view = view_points(thinned(seen, density), depth, self.spacing / density**0.5, noise=self.noise)
                pictures |= {(method.name, density): method.picture(view) for method in self.methods}
                pictures |= {(o.name, density): o.picture(shot, density) for o in self.outside if o.path_frames}
            return pictures

        with tqdm(total=len(frames), desc="path", disable=None) as meter:
            rows = measure_flicker(frames, draw, lambda: meter.update(1))
        return [{**row, "exposure": "-" if row["method"] in {o.name for o in self.outside} else exposure} for row in rows]


def _mask_shares(mask: Tensor | None, view: ViewPoints) -> tuple[float, float]:
    """Share of the visible pixels that a mask keeps, and share of hidden pixels among those kept; NaN without a mask."""
    if mask is None:
        return float("nan"), float("nan")
    if "hidden" not in view.masks:
        assert view.true_depth is not None
        view.masks[TRUE], view.masks["hidden"] = true_visibility(view.raster.depth, view.true_depth)
    visible, hidden = view.masks[TRUE], view.masks["hidden"]
    return (float((mask & visible).sum() / visible.sum().clamp_min(1)),
            float((mask & hidden).sum() / (mask & (visible | hidden)).sum().clamp_min(1)))


@dataclass(frozen=True, eq=False)
class OpenedRoom:
    """A room that is evaluated.  shots: its views.  along: the frames of its path.  distance: name of the metric.  made: what
    the figures are made with."""

    work: Evaluation
    shots: list[RoomView]
    along: list[RoomView]
    distance: str | None
    made: dict

    def facts(self) -> dict:
        """What the result says besides rows and flicker."""
        solved = self.work.solved
        return {
            **self.made, "scene": self.work.name, "views": len(self.shots), "distance": self.distance,
            "points": len(self.work.scan.xyz), "threads": torch.get_num_threads(), "frames": len(self.along),
            "exposures": None if solved is None else {"gains": solved.gains.tolist(), "matched": solved.matched.tolist()},
        }

    def flicker(self) -> list[dict]:
        """Of the path; empty without one."""
        return self.work.flicker(self.along) if self.along else []


@contextmanager
def opened_room(
    folder: Path, *, densities: Sequence[float] = (1.0, 0.1), weights: dict[str, Path] | None = None,
    distance_path: Path | None = None, views: int | None = None, seed: int = 11, exposures: Sequence[str] = ("scanned",),
    outside: dict[str, Path] | None = None, flicker: bool = True, frames: int | None = FRAMES, open3d: bool = True,
    fast: bool = False, worst: Worst | None = None, functions: Sequence[OwnPicture] = (), networks: Sequence[OwnNetwork] = (),
) -> Iterator[OpenedRoom]:
    """A room ready to be evaluated, until the block ends.  Arguments and errors: as of :func:`evaluate`."""
    densities = tuple(dict.fromkeys(densities))
    bad = [density for density in densities if not 0 < density <= 1]
    if bad or not densities:
        raise DataError(f"density {bad[0]:g}: expected above 0 and at most 1" if bad else "no density given")
    unknown = [exposure for exposure in exposures if exposure not in EXPOSURES]
    if unknown or not exposures:
        raise DataError(f"exposures {unknown}: choose from {', '.join(EXPOSURES)}")
    if frames is not None and frames < 2:
        raise DataError(f"{frames} frames: flicker needs at least 2")
    scene = load_scene(folder)
    shots = pick_views(scene, views)
    along = middle_stretch(scene.path, frames) if flicker and not fast and len(scene.path) > 1 else []
    methods = [method for method in plain_methods() if not fast or method.name == WEIGHTED]
    methods += [network_method(name, path) for name, path in (weights or {}).items()]
    methods += [own_network_method(network) for network in networks]
    names = [*(method.name for method in methods), *(function.name for function in functions), *(outside or {})]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise DataError(f"a method of the name {twice[0]!r} is compared already", remedy="choose another name")
    others = open_outside(outside or {}, shots, along, densities)
    distance, distance_name = perceptual(distance_path)
    absent: dict[str, str] = {}
    renderer = None
    if open3d and not fast:
        try:
            renderer = Open3DPoints()
        except Open3DError as error:
            absent["Open3D"] = str(error)
    try:
        scan = scan_stations(scene, seed)
        methods += [own_method(function, scan) for function in functions]
        work = Evaluation(
            scene.name, scan, methods, densities=densities, exposures=tuple(exposures), seed=seed,
            open3d=Open3DMethod(renderer) if renderer else None, outside=others, distance=distance, fast=fast, worst=worst,
        )
        work.absent |= absent
        yield OpenedRoom(work, shots, along, distance_name, made_with(weights or {}, seed))
    finally:
        if renderer is not None:
            renderer.close()


def evaluate(folder: Path, **settings: Any) -> dict:
    """Evaluates a scene folder in the format of ``renders/``.

    settings, by name, with their defaults: of :func:`opened_room`.
    weights: name -> file.  views: number, evenly spaced (None: all).  exposures: of EXPOSURES; baselines without exposures are
    rendered at the first, flicker is measured at the last.  outside: name -> folder of PNGs.  flicker: whether to measure it,
    if the scene has a path of at least two frames; frames: number of them (None: all).  fast: only the filled picture and the
    networks, without Open3D, durations, flicker and the perceptual distance of invented pixels.  worst: collects the pictures
    of the worst view.  functions, networks: methods of your own.  Returns a dict for JSON: ``rows``, ``flicker``,
    ``exposures`` (gains), ``absent`` (method or metric -> reason), version, seed and weights.  Raises DataError and
    WeightsError before the slow part, apart from what a function of yours returns.
    """
    with opened_room(folder, **settings) as room:
        rows, moving = room.work.rows(room.shots), room.flicker()
        return {**room.facts(), "absent": room.work.absent, "rows": rows, "flicker": moving}
