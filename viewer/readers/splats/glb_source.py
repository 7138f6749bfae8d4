"""Binary glTF of Gaussian splats (KHR_gaussian_splatting): their centres as points, coloured by the harmonic of degree 0.

Splats that are nearly transparent are left out and counted, as of a PLY of splats.  A file that pointglass wrote lies where its
scan was, with its unit.  Others are turned from glTF's y up to z up, in metres, as meshes of glTF are.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ....model.common.linear_light import to_srgb
from ...common.errors import InputError
from ...common.text import counted
from ..column_source import Columns, ColumnSource
from ..ply.splat_ply_source import FAINT, SH0
from ..source import CHUNK
from .glb_head import EXTENSION, description
from .glb_splats import AGAIN, splat_parts
from .splat_frame import MOVED, OF_SPLATS, SplatFrame, splat_frame

_Z_UP = SplatFrame(np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0]]), "metre", 1.0)
"""From glTF's axes."""


class SplatGlbSource(ColumnSource):
    """One .glb file.  Raises InputError where it is a mesh, damaged, or of splats that are not read."""

    def __init__(self, path: Path):
        super().__init__(path, f"GLB{OF_SPLATS}")
        found = description(path)
        if found is None:
            raise InputError("is no GLB of version 2, or damaged", file=path, remedy=AGAIN)
        self._parts = splat_parts(path, *found)
        if not self._parts:
            raise InputError(f"is a mesh (without {EXTENSION}), which is laid beside a scan", file=path,
                             remedy="give the scan as well")
        self.count = sum(part.count for part in self._parts)
        asset = found[0].get("asset")
        own = splat_frame(asset.get("extras")) if isinstance(asset, dict) else None
        self._frame = own or _Z_UP
        self._frame.tell(self)
        self.precision = MOVED if self._frame.to_scan[:, 3].any() else 2.0**-24
        self._warn(f"{path.name}: Gaussian splats, shown as points at their centres with their base colours")
        self.record_losses.append(f"{path.name}: opacities, sizes and directions of its splats are left out")

    def _rows(self, wanted: str) -> Iterator[tuple[int, Columns]]:
        data, faint = np.memmap(self.path, np.uint8, "r"), 0
        for part in self._parts:
            columns = part.columns
            for start in range(0, part.count, CHUNK):
                stop = min(start + CHUNK, part.count)
                read = {name: column.read(data, start, stop) for name, column in columns.items()}
                colour = read.get("COLOR_0")
                opacity = read["OPACITY"][:, 0] if "OPACITY" in read else np.ones(stop - start)
                with np.errstate(invalid="ignore", over="ignore"):
                    kept = ~(opacity < FAINT)
                    faint += int(len(kept) - kept.sum())
                    if "SH_DEGREE_0_COEF_0" in read:
                        shade = 0.5 + SH0 * read["SH_DEGREE_0_COEF_0"]
                    else:
                        shade = np.full((stop - start, 3), 0.5) if colour is None else to_srgb(colour[:, :3])
                    rgb = np.rint(np.clip(np.nan_to_num(shade[kept]), 0, 1) * 255).astype(np.uint8)
                    xyz = read["POSITION"][kept] @ part.to_world[:3, :3].T + part.to_world[:3, 3]
                    xyz = self._frame.placed(xyz)
                yield 0, dict(zip("xyz", xyz.T)) | dict(zip("rgb", rgb.T))
        if faint:
            self._warn(f"{self.path.name}: {counted(faint, 'splat')} of opacity below {FAINT} left out")
