"""The compared pipelines: the paper's as published, and Open3D.  Each returns the time of a frame for a camera.

The paper's pipeline is optimised where possible.  All points are drawn each frame, as published, but with our compute
rasteriser.  Its network runs with folded batch normalisation and channels last: on CUDA in fp16 as a CUDA graph, on a CPU in
the fastest precision measured.  Its weights are random, which does not affect the run time.
"""

import time
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...model.evaluation.open3d_points import POINT_SIZES, Open3DError, Open3DPoints
from ..picture.settings import Settings
from .matrix_rate import synchronise

if TYPE_CHECKING:
    import moderngl
    import torch

    from ..grid.scene import Scene
    from ..picture.camera import Camera
    from ..render.culling.cull import Culler, DrawList

COUNTED = ("raster", "filter", "network")
"""Stages in the total of the paper's pipeline."""
LEFT_OUT = ("draw list", "hand over")
"""Stages outside the total, which only connect the parts of this implementation."""
_LEAST_RANGE = 1e-9
"""Least range of depth, file units, against division by 0."""


def paper_input(colour: "torch.Tensor", depth: "torch.Tensor", mask: "torch.Tensor") -> "torch.Tensor":
    """Input of the published network: RGB 0..1, keep-mask, and depth normalised by the range of the frame, -1 where empty.

    colour: (H, W, 4) uint8.  depth: (H, W) float32, +inf where empty.  mask: (H, W) bool.  Returns
    (1, 5, H, W) float32.
    """
    import torch

    known = torch.isfinite(depth)
    near = depth.amin()
    far = torch.where(known, depth, torch.full_like(depth, -torch.inf)).amax()
    spread = torch.where(known, (depth - near) / (far - near).clamp_min(_LEAST_RANGE), torch.full_like(depth, -1.0))
    return torch.cat([colour[..., :3].permute(2, 0, 1) / 255.0, mask.float()[None], spread[None]])[None]


class PaperNetwork:
    """The paper's network of 31 million parameters with random weights, with fixed buffers of one size.

    ``load`` copies a frame into the buffers; ``run`` computes ``picture``, (H, W, 3) uint8, on the device.
    """

    def __init__(self, size: tuple[int, int], device: str, dtype: "torch.dtype", seed: int = 1):
        import torch

        from ...model.network.engines import fold_normalisation
        from ...model.network.unet import PaperUNet

        width, height = size
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            network = PaperUNet()
        self.parameters = sum(p.numel() for p in network.parameters())
        network = fold_normalisation(network.eval())
        self.device, self.dtype = device, dtype
        self.network = network.to(device, dtype, memory_format=torch.channels_last)  # type: ignore[call-overload]
        self.colour = torch.zeros(height, width, 4, dtype=torch.uint8, device=device)
        self.depth = torch.ones(height, width, device=device)
        self.mask = torch.zeros(height, width, dtype=torch.bool, device=device)
        self._graph: Any = None
        self.picture = torch.empty(0)
        if device == "cuda":
            before, torch.backends.cudnn.benchmark = torch.backends.cudnn.benchmark, True
            try:
                self._capture()
            finally:
                torch.backends.cudnn.benchmark = before  # other pipelines run with the settings of the application

    def _capture(self) -> None:
        import torch

        aside = torch.cuda.Stream()
        aside.wait_stream(torch.cuda.current_stream())
        with torch.cuda.stream(aside):
            for _ in range(3):
                self._make()
        torch.cuda.current_stream().wait_stream(aside)
        graph = torch.cuda.CUDAGraph()
        with torch.cuda.graph(graph):
            self._make()
        self._graph = graph

    def _make(self) -> None:
        import torch

        with torch.inference_mode():
            x = paper_input(self.colour, self.depth, self.mask).to(self.dtype, memory_format=torch.channels_last)
            made = self.network(x)[0].float().clamp(0, 1)
            self.picture = (made.permute(1, 2, 0) * 255.0 + 0.5).to(torch.uint8)

    def load(self, colour: np.ndarray, depth: np.ndarray, mask: np.ndarray) -> None:
        """Copies a frame to the device.  Shapes and types: see :func:`paper_input`."""
        import torch

        for held, given in ((self.colour, colour), (self.depth, depth), (self.mask, mask)):
            held.copy_(torch.from_numpy(given.copy()))
        synchronise(self.device)

    def run(self) -> None:
        """Computes ``picture`` and waits until it is finished."""
        if self._graph is not None:
            self._graph.replay()
        else:
            self._make()
        synchronise(self.device)


