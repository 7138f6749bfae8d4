"""Of which files an octree of many files at an address consists (Potree, EPT), and a smaller octree made of the upper ones.

The hierarchy is read by the code of the readers, which asks for each of its files before it opens it.  Frame: the file's.
"""

import contextlib
import json
import os
import re
import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...common.errors import InputError
from ..octree import ept, potree1
from ..octree.octree_source import damaged, read_json, vector, whole
from ..octree.potree2 import Potree2Source
from ..own_folder import own_path
from .folder_copy import ENTRIES, FolderCopy
from .local_copy import LocalCopy

EPT, POTREE2, POTREE1 = ENTRIES
_KEYS = {POTREE1: ("octreeDir", "boundingBox"), POTREE2: ("hierarchy", "encoding"), EPT: ("schema", "dataType")}
"""Keys by which such a file is recognised where it has another name."""
_PACKED_POINT = 8
"""Bytes that a compressed point is taken to need where none are stated: between 5 and 12 in the LAZ files at hand."""
_SPAN = 128
"""Points along a node's side where an octree does not state it (entwine's default is 128, Potree's too)."""
_NODE = re.compile("r[0-7]{0,60}")


@dataclass(frozen=True, eq=False)
class OctreeParts:
    """levels, points: (n,) int64 of the nodes that hold points.  files: of each node, relative to the folder.  runs: (n, 2)
    int64, of Potree 2 in place of files: first and last byte in octree.bin, the last left out.  size: bytes of all, an estimate
    where the octree does not state it.  bounds: (2, 3) corners, None where none are stated.  cells: (n, 3) int64, each node's
    place x, y, z among the cubes of its level.  cube: (4,) lowest corner and side of the root's, None where it is not stated.
    spacing: of the root's points, 0 where it is not stated."""

    levels: np.ndarray
    points: np.ndarray
    files: list[str]
    size: int
    runs: np.ndarray | None = None
    octree: LocalCopy | None = None
    bounds: np.ndarray | None = None
    cells: np.ndarray | None = None
    cube: np.ndarray | None = None
    spacing: float = 0.0

    def fetch(self, copy: FolderCopy, nodes: np.ndarray, label: str | None = None) -> None:
        """Reads nodes, (k,) numbers, as far as they are not there.  label: of the progress; None: none."""
        if self.octree is not None and self.runs is not None:
            self.octree.fetch([(first, last) for first, last in self.runs[nodes].tolist()], label)
        else:
            copy.get([self.files[node] for node in nodes.tolist()], label)

    def empty(self, copy: FolderCopy) -> None:
        """Gives up all nodes that are there."""
        if self.octree is not None:
            self.octree.empty()
        else:
            copy.empty()


def parts_of(copy: FolderCopy) -> OctreeParts:
    """The nodes of an octree; reads its hierarchy.  Raises InputError, one line, where it is damaged or no octree."""
    meta = read_json(copy.entry)
    kind = copy.entry.name if copy.entry.name in ENTRIES else next(
        (name for name, keys in _KEYS.items() if all(key in meta for key in keys)), None)  # fmt: skip
    if kind is None or not all(key in meta for key in _KEYS[kind][:1]):
        raise InputError(f"{copy.address.text}: does not describe a Potree or EPT octree", remedy="give the address of a scan")
    return {POTREE1: _potree1, POTREE2: _potree2, EPT: _ept}[kind](copy, meta)


