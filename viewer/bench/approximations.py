"""Table of the approximations of ``bench error``, and the renderer for them.

Exact: all points, 16-bit positions, the default filter levels, full resolution, the network in fp32.  Most approximations are
settings.  The others are a scene with coarser positions, a renderer with a given depth tolerance or network, and a network that
also runs on the background.
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ...model.reference.soft_z import SOFT_RELATIVE, SoftZ
from ..picture.settings import Settings
from ..render.renderer import Renderer

if TYPE_CHECKING:
    from ...model.network.reconstruct import Reconstructor
    from ..grid.scene import Scene
    from ..render.network.neural import NeuralStage

EXACT = Settings(view="filled", precision="fp32")
"""Settings of the exact frame."""
TOLERANCES = (1 / 512, 1 / 256, 1 / 64, 1 / 32)
"""Tolerances of the soft z-buffer relative to depth, around SOFT_RELATIVE of the exact frame."""


@dataclass(frozen=True)
class Approximation:
    """One row of the table.

    view: the picture that is compared.  settings: of the approximate frame.  scale: of the picture's sides; the result is
    enlarged for the comparison.  bits: of a packed coordinate.  soft: tolerance of the soft z-buffer, relative to depth.
    whole: whether the network runs on the background too.  against: quality of the exact frame's network.
    """

    group: str
    name: str
    view: str = "filled"
    settings: Settings = EXACT
    scale: float = 1.0
    bits: int = 16
    soft: float | None = None
    whole: bool = False
    against: str = EXACT.quality


def approximations(qualities: list[str], precisions: list[str], weighted: bool = False) -> list[Approximation]:
    """The table.

    qualities: of the networks with weights, first that of the exact frame.  precisions: those of this machine.
    weighted: whether the scan has scanner positions, and with them view-dependent blending.
    """
    first = qualities[0]
    network = replace(EXACT, view="neural", quality=first)
    table = [
        *(Approximation("level of detail", f"{p:g} points a pixel", settings=replace(EXACT, lod=p)) for p in (0.5, 1, 2, 4, 8)),
        *(Approximation("packing", f"{bits} bits", bits=bits) for bits in range(10, 16)),
        *(Approximation("filter", f"{n} levels", settings=replace(EXACT, filter_levels=n)) for n in (1, 2, 3, 4, 6, 8)),
        *(Approximation("filter", name, settings=replace(EXACT, filter=name)) for name in ("paper-code", "npbg++", "off")),
        *(Approximation("soft depth", f"1/{1 / r:.0f} of depth", soft=r) for r in TOLERANCES if r != SOFT_RELATIVE),
        *(Approximation("soft depth", name, settings=replace(EXACT, soft_z=name)) for name in ("paper-code", "paper-text")),
        *([Approximation("stations", "all points alike", settings=replace(EXACT, stations="equal"))] if weighted else []),
        *(Approximation("internal resolution", f"{s:.0%} of each side", view="neural", settings=network, scale=s)
          for s in (0.75, 0.5)),
        *(Approximation("precision", p, view="neural", settings=replace(network, precision=p)) for p in precisions),
        *(Approximation("network", q, view="neural", settings=replace(network, quality=q)) for q in qualities[1:]),
        Approximation("network", "none: filled", view="neural", settings=replace(EXACT, view="filled")),
        Approximation("background", "computed by the network, too", view="neural", settings=network, whole=True),
    ]
    return [replace(row, against=first) for row in table]


class Whole:
    """A network that also runs on the background, which it normally leaves out."""

    def __init__(self, network: "Reconstructor"):
        self.network = network

    def __getattr__(self, name: str):
        return getattr(self.network, name)

    def __call__(self, packed):
        import torch

        with torch.inference_mode():
            return self.network.made(packed)


class BenchRenderer(Renderer):
    """A renderer with two additional parameters.

    soft: tolerance of the soft z-buffer relative to depth; None: that of the settings.  network: on the CPU; None: that of the
    settings.
    """

    soft: float | None = None
    network: "Reconstructor | Whole | None" = None

    def _soft_z(self, settings: Settings) -> SoftZ:
        preset = super()._soft_z(settings)
        return preset if self.soft is None else replace(preset, relative=self.soft)

    def _neural_for(self, settings: Settings, *, background: bool) -> "NeuralStage":
        from ..render.network.neural import load_network

        stage = super()._neural_for(settings, background=background)
        quality, filtered, weights, precision, _ = stage.key
        stage.network = self.network or load_network(quality, filtered, weights, precision, stage.device)  # type: ignore[assignment]
        return stage


def coarser(scene: "Scene", bits: int) -> "Scene":
    """The scene with each packed coordinate reduced to ``bits`` bits, at the middle of the larger step."""
    if bits == 16:
        return scene
    drop = 16 - bits
    low, middle = (1 << drop) - 1, 1 << (drop - 1)
    points = np.array(scene.points)
    both = ~np.uint32(low | low << 16)
    points[:, 0] = points[:, 0] & both | np.uint32(middle | middle << 16)
    points[:, 1] = points[:, 1] & ~np.uint32(low) | np.uint32(middle)
    return replace(scene, points=points)
