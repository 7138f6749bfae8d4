"""What ``pointglass evaluate SCAN`` does: judges raw, filled and neural pictures of a scan by points withheld from it."""

import argparse
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from viewer.errors import InputError
from viewer.progress import progress
from viewer.text import counted

if TYPE_CHECKING:
    from torch import Tensor

    from model.evaluation.heldout import Viewpoint, Withheld

FILLED = "filled"
"""Name of what goes into a network, in tables: pull-push behind our filter, with view-dependent blending."""
SIZE = (960, 720)
"""Pixels, of the pictures that are judged."""
VIEWS = 8
"""Viewpoints, unless others are asked for."""
_NO_USE_FOR = {"perceptual": None, "exposures": "both", "outside": [], "flicker": True, "frames": 20, "precision": False,
               "paper_table": False, "split": "val", "camera": "dslr", "worst": None, "fast": False}
"""Options of rooms that a scan has no use for, as they are where nobody gives them."""


def is_scan(path: Path) -> bool:
    """Whether a path is a scan for the viewer, a file or a folder made by ``convert``, and not a folder with a room in it.

    A path that leads nowhere is taken for a file where its name has a suffix.
    """
    from viewer.grid.cache import is_grid

    return is_grid(path) if path.is_dir() else path.exists() or bool(path.suffix)


def run(options: argparse.Namespace) -> int:
    """Judges, prints a table, writes what was asked for.  Returns 0.  Raises InputError, DataError and WeightsError."""
    from model.common.signals import importing
    from model.evaluation.command import names_of
    from model.evaluation.report import check_output, save, save_picture
    from model.weights import weights_dir

    if len(options.data) > 1:
        raise InputError(f"{options.data[1]}: one scan at a time is judged by withheld points; give the others by themselves")
    if not all(0 < density <= 1 for density in options.densities) or not options.densities:
        raise InputError(f"--densities {' '.join(f'{d:g}' for d in options.densities)}: shares over 0 and at most 1 expected")
    if options.views is not None and options.views < 1:
        raise InputError(f"--views {options.views}: at least 1 expected")
    if options.json:
        check_output(options.json)
    if options.plot:
        check_output(options.plot, (".png",))
    if ignored := [f"--{name.replace('_', '-')}" for name, usual in _NO_USE_FOR.items() if getattr(options, name) != usual]:
        print(f"pointglass: a scan that is judged by withheld points has no use for {', '.join(ignored)}: left out of account",
              file=sys.stderr)
    files = options.weights or [weights_dir() / "balanced-filtered.safetensors"]
    with importing():
        from model.evaluation.heldout_report import format_withheld

    result, rows = judge_scan(options.data[0], names_of(files), densities=tuple(dict.fromkeys(options.densities)),
                              views=options.views or VIEWS, sheet=options.plot is not None)
    print(format_withheld(result))
    if options.json:
        save(result, options.json)
    if options.plot:
        save_picture(np.concatenate(rows), options.plot)
    return 0


def judge_scan(path: Path, weights: dict[str, Path], *, densities: tuple[float, ...], views: int,
               size: tuple[int, int] = SIZE, sheet: bool = False) -> tuple[dict, list[np.ndarray]]:
    """JSON-able figures of a scan, and, where a sheet is wanted, its rows (H, W, 3) uint8: filled, neural, which is nearer.

    weights: name -> file.  densities: shares of what is not withheld.
    """
    from model.evaluation.heldout import Withheld
    from model.evaluation.methods import WEIGHTED, network_method, plain_methods
    from viewer.grid.open_scene import open_scene
    from viewer.tools.heldout.judged_viewpoints import judged_viewpoints, station_viewpoints
    from viewer.tools.heldout.scan_points import points_of

    names = {"raw": "raw", WEIGHTED: FILLED}
    methods = [replace(method, name=names[method.name]) for method in plain_methods() if method.name in names]
    methods += [network_method(name, file) for name, file in weights.items()]
    scene = open_scene(path)
    scan, spacing = points_of(scene, path)
    work = Withheld(scan, spacing, methods, densities, unlit=scene.unlit, noise=scene.noise)
    viewpoints = judged_viewpoints(scene, size, views)
    stations = station_viewpoints(scan, size)
    rows = []
    with progress(len(viewpoints) + len(stations), "judging", " views") as meter:
        for viewpoint in (*viewpoints, *stations):
            row = _judged(work, viewpoint, sheet)
            if row is not None:
                rows.append(row)
            meter.update(1)
    if not work.found:
        raise InputError(f"{path}: no withheld point is visible in {counted(len(viewpoints), 'view')}; open it and see whether "
                         "its points lie where they should")
    return {"scan": path.name, "points": len(scan.xyz), "withheld": work.share, "spacing": spacing, "size": list(size),
            "views": [viewpoint.name for viewpoint in viewpoints], "stations": [viewpoint.name for viewpoint in stations],
            "seed": work.seed, "rows": work.rows()}, rows


def _judged(work: "Withheld", viewpoint: "Viewpoint", sheet: bool) -> np.ndarray | None:
    """Judges a viewpoint; its row of the sheet where one is wanted and points are visible."""
    wanted, shown = work.judge(viewpoint)
    if not sheet or not len(wanted.index):
        return None
    from model.evaluation.heldout import nearer
    from model.evaluation.labelled import labelled_row

    neural = next((name for name in shown if name.startswith("network ")), FILLED)
    pictures = [_halved(shown[FILLED]), _halved(shown[neural]), nearer(shown[FILLED], shown[neural], wanted)[::2, ::2]]
    labels = [f"{viewpoint.name}: filled", neural, "nearer to the withheld points: neural blue, filled orange"]
    return labelled_row(pictures, labels)


def _halved(picture: "Tensor") -> np.ndarray:
    """(3, H, W) in 0..1 -> (H / 2, W / 2, 3) uint8, by averaging."""
    import torch.nn.functional as F

    from model.evaluation.labelled import picture_bytes

    return picture_bytes(F.avg_pool2d(picture[None], 2, ceil_mode=True)[0])
