"""Input of a bench, a scan from files or a procedural one, and the facts that are reported with each result."""

import os
import platform
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ...model.common.process.processors import usable_processors
from ...model.common.system import processor_name

if TYPE_CHECKING:
    from ..grid.scene import Scene
    from ..render.device.context import Device
    from .procedural_scan import ProceduralScan


@dataclass(frozen=True, eq=False)
class Subject:
    """A scan: either ``scans`` (files or folders) or ``procedural``."""

    scans: tuple[Path, ...] = ()
    procedural: "ProceduralScan | None" = None

    def scene(self) -> "Scene":
        """The scan's grid: of files through the cache; a procedural one is made each time."""
        if self.procedural is not None:
            from .procedural_scan import procedural_scene

            return procedural_scene(self.procedural)
        from ..grid.open_scene import open_scene

        return open_scene(list(self.scans))

    @property
    def names(self) -> list[str]:
        """Paths of the files, or the label of the procedural scan."""
        return [self.procedural.label] if self.procedural is not None else [str(scan) for scan in self.scans]

    def facts(self, scene: "Scene", device: "Device") -> dict:
        """For JSON: scans, their size in bytes if all are files, points, OpenGL renderer and driver version, and whether OpenGL
        is in software."""
        files = [scan for scan in self.scans if scan.is_file()]
        size = sum(scan.stat().st_size for scan in files) if files and len(files) == len(self.scans) else None
        return {"scans": self.names, "file_bytes": size, "points": scene.count, "opengl": device.renderer,
                "driver": device.version, "software": device.software}


def machine() -> dict:
    """Facts of the machine: processor, cores that this process may use, load average of the last minute (this process
    included), system, GPU and its driver, and package versions."""
    from importlib.metadata import PackageNotFoundError, version

    versions: dict[str, str | None] = {"python": platform.python_version()}
    for name in ("pointglass", "torch", "moderngl", "numpy", "numba"):
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            versions[name] = None
    cores = usable_processors()
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else None
    return {"processor": processor_name(), "cores": cores, "load": load, "system": platform.platform(), "gpu": _gpu(),
            "versions": versions}


def _gpu() -> dict | None:
    """The CUDA device; None if torch is not loaded or finds none."""
    torch = sys.modules.get("torch")
    if torch is None or not torch.cuda.is_available():
        return None
    try:
        driver = Path("/proc/driver/nvidia/version").read_text().splitlines()[0]
    except (OSError, IndexError):
        driver = None
    return {"name": torch.cuda.get_device_name(), "driver": driver, "cuda": torch.version.cuda,
            "memory": torch.cuda.get_device_properties(0).total_memory}


def described(result: dict) -> str:
    """Machine, driver, versions, scan and size of a result in one or two lines, for plots and tables."""
    where = result["machine"]
    parts = [f"{where['processor']}, {where['cores']} cores"]
    if (where.get("load") or 0) > 1.5 * (os.cpu_count() or 1):
        parts.append(f"BUSY with other work (load {where['load']:.1f})")
    if gpu := where.get("gpu"):
        parts.append(f"{gpu['name']}, CUDA {gpu['cuda']}")
    if "opengl" in result:
        parts.append(f"{result['opengl']} ({result.get('driver', 'driver unknown')})")
    parts.append(", ".join(f"{name} {v}" for name, v in where["versions"].items() if v))
    first = "; ".join(parts)
    second = "; ".join([Path(scan).name if "/" in scan else scan for scan in result.get("scans", [])])
    sizes = result.get("sizes") or ([result["size"]] if "size" in result else [])
    if sizes:
        second += ("; " if second else "") + ", ".join(f"{w}x{h}" for w, h in sizes)
    return first + (f"\n{second}" if second else "")
