"""What a picture is made with: one frozen record, and the tables of its choices.

The command line, the window's panel and the README all read these tables, so a choice exists once.
"""

from dataclasses import dataclass
from numbers import Integral
from typing import Literal

from viewer.errors import InputError

View = Literal["raw", "filtered", "filled", "neural"]
VIEWS: dict[str, str] = {
    "raw": "every point that lands in a pixel, background showing through",
    "filtered": "points hidden behind a nearer surface removed",
    "filled": "filtered, holes filled smoothly (pull-push), no network",
    "neural": "filtered, filled and repainted by the network",
}
RASTERS: dict[str, str] = {
    "auto": "whichever measured faster on this device, fixed for the run",
    "points": "OpenGL point primitives",
    "compute": "compute shader with integer atomics",
}
FILTERS: dict[str, str] = {
    "auto": "inverse-depth pyramid, scale-free, adapts to the density of the surface in front",
    "paper-code": "the paper's published code: 4 levels, 1.025, edges over 0.03 m",
    "paper-text": "the paper's text: both edge cases compared as described, no absolute thresholds",
    "npbg++": "NPBG++'s single-level test exp(zmin - z)",
    "off": "nothing removed; the neural view is experimental then",
}
QUALITIES: dict[str, str] = {
    "fast": "smallest network",
    "balanced": "the default network",
    "best": "the default network on four mirrored pictures, averaged: nearer to the truth, four times the time",
    "paper": "the paper's 31M-parameter U-Net",
}
SOFT_Z: dict[str, str] = {
    "auto": "tolerance relative to depth, with a floor from point spacing",
    "paper-code": "rounded pixel, 0.02 m",
    "paper-text": "truncated pixel, 0.02 m",
}
STATIONS: dict[str, str] = {
    "auto": "where the scanners' places are known, colours come from those that looked the way the eye looks",
    "equal": "all points count the same",
}
PRECISIONS: dict[str, str] = {
    "auto": "fp16 on CUDA, bf16 on CPUs that multiply it in hardware, else fp32",
    "fp32": "single precision, the exact one",
    "bf16": "bfloat16",
    "fp16": "half precision",
}
DEVICES: dict[str, str] = {
    "auto": "CUDA where it works, else CPU",
    "cuda": "CUDA or an error",
    "cpu": "CPU",
}
BACKGROUNDS: dict[str, str] = {
    "black": "black",
    "transparent": "an alpha channel, not premultiplied",
    "plain": "the window's dark grey",
    "gradient": "grey, lighter at the top",
    "sky": "blue at the top, pale at the bottom",
}
"""What is shown where nothing was measured or filled.  No part of Settings: it is laid behind a finished picture
(viewer.tools.background)."""


@dataclass(frozen=True)
class Settings:
    """Everything but the camera that decides a picture.  The same scene, camera and settings give the same bytes.

    filter_strength: multiplies the filter's depth tolerance; 1 is the preset's own, smaller keeps fewer points.
    filter_levels: pyramid levels, None = the preset's own.
    lod: level of detail, the points drawn per pixel a cell covers; None draws every point.
    detail: how much of what is fine the network keeps, from 0 (smooth) to 2 (every measured grain); 1: by the scan's noise.
    weights: a weights file of one's own (`pointglass train` makes them) in place of the shipped ones of ``quality``.
    """

    view: str = "neural"
    raster: str = "auto"
    filter: str = "auto"
    filter_strength: float = 1.0
    filter_levels: int | None = None
    lod: float | None = None
    detail: float = 1.0
    quality: str = "balanced"
    device: str = "auto"
    soft_z: str = "auto"
    stations: str = "auto"
    precision: str = "auto"
    weights: str | None = None

    def __post_init__(self) -> None:
        for name, table in CHOICES.items():
            if (value := getattr(self, name)) not in table:
                raise InputError(f"{name} {value!r}: expected one of {', '.join(table)}")
        if not 0 < self.filter_strength <= 1000:
            raise InputError(f"filter strength {self.filter_strength!r}: expected a number above 0, at most 1000")
        if self.filter_levels is not None and not (isinstance(self.filter_levels, Integral) and 1 <= self.filter_levels <= 12):
            raise InputError(f"filter levels {self.filter_levels!r}: expected a whole number from 1 to 12")
        if not 0 <= self.detail <= 2:
            raise InputError(f"detail {self.detail!r}: expected a number from 0 (smooth) to 2 (every measured grain)")
        if self.lod is not None and not self.lod > 0:
            raise InputError(f"level of detail {self.lod!r}: expected points per pixel above 0")


@dataclass(frozen=True)
class Memory:
    """What a scene's points may take, in bytes; an exact picture is the same with any.

    gpu: on the GPU; None: as much as seems right for the device.  read_ahead: in main memory, on their way there.
    """

    gpu: int | None = None
    read_ahead: int = 256 << 20


MEMORY = Memory()

CHOICES: dict[str, dict[str, str]] = {
    "view": VIEWS,
    "raster": RASTERS,
    "filter": FILTERS,
    "quality": QUALITIES,
    "device": DEVICES,
    "precision": PRECISIONS,
    "soft_z": SOFT_Z,
    "stations": STATIONS,
}
