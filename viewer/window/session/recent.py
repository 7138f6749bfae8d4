"""Recent scans with a thumbnail each, kept in the user's state folder (POINTGLASS_STATE if set).

``recent.json`` is a list, the latest first; thumbnails are PNG files beside it.  Both are written atomically.  A damaged or
unreadable list counts as empty: it is a convenience, and the next scan writes it anew.
"""

import hashlib
import io
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ....model.common.files.atomic_write import write_atomic
from ....model.common.files.state_folder import state_dir
from ...common.errors import InputError
from ...common.state_files import read_state, write_state
from ...picture.json_values import from_json, to_json
from ...readers.remote.address import is_address, kept_path
from ...work.viewpoint import Viewpoint

MOST = 12
"""Scans that are remembered."""
THUMBNAIL = (320, 200)
"""Pixels."""
_FILE = "recent.json"


@dataclass(frozen=True)
class RecentScan:
    """paths: absolute, or addresses, as opened together: scans, or one project.  title: in a few words.  points: their number.
    view: where the camera stood when they were left, None where that is not known."""

    paths: tuple[str, ...]
    title: str
    points: int
    view: Viewpoint | None = None

    @property
    def thumbnail(self) -> Path:
        """Its picture, which may be missing."""
        name = hashlib.sha256("\n".join(self.paths).encode("utf-8", "surrogatepass")).hexdigest()[:24]
        return state_dir() / f"{name}.png"

    @property
    def missing(self) -> str:
        """Why it cannot be opened, "" where all of its files are there.  No server is asked for what lies at an address."""
        gone = [path for path in self.paths if not os.path.exists(path) and not is_address(path)]  # or cannot be
        return f"{gone[0]} is not there any more" if gone else ""


def recent_scans() -> list[RecentScan]:
    """The scans remembered, the latest first."""

    def parse(rows) -> list[RecentScan]:
        return [RecentScan(tuple(map(str, row["paths"])), str(row["title"]), int(row["points"]), _view(row)) for row in rows
                ][:MOST]

    return read_state(state_dir() / _FILE, parse, [])


def _view(row: dict) -> Viewpoint | None:
    try:
        return from_json(Viewpoint, row.get("view"), "view")
    except InputError:
        return None


def last_view(paths: Sequence[Path]) -> Viewpoint | None:
    """Where the camera stood when these scans were left; None where that is not known."""
    asked = tuple(kept_path(path) for path in paths)
    return next((scan.view for scan in recent_scans() if scan.paths == asked), None)


def remember(paths: list[Path], title: str, points: int, picture: np.ndarray | None, view: Viewpoint | None = None) -> None:
    """Puts a scan first in the list, with a thumbnail of ``picture`` (H, W, 3) uint8 where there is one.

    What cannot be written is left out: closing a scan must not fail for want of a thumbnail.
    """
    scan = RecentScan(tuple(kept_path(path) for path in paths), title, points, view)
    before = recent_scans()
    kept = [scan, *(other for other in before if other.paths != scan.paths)][:MOST]
    try:
        state_dir().mkdir(mode=0o700, parents=True, exist_ok=True)
        if picture is not None:
            _save_thumbnail(scan.thumbnail, picture)
        write_state(state_dir() / _FILE, [to_json(row) for row in kept])
        for gone in set(before) - set(kept):
            if gone.paths != scan.paths:
                gone.thumbnail.unlink(missing_ok=True)
    except OSError:
        return


def _save_thumbnail(path: Path, picture: np.ndarray) -> None:
    """The middle of the picture in the thumbnail's aspect ratio, reduced."""
    from PIL import Image

    height, width = picture.shape[:2]
    across = min(width, round(height * THUMBNAIL[0] / THUMBNAIL[1]))
    down = min(height, round(width * THUMBNAIL[1] / THUMBNAIL[0]))
    left, top = (width - across) // 2, (height - down) // 2
    image = Image.fromarray(np.ascontiguousarray(picture[top : top + down, left : left + across]))
    buffer = io.BytesIO()
    image.resize(THUMBNAIL, Image.Resampling.BOX).save(buffer, "PNG")
    write_atomic(path, lambda beside: beside.write_bytes(buffer.getvalue()))


def load_thumbnail(scan: RecentScan) -> np.ndarray | None:
    """(H, W, 3) uint8, or None where there is no readable picture."""
    from PIL.PngImagePlugin import PngImageFile

    try:
        with PngImageFile(scan.thumbnail) as image:  # the plug-in itself, which does not warn of large pictures
            if image.width > THUMBNAIL[0] or image.height > THUMBNAIL[1]:
                return None
            return np.asarray(image.convert("RGB"))
    except Exception:  # Pillow raises nearly anything for damaged pictures
        return None