class EveryPoint:
    """Replacement of a renderer's culler that draws all points of the scene."""

    def __init__(self, inner: "Culler"):
        scene = inner.scene
        self.scene, self._inner = scene, inner
        self._corners = np.asarray(scene.cell_coords, np.float64) * scene.cell_size
        count = np.diff(scene.offsets)
        held = np.flatnonzero(count)
        cells = len(scene.cell_coords)
        self._runs = {
            "first": np.asarray(scene.offsets[:-1])[held], "count": count[held], "slot": (held % cells).astype(np.int32),
            "cells": np.arange(cells, dtype=np.int32), "points": scene.count,
        }

    def select(self, camera: "Camera", lod: float | None = None) -> "DrawList":
        """The draw list of all points; ``lod`` is ignored."""
        scene = self.scene
        view = np.zeros((len(self._corners), 4), np.float32)
        view[:, :3] = (self._corners + (0.5 * scene.step + scene.origin - camera.position)) @ camera.view_rotation.T
        axes = (camera.view_rotation * scene.step).astype(np.float32)
        return replace(self._inner.select(camera), cell_view=view, axes=axes, **self._runs)


class Published:
    """The published pipeline with our passes: all points, the published soft z-buffer, filter and network."""

    settings = Settings(view="filtered", filter="paper-code", soft_z="paper-code", raster="compute")

    def __init__(self, context: "moderngl.Context", scene: "Scene", network: PaperNetwork):
        from ..render.renderer import Renderer

        self.network = network
        self._renderer = Renderer(context, scene, device="cpu")  # not used, as the network runs here
        self._renderer._culler = EveryPoint(self._renderer._culler)  # type: ignore[assignment]

    def frame(self, camera: "Camera") -> dict[str, float]:
        """Milliseconds of a frame by stage: COUNTED and LEFT_OUT."""
        frame = self._renderer.render(camera, self.settings, views=("raw", "filtered"))
        start = time.perf_counter()
        self.network.load(frame.image("raw"), frame.depth(), frame.mask())
        middle = time.perf_counter()
        self.network.run()
        end = time.perf_counter()
        stages = frame.stats["stages"]
        return {
            "draw list": stages["cull"], "raster": stages["raster"], "filter": stages["filter"],
            "hand over": (middle - start) * 1e3, "network": (end - middle) * 1e3,
        }

    def release(self) -> None:
        self._renderer.release()


def fastest_precision(device: str, size: tuple[int, int]) -> tuple[str, dict[str, float]]:
    """The fastest precision of the paper's network, measured on a small picture, and milliseconds of each.  On CUDA fp16, as
    published."""
    from ...model.network.reconstruct import PRECISIONS

    if device == "cuda":
        return "fp16", {}
    small = min(size[0], 192), min(size[1], 144)
    tried: dict[str, float] = {}
    for name in ("fp32", "bf16"):
        network = PaperNetwork(small, device, PRECISIONS[name])
        network.run()
        start = time.perf_counter()
        network.run()
        tried[name] = (time.perf_counter() - start) * 1e3
    return min(tried, key=lambda name: tried[name]), tried


class Open3DContender:
    """Open3D in a child process.

    Its time includes reading the picture back, without which the end of a frame is unknown.  reason: why it cannot render, or
    None.
    """

    name = f"Open3D, {POINT_SIZES[0]:g} px points, read back"

    def __init__(self, scene: "Scene"):
        from ..grid.scene import unpack

        self.reason: str | None = None
        self._xyz = self._rgb = np.empty(0)
        try:
            self._renderer = Open3DPoints()
            self._xyz, self._rgb = unpack(scene)[:2]
        except Open3DError as error:
            self.reason = str(error)

    def frame(self, camera: "Camera") -> dict[str, float] | None:
        """Milliseconds by point size, without the upload of the points; None if Open3D cannot render."""
        if self.reason is not None:
            return None
        seen = ((self._xyz - camera.position) @ camera.view_rotation.T).astype(np.float32)
        try:
            spent = self._renderer.draw(seen, self._rgb, (camera.width, camera.height), camera.fy)[1]
        except Open3DError as error:
            self.reason = str(error)
            return None
        times = {f"{size:g} px points": value for size, value in zip(POINT_SIZES, spent, strict=True)}
        return times | {"total": spent[0]}

    def close(self) -> None:
        if self.reason is None:
            self._renderer.close()
