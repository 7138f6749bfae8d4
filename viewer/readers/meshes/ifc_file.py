"""Reading IFC files, which ifcopenshell (``pointglass[ifc]``) makes triangles of, in a process that a damaged file may end."""

import importlib.util
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from ...common.errors import InputError
from .mesh_data import MeshData, mesh_data

EXTRA = "pip install 'pointglass[ifc]'"
LONGEST_S = 1800.0
"""Seconds that a file may take: a building with 100 MB takes some minutes."""


def read_ifc(path: Path, checksum: str, most: int) -> MeshData:
    """The triangles of an IFC file with the names of its elements, metres.  most: triangles.  Raises InputError, one line,
    where it cannot be read, or ifcopenshell is not installed."""
    if importlib.util.find_spec("ifcopenshell") is None:
        raise InputError("IFC is read by ifcopenshell, which is not installed", file=path, remedy=EXTRA)
    with tempfile.TemporaryDirectory(prefix="pointglass-ifc-") as folder:
        out = Path(folder) / "triangles.npz"
        begin = f"import sys; sys.path[:] = {sys.path!r}; from {__package__}.ifc_child import main; main()"
        try:
            done = subprocess.run([sys.executable, "-c", begin, str(path), str(out)], capture_output=True, text=True,
                                  errors="replace", timeout=LONGEST_S)
        except subprocess.TimeoutExpired:
            raise InputError(f"making triangles of it takes more than {LONGEST_S / 60:.0f} minutes", file=path,
                             remedy="export it as glTF, or in parts") from None
        if done.returncode or not out.exists():
            said = done.stderr.strip().splitlines() if done.returncode == 3 else []
            line = said[-1] if said else "it ended the library"
            raise InputError(f"cannot be read as IFC ({' '.join(line.split())[:120]})", file=path, remedy="export it again")
        with np.load(out, allow_pickle=False) as found:
            vertices, faces, rgb, element = (found[name] for name in ("vertices", "faces", "rgb", "element"))
            about = json.loads(str(found["about"]))
    if len(faces) > most:
        raise InputError(f"{len(faces):,} triangles are more than are drawn ({most:,})", file=path, remedy="export it in parts")
    return mesh_data(vertices, faces, rgb, format="IFC", checksum=checksum, notes=tuple(about["notes"]), of_element=element,
                     elements=tuple(about["names"]))