def _ept(copy: FolderCopy, meta: dict) -> OctreeParts:
    zipped = ".gz" if meta.get("hierarchyType") == "gzip" else ""
    copy.begins_with(f"{ept.HIERARCHY}/0-0-0-0.json{zipped}")
    counts = ept.read_hierarchy(copy.entry, meta, copy.get)
    suffix = ept.SUFFIXES.get(str(meta.get("dataType")))
    if suffix is None:
        raise InputError(f"dataType {str(meta.get('dataType'))[:20]!a} is not known", file=copy.address.text)
    levels = np.array([int(name.partition("-")[0]) for name in counts], np.int64)
    points = np.array(list(counts.values()), np.int64)
    fields = meta.get("schema") if suffix == "bin" else None
    sizes = [whole(entry.get("size"), 4096) or 0 for entry in fields or () if isinstance(entry, dict)]
    low_high, cube = vector(meta.get("boundsConforming"), 6), vector(meta.get("bounds"), 6)
    low_high = cube if low_high is None else low_high
    return OctreeParts(levels, points, [f"{ept.DATA}/{name}.{suffix}" for name in counts],
                       int(points.sum()) * (sum(sizes) or _PACKED_POINT),
                       bounds=None if low_high is None else low_high.reshape(2, 3),
                       cells=np.array([name.split("-")[1:] for name in counts], np.int64).reshape(-1, 3),
                       cube=None if cube is None else np.append(cube[:3], cube[3] - cube[0]),
                       spacing=0.0 if cube is None else (cube[3] - cube[0]) / (whole(meta.get("span"), 1 << 20) or _SPAN))


def _potree2(copy: FolderCopy, meta: dict) -> OctreeParts:
    copy.begins_with("hierarchy.bin")
    octree = copy.part("octree.bin")
    found = Potree2Source(copy.entry).node_runs()
    box = next((entry for entry in meta.get("attributes", []) if str(entry.get("name")).lower().startswith("position")), {})
    stated = meta.get("boundingBox")
    root = _box(stated, "min", "max")
    return OctreeParts(found[:, 0], found[:, 1], [], octree.remote.size, found[:, 2:4], octree,
                       _box(box, "min", "max") if "min" in box else root, found[:, 4:], _cube(root), _spacing(meta))


def _potree1(copy: FolderCopy, meta: dict) -> OctreeParts:
    stated, attributes = meta.get("octreeDir"), meta.get("pointAttributes")
    folder = stated if isinstance(stated, str) else "data"
    own_path(copy.folder, folder)
    suffix = "bin" if isinstance(attributes, list) else str(attributes).lower()
    listed, step = meta.get("hierarchy"), 0
    if isinstance(listed, list):
        counts = {str(entry[0]): whole(entry[1]) or 0 for entry in listed if isinstance(entry, list) and len(entry) == 2}
    else:
        step = whole(meta.get("hierarchyStepSize"), 60) or 0
        if not step:
            raise damaged("its hierarchyStepSize is not a number of levels", copy.entry)
        counts = _from_hrc(copy, folder, step)
    if wrong := next((name for name in counts if not _NODE.fullmatch(name)), None):
        raise damaged(f"{wrong[:40]!a} is no name of a node", copy.entry)
    held = {name: count for name, count in counts.items() if count}
    tight = _box(meta.get("tightBoundingBox"), "lx ly lz", "ux uy uz")
    root = _box(meta.get("boundingBox"), "lx ly lz", "ux uy uz")
    return OctreeParts(np.array([len(name) - 1 for name in held], np.int64), np.array(list(held.values()), np.int64),
                       [f"{_place(folder, name, step)}.{suffix}" for name in held], sum(held.values()) * 2 * _PACKED_POINT,
                       bounds=root if tight is None else tight, cells=np.array([*map(_cell, held)], np.int64).reshape(-1, 3),
                       cube=_cube(root), spacing=_spacing(meta))


def _from_hrc(copy: FolderCopy, folder: str, step: int) -> dict[str, int]:
    """Points by name of the node, from the .hrc files, one for each ``step`` levels."""
    counts: dict[str, int] = {}
    copy.begins_with(f"{_place(folder, 'r', step)}.hrc")
    waiting = ["r"]
    while waiting:
        files = {root: f"{_place(folder, root, step)}.hrc" for root in waiting}
        copy.get(list(files.values()))
        waiting = []
        for root, file in files.items():
            nodes = potree1.nodes_in(copy.folder / file, root)
            counts |= {name: points for name, (points, _) in nodes.items()}
            waiting += [name for name, (_, children) in nodes.items() if children and len(name) - len(root) == step]
    return counts


