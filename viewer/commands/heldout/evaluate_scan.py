"""``pointglass evaluate SCAN``: evaluates raw, filled and neural pictures of a scan at points withheld from it."""

import argparse
import sys
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ....model.network.qualities import DEFAULT
from ...common.errors import InputError
from ...common.text import counted
from ...common.workers.run_tasks import run_tasks
from ...common.workers.worker_choice import Workers
from ..workers_option import workers_of

if TYPE_CHECKING:
    from ....model.data.dataset import MergedScan
    from ....model.evaluation.heldout import Viewpoint, Withheld
    from ...grid.scene import Scene
    from .sheet_background import SheetBackground

    Judge = Callable[[Viewpoint], tuple[dict, np.ndarray | None]]

FILLED = "filled"
"""Name in tables of the networks' input: pull-push with our filter and view-dependent blending."""
SIZE = (960, 720)
"""Size of the evaluated pictures, pixels: the smaller one of the paper's table."""
VIEWS = 8
"""Default number of viewpoints: the benches' named views."""
_IGNORED = {"perceptual": None, "exposures": "both", "outside": [], "flicker": True, "frames": 20, "paper_table": False,
            "split": "val", "camera": "dslr", "worst": None, "fast": False, "csv": None, "latex": None, "method": [],
            "network": []}
"""Options for rooms, which are ignored for a scan, with their defaults."""


def is_scan(path: Path) -> bool:
    """Whether a path is a scan for the viewer, that is a file, a folder made by ``convert`` or a Potree or EPT folder, and not
    the folder of a room.

    A missing path counts as a file if its name has a suffix.
    """
    from ...grid.cache import is_grid
    from ...readers.formats import entry_of

    if not path.is_dir():
        return path.exists() or bool(path.suffix)
    return is_grid(path) or entry_of(path) != path


def run(options: argparse.Namespace) -> int:
    """Evaluates the scans one after the other, prints a table of each and writes the requested files.  Returns 0.  Raises
    InputError, DataError and WeightsError.

    JSON of one scan: the result of :func:`judge_scan`; of several: ``scans``, a list of results, in the order given.
    """
    from ....model.common.files.json_file import write_json
    from ....model.evaluation.command import names_of
    from ....model.evaluation.report import check_output, save_picture
    from ....model.network.weights_folder import weights_file

    if options.plot and len(options.data) > 1:
        raise InputError(f"for one scan, but {len(options.data)} are given", option="--plot", value=options.plot,
                         remedy="omit it")
    if missing := [path for path in options.data if not path.exists()]:
        raise InputError("no such file", file=missing[0])
    if not all(0 < density <= 1 for density in options.densities) or not options.densities:
        raise InputError(f"--densities {' '.join(f'{d:g}' for d in options.densities)}: expected shares above 0 and at most 1")
    if options.views is not None and options.views < 1:
        raise InputError("expected at least 1", option="--views", value=options.views)
    if options.json:
        check_output(options.json)
    if options.plot:
        check_output(options.plot, (".png",))
    if ignored := [f"--{name.replace('_', '-')}" for name, default in _IGNORED.items() if getattr(options, name) != default]:
        print(f"pointglass: the evaluation of a scan ignores {', '.join(ignored)}", file=sys.stderr)
    files = options.weights or [weights_file(DEFAULT, filtered=True)]
    from ....model.evaluation.heldout_report import format_withheld

    results, rows = [], []
    for path in options.data:
        result, rows = judge_scan(path, names_of(files), densities=tuple(dict.fromkeys(options.densities)),
                                  views=options.views or VIEWS, size=SIZE, sheet=options.plot is not None,
                                  workers=workers_of(options))
        print(*([""] if results else []), format_withheld(result), sep="\n", flush=True)
        results.append(result)
    if options.json:
        write_json(options.json, results[0] if len(results) == 1 else {"scans": results})
    if options.plot:
        save_picture(np.concatenate(rows), options.plot)
    return 0


