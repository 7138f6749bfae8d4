"""Poses of photographs that were found, and searches in vain, in the cache folder: one small file for a photograph and scan."""

import hashlib
import json
import logging
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from ...common.paths import cache_dir
from ...common.state_files import read_state, write_state
from ...picture.json_values import from_json, to_json
from ...picture.photographs.placed_photograph import PlacedPhotograph
from ...preprocess.scan_description import RecordOrigin
from ...work.photo_poses.pose_search import NotFound

if TYPE_CHECKING:
    from ...grid.scene import Scene
    from .photo_search import UnplacedPhotograph

SEARCH = 3
"""Of the search; another number is searched again."""
_log = logging.getLogger(__name__)


class KeptPoses:
    """Of one scene; of points in memory nothing is kept."""

    def __init__(self, scene: "Scene"):
        origin = scene.meta.records or RecordOrigin()
        self._scan = json.dumps([origin.files, to_json(origin.moves), scene.count]) if origin.files else ""

    def read(self, photo: "UnplacedPhotograph") -> PlacedPhotograph | NotFound | None:
        """What is known; None: nothing."""
        found = read_state(self._file(photo), _parsed, None) if self._scan else None
        if isinstance(found, PlacedPhotograph):  # it may have been copied or renamed
            return replace(found, path=photo.path, name=photo.name, number=photo.number)
        return found

    def write(self, photo: "UnplacedPhotograph", found: PlacedPhotograph | NotFound) -> None:
        if self._scan:
            kept = {"why": found.why} if isinstance(found, NotFound) else to_json(replace(found, path="photograph"))
            try:
                write_state(self._file(photo), kept)
            except OSError as error:
                _log.warning("the pose of %s is not kept: %s", photo.name, error.strerror or error)

    def _file(self, photo: "UnplacedPhotograph") -> Path:
        key = hashlib.sha256(f"{SEARCH} {self._scan} {photo.focal}".encode() + hashlib.sha256(photo.data).digest())
        return cache_dir() / "photo-poses" / f"{key.hexdigest()[:32]}.json"


def _parsed(found: Any) -> PlacedPhotograph | NotFound:
    return NotFound(str(found["why"])) if "why" in found else cast(
        PlacedPhotograph, from_json(PlacedPhotograph, found, "photograph"))  # fmt: skip
