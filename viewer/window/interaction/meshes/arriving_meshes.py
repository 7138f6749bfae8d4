"""Mesh files that are opened, dropped or named at the start: they are laid beside the scan that is open."""

from collections.abc import Sequence
from pathlib import Path

from ....readers.meshes.mesh_formats import MESH_FORMATS
from ...session.session import Session

_AS_SCAN = (".ply",)
"""Suffixes of files that are scans where they are opened without another."""


def scans_of_opened(session: Session, paths: Sequence[Path]) -> list[Path]:
    """The paths to open, none where they are meshes alone: these join the scan that is open, or being opened."""
    meshes = [path for path in paths if path.suffix.lower() in MESH_FORMATS and path.suffix.lower() not in _AS_SCAN]
    if not meshes or len(meshes) < len(paths):
        return list(paths)
    if session.scene is None and session.loads.current is None:
        session.notices.say("A mesh is laid beside a scan", f"Open a scan first, then {meshes[0].name}, or both together.")
    else:
        session.work.arriving_meshes += meshes
    return []