@dataclass(frozen=True)
class _Judging:
    """What each process opens to judge viewpoints, with the arguments of :func:`judge_scan`."""

    path: Path
    weights: dict[str, Path]
    densities: tuple[float, ...]
    sheet: bool

    @contextmanager
    def opened(self) -> "Iterator[Judge]":
        """For run_tasks."""
        from ...grid.open_scene import open_scene
        from .scan_points import points_of

        scene = open_scene(self.path)
        yield self.judge(scene, *points_of(scene, self.path))

    def judge(self, scene: "Scene", scan: "MergedScan", spacing: float) -> "Judge":
        """The function of a viewpoint: its errors, as of Withheld.found, and its row of the sheet."""
        from ....model.evaluation.heldout import Withheld
        from ....model.evaluation.methods import WEIGHTED, network_method, plain_methods
        from .sheet_background import SheetBackground

        names = {"raw": "raw", WEIGHTED: FILLED}
        methods = [replace(method, name=names[method.name]) for method in plain_methods() if method.name in names]
        methods += [network_method(name, file) for name, file in self.weights.items()]
        work = Withheld(scan, spacing, methods, self.densities, unlit=scene.unlit, noise=scene.noise)
        background = SheetBackground(scene) if self.sheet else None

        def judge(viewpoint: "Viewpoint") -> tuple[dict, np.ndarray | None]:
            work.found = {}
            row = _judged(work, viewpoint, background)
            return work.found, row

        return judge


def judge_scan(path: Path, weights: dict[str, Path], *, densities: tuple[float, ...], views: int, size: tuple[int, int],
               sheet: bool = False, workers: Workers | None = None) -> tuple[dict, list[np.ndarray]]:  # fmt: skip
    """Metrics of a scan, for JSON, and the rows of the sheet, (H, W, 3) uint8 each.

    weights: name -> file.  densities: shares of the points that are not withheld.  sheet: whether to make rows, each with the
    filled picture, the neural one, and a map of which is closer to the withheld points.  workers: who judges the views; None:
    this process.  Raises InputError if no withheld point is visible.
    """
    from ....model.evaluation.heldout import Withheld
    from ....model.evaluation.made_with import made_with
    from ...grid.open_scene import open_scene
    from .judged_viewpoints import judged_viewpoints, station_viewpoints
    from .scan_points import points_of

    scene = open_scene(path)
    scan, spacing = points_of(scene, path)
    viewpoints = judged_viewpoints(scene, size, views)
    stations = station_viewpoints(scan, size)
    work = Withheld(scan, spacing, [], densities)
    rows = []
    judging = _Judging(path, weights, densities, sheet)
    given = judging.judge(scene, scan, spacing) if workers is None else judging
    with closing(run_tasks(given, [*viewpoints, *stations], workers, label="evaluating",
                           unit=" views", name=lambda viewpoint: viewpoint.name)) as judged:  # fmt: skip
        for found, row in judged:
            for key, errors in found.items():
                work.found.setdefault(key, []).extend(errors)
            if row is not None:
                rows.append(row)
    if not work.found:
        raise InputError(f"no withheld point is visible in {counted(len(viewpoints), 'view')}", file=path,
                         remedy="open it and check the positions of its points")
    return {"scan": path.name, "points": len(scan.xyz), "withheld": work.share, "spacing": spacing, "size": list(size),
            "views": [viewpoint.name for viewpoint in viewpoints], "stations": [viewpoint.name for viewpoint in stations],
            **made_with(weights, work.seed), "rows": work.rows()}, rows


def _judged(work: "Withheld", viewpoint: "Viewpoint", background: "SheetBackground | None") -> np.ndarray | None:
    """Evaluates a viewpoint.  Returns its row of the sheet; None without one (background: None) or visible withheld points."""
    found = work.judge(viewpoint)
    wanted, shown = found.wanted, found.pictures
    if background is None or not len(wanted.index):
        return None
    from ....model.evaluation.heldout import nearer
    from ....model.evaluation.labelled import labelled_row

    neural = next((name for name in shown if name.startswith("network ")), FILLED)
    opacity = background.opacity(viewpoint.picture, found.measured)
    seen = [_halved(background.behind(shown[name], opacity)) for name in (FILLED, neural)]
    pictures = [*seen, nearer(shown[FILLED], shown[neural], wanted)[::2, ::2]]
    labels = [f"{viewpoint.name}: filled", neural, "closer to the withheld points: neural blue, filled orange"]
    return labelled_row(pictures, labels)


def _halved(picture: np.ndarray) -> np.ndarray:
    """(H, W, 3) uint8 -> (H / 2, W / 2, 3) uint8, by averaging."""
    import torch
    import torch.nn.functional as F

    from ....model.evaluation.labelled import picture_bytes

    planes = torch.from_numpy(picture).permute(2, 0, 1)[None] / 255
    return picture_bytes(F.avg_pool2d(planes, 2, ceil_mode=True)[0])
