"""What a render returns: textures while they live, arrays on demand, and an honest account of how it was made."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, field, fields
from functools import cache, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..common.text import counted

if TYPE_CHECKING:
    import moderngl

    from ..grid.scene import Scene
    from ..picture.camera import Camera
    from ..picture.settings import Settings
    from .culling.cull import DrawList
    from .culling.occlusion import HiddenCount
    from .raster.points import PointPages
    from .raster.raster import Rasteriser
    from .stage_times import Times

_WHERE_KNOWN = {"where_known": True}
"""Marks facts that the dictionary leaves out where they are None."""


@dataclass(frozen=True, kw_only=True)
class FrameFacts:
    """How a frame was made.  The names are the keys of stats.json, in its order.

    raster: the rasteriser that ran.  points_drawn: with those that ``occlusion`` counts as hidden.  points_missing: not on the
    GPU yet.  device, network: what the network ran on, and which it was; None where none ran.  stations: "weighed" where
    points count by where their scanner stood, else "equal".  approximations: in words, what makes the picture inexact.
    occlusion: gives what was found hidden, and waits for the GPU; None where nothing was left out.  network_pending: of a
    network that was left to its own thread, whether it still runs.  bridge: how pixels reach the network.  photographs: how
    many were in reach of the view; None where none were.
    """

    raster: str
    points_drawn: int
    points_missing: int
    points_total: int
    cells_drawn: int
    cells_total: int
    points_gpu_bytes: int
    points_gpu_budget: int
    points_gpu_budget_source: str
    opengl: str
    device: str | None = None
    network: str | None = None
    stations: str
    approximations: tuple[str, ...]
    occlusion: "Callable[[], HiddenCount] | None" = field(default=None, metadata=_WHERE_KNOWN)
    network_pending: bool | None = field(default=None, metadata=_WHERE_KNOWN)
    bridge: str | None = field(default=None, metadata=_WHERE_KNOWN)
    photographs: int | None = field(default=None, metadata=_WHERE_KNOWN)


@dataclass(frozen=True, kw_only=True)
class FrameCost:
    """What a frame cost, and how it was made.  total_ms: from the call until the picture was there.  stages: milliseconds of
    each stage on what ran it.  host: milliseconds until that had it.  hidden: what ``facts.occlusion`` gave, None where nothing
    was left out."""

    total_ms: float
    stages: dict[str, float]
    host: dict[str, float]
    facts: FrameFacts
    hidden: "HiddenCount | None" = None

    @property
    def points_drawn(self) -> int:
        """Points drawn, without those of hidden cells."""
        return self.facts.points_drawn - (0 if self.hidden is None else self.hidden.points_hidden)

    def as_dict(self) -> dict[str, Any]:
        """Everything as stats.json has it."""
        facts = {each.name: getattr(self.facts, each.name) for each in fields(self.facts)}
        facts |= {"points_drawn": self.points_drawn, "approximations": list(self.facts.approximations),
                  "occlusion": None if self.hidden is None else asdict(self.hidden)}
        absent = [each.name for each in fields(self.facts) if "where_known" in each.metadata and facts[each.name] is None]
        return {"total_ms": self.total_ms, "stages": dict(self.stages), "host": dict(self.host),
                **{name: value for name, value in facts.items() if name not in absent}}


@dataclass
class Frame:
    """One picture of a camera in the views asked for.  Textures belong to the renderer and are valid until its next render.

    filled_depth: R32F, view-space z in file units of the filled picture, 0 where it is not opaque; None where it was not asked
    for.  ratio_depth: R32F, the depth of which ratios are compared (viewer.render.passes.depth_ratios); None: depth_texture.
    photo_shares: of the filled and the neural view, R8, how much of each pixel is from photographs; absent: nothing."""

    camera: "Camera"
    textures: dict[str, "moderngl.Texture"]
    depth_texture: "moderngl.Texture"
    mask_texture: "moderngl.Texture | None"
    facts: FrameFacts = field(repr=False)
    times: "Times" = field(repr=False)
    filled_depth: "moderngl.Texture | None" = None
    photo_shares: "dict[str, moderngl.Texture]" = field(default_factory=dict)
    ratio_depth: "moderngl.Texture | None" = None

    def image(self, view: str) -> np.ndarray:
        """(H, W, 4) uint8, sRGB premultiplied by alpha, row 0 at the top.  Raises KeyError for a view not asked for."""
        texture = self.textures[view]
        return np.frombuffer(texture.read(alignment=1), np.uint8).reshape(texture.height, texture.width, 4)

    def depth(self) -> np.ndarray:
        """(H, W) float32, view-space z in file units after the soft z-buffer, before the filter; +inf where empty."""
        texture = self.depth_texture
        return np.frombuffer(texture.read(alignment=1), np.float32).reshape(texture.height, texture.width)

    def mask(self) -> np.ndarray:
        """(H, W) bool: kept by the filter.  Where no filter ran, the pixels that hold a point."""
        if self.mask_texture is None:
            return np.isfinite(self.depth())
        texture = self.mask_texture
        return np.frombuffer(texture.read(alignment=1), np.uint8).reshape(texture.height, texture.width) > 127

    def from_photographs(self, view: str) -> np.ndarray | None:
        """(H, W) bool: pixels of a view coloured by photographs for the larger part; None where no photograph was used."""
        if (texture := self.photo_shares.get(view)) is None:
            return None
        return np.frombuffer(texture.read(alignment=1), np.uint8).reshape(texture.height, texture.width) > 127

    @property
    def cost(self) -> FrameCost:
        """What it cost.  Waits for the GPU."""
        hidden = None if self.facts.occlusion is None else self.facts.occlusion()
        return FrameCost(total_ms=self.times.total(), stages=dict(self.times.milliseconds()), host=dict(self.times.host),
                         facts=self.facts, hidden=hidden)

    @property
    def stats(self) -> dict[str, Any]:
        """:attr:`cost` ready for JSON: total_ms, stages, host, points and cells drawn, what ran on what, approximations in
        force.  Waits for the GPU."""
        return self.cost.as_dict()


def raster_facts(rasteriser: "Rasteriser", draw: "DrawList", pages: "PointPages", scene: "Scene", settings: "Settings", *,
                 opengl: str, weighted: bool, hides: bool) -> FrameFacts:
    """The facts of a frame whose points have been drawn.  weighted: points by their stations.  hides: hidden cells were left
    out."""
    hider, approximations = rasteriser.hider if hides else None, pages.approximations
    if settings.lod is not None:
        approximations.insert(0, f"level of detail: {counted(settings.lod, 'point')} per pixel")
    if hider is not None:
        approximations.append("hidden cells skipped")
    return FrameFacts(
        raster=rasteriser.kind, points_drawn=draw.points - pages.missing - pages.left_out - pages.lost,
        points_missing=pages.missing, points_total=scene.count, cells_drawn=len(draw.cells), cells_total=len(scene.cell_coords),
        points_gpu_bytes=pages.nbytes, points_gpu_budget=pages.budget, points_gpu_budget_source=pages.budget_source,
        opengl=opengl, stations="weighed" if weighted else "equal",  # a value of stats.json, kept
        approximations=tuple(approximations),
        occlusion=None if hider is None else cache(partial(hider.hidden_count, hider.serial)),  # once, when asked for
    )  # fmt: skip
