"""The settings of a picture: one frozen dataclass, and the tables of its choices.

The command line and the window's panel read these tables, so that each choice is written down once.
"""

from dataclasses import dataclass, field
from numbers import Integral

from ...model.network.qualities import DEFAULT, QUALITIES
from ..common.errors import InputError
from .views import VIEWS

RASTERS: dict[str, str] = {
    "auto": "on a GPU the one that measured faster, otherwise cpu",
    "points": "OpenGL point primitives",
    "compute": "compute shader with integer atomics",
    "cpu": "compiled loops on all processors, for OpenGL in software",
}
FILTERS: dict[str, str] = {
    "auto": "inverse-depth pyramid; scale-free, adapts to the point spacing of the nearer surface",
    "paper-code": "the paper's published code: 4 levels, depth ratio 1.025, edge threshold 0.03 m",
    "paper-text": "the method as the paper describes it: both edge cases, no absolute threshold",
    "npbg++": "the single-level test of NPBG++, exp(zmin - z)",
    "off": "no filter; the neural view is 1 to 3 dB worse, but in plain dense rooms",
}
SOFT_Z: dict[str, str] = {
    "auto": "depth tolerance relative to depth, at least the point spacing",
    "paper-code": "pixel coordinates rounded, tolerance 0.02 m",
    "paper-text": "pixel coordinates truncated, tolerance 0.02 m",
}
STATIONS: dict[str, str] = {
    "auto": "view-dependent blending where scanner positions are known: points whose scanner looked from a similar direction "
            "weigh more",
    "equal": "all points weigh the same",
}
PRECISIONS: dict[str, str] = {
    "auto": "fp16 on CUDA, bf16 on CPUs with bf16 multiplication, otherwise fp32",
    "fp32": "single precision, the reference",
    "bf16": "bfloat16",
    "fp16": "half precision",
}
DEVICES: dict[str, str] = {
    "auto": "CUDA where it works, otherwise the CPU",
    "cuda": "CUDA, or an error where it does not work",
    "cpu": "the CPU",
}
BACKGROUNDS: dict[str, str] = {
    "black": "black",
    "transparent": "an alpha channel, straight (not premultiplied)",
    "plain": "the window's dark grey",
    "gradient": "grey, lighter towards the top",
    "sky": "blue at the top, pale at the bottom",
}
"""What is shown where nothing was measured or filled.  Not part of Settings: it is composited behind a finished picture
(viewer.picture.background)."""


_UNLESS_DEFAULT = {"unless_default": True}
"""As in viewer.picture.json_values, which the command line does not import at its start: it needs numpy."""


@dataclass(frozen=True)
class Settings:
    """Everything that determines a picture, except scene and camera.  The same scene, camera and settings give the same bytes.

    filter_strength: factor of the depth filter's tolerance, above 0; a smaller one keeps fewer points.
    filter_levels: pyramid levels of the depth filter, 1 to 12; None: those of the filter's preset.
    lod: level of detail, points drawn per pixel that a cell covers, above 0; None: every point.
    detail: from 0 (smooth) to 2 (keep all measured detail, noise too); 1 follows the scan's estimated noise.
    weights: a weights file, as `pointglass train` makes them, used instead of the shipped weights of ``quality``.
    photos: auto colours filled and neural pictures from the posed photographs of E57 files, off does not; else a folder of
    photographs with their cameras.
    The other fields are keys of the tables above.  Raises InputError that names the first bad value.
    """

    view: str = "neural"
    raster: str = "auto"
    filter: str = "auto"
    filter_strength: float = 1.0
    filter_levels: int | None = None
    lod: float | None = None
    detail: float = 1.0
    quality: str = DEFAULT
    device: str = "auto"
    soft_z: str = "auto"
    stations: str = "auto"
    precision: str = "auto"
    weights: str | None = None
    photos: str = field(default="auto", metadata=_UNLESS_DEFAULT)

    def __post_init__(self) -> None:
        for name, table in CHOICES.items():
            if (value := getattr(self, name)) not in table:
                raise InputError(f"expected one of {', '.join(table)}", option=name, value=value)
        if not 0 < self.filter_strength <= 1000:
            raise InputError("expected a number above 0, at most 1000", option="filter strength", value=self.filter_strength)
        if self.filter_levels is not None and not (isinstance(self.filter_levels, Integral) and 1 <= self.filter_levels <= 12):
            raise InputError("expected a whole number from 1 to 12", option="filter levels", value=self.filter_levels)
        if not 0 <= self.detail <= 2:
            raise InputError("expected a number from 0 (smooth) to 2 (keep all measured detail)", option="detail",
                             value=self.detail)
        if self.lod is not None and not self.lod > 0:
            raise InputError("expected points per pixel above 0", option="level of detail", value=self.lod)


@dataclass(frozen=True)
class Memory:
    """Memory limits for a scene's points, in bytes.  They do not change an exact picture.

    gpu: GPU memory; None: chosen for the device.  read_ahead: main memory for points prefetched for the GPU.
    """

    gpu: int | None = None
    read_ahead: int = 256 << 20


MEMORY = Memory()
"""The default limits."""

CHOICES: dict[str, dict[str, str]] = {
    "view": {name: row.text for name, row in VIEWS.items()},
    "raster": RASTERS,
    "filter": FILTERS,
    "quality": {name: row.text for name, row in QUALITIES.items()},
    "device": DEVICES,
    "precision": PRECISIONS,
    "soft_z": SOFT_Z,
    "stations": STATIONS,
}
"""Of each field of Settings that is a choice: its table, value -> explanation."""