def _place(folder: str, name: str, step: int) -> str:
    """Where the files of a node lie (Potree 1, PointCloudOctreeGeometryNode.getHierarchyPath): in a folder for each ``step``
    levels; 0: all in one folder, as before version 1.5."""
    if not step:
        return f"{folder}/{name}"
    parts = [name[1:][k * step : (k + 1) * step] for k in range((len(name) - 1) // step)]
    return "/".join([folder, "r", *parts, name])


def _cell(name: str) -> list[int]:
    """The place x, y, z of a Potree node such as r0412: octants, in which 4 is x, 2 is y and 1 is z."""
    return [sum((int(octant) >> axis & 1) << place for place, octant in enumerate(reversed(name[1:]))) for axis in (2, 1, 0)]


def _cube(box: np.ndarray | None) -> np.ndarray | None:
    return None if box is None else np.append(box[0], (box[1] - box[0]).max())


def _spacing(meta: dict) -> float:
    stated = vector([meta.get("spacing")], 1)
    return 0.0 if stated is None else float(stated[0])


def _box(stated: object, low: str, high: str) -> np.ndarray | None:
    """(2, 3) corners from the keys of both, in one word of three numbers or in three words of one."""
    if not isinstance(stated, dict):
        return None
    corners = [found for keys in (low, high) if (found := vector(
        [stated.get(key) for key in keys.split()] if " " in keys else stated.get(keys))) is not None]  # fmt: skip
    return np.stack(corners) if len(corners) == 2 else None


def upper_octree(copy: FolderCopy, parts: OctreeParts, nodes: np.ndarray) -> Path:
    """The describing file of an octree of some nodes, which are there: a folder of links to their files, beside the copy."""
    if parts.octree is not None:  # a file with holes; readers read by node
        return copy.entry
    home = copy.folder.parent / f"upper-{len(nodes)}"
    entry = home / copy.folder.name / copy.entry.name
    if not entry.is_file():
        beside = home.with_name(f"{home.name}.{os.getpid()}.part")
        shutil.rmtree(beside, ignore_errors=True)
        _link(copy, parts, nodes, beside / copy.folder.name)
        with contextlib.suppress(OSError):  # another process was faster
            beside.rename(home)
        shutil.rmtree(beside, ignore_errors=True)
    return entry


@contextlib.contextmanager
def linked_octree(copy: FolderCopy, parts: OctreeParts, nodes: np.ndarray) -> Iterator[Path]:
    """As :func:`upper_octree`, of any nodes of EPT and Potree 1, until the block ends."""
    with tempfile.TemporaryDirectory(prefix="upper-", dir=copy.folder.parent, ignore_cleanup_errors=True) as home:
        made = Path(home) / copy.folder.name
        _link(copy, parts, nodes, made)
        yield made / copy.entry.name


def _link(copy: FolderCopy, parts: OctreeParts, nodes: np.ndarray, made: Path) -> None:
    """Makes an octree of some nodes in the folder ``made``."""
    meta = read_json(copy.entry)
    for node in nodes.tolist():
        file = made / parts.files[node]
        file.parent.mkdir(parents=True, exist_ok=True)
        try:
            os.link(copy.folder / parts.files[node], file)
        except OSError:  # of a file system without links
            shutil.copyfile(copy.folder / parts.files[node], file)
    if "schema" in meta or "dataType" in meta:
        counts = {Path(parts.files[node]).name.partition(".")[0]: int(parts.points[node]) for node in nodes.tolist()}
        (made / ept.HIERARCHY).mkdir()
        (made / ept.HIERARCHY / "0-0-0-0.json").write_text(json.dumps(counts))
        meta |= {"hierarchyType": "json", "points": sum(counts.values())}
    else:
        meta["hierarchy"] = []  # the nodes are those whose files are there
    (made / copy.entry.name).write_text(json.dumps(meta))
