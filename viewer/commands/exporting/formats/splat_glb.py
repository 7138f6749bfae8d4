"""Splats as binary glTF 2.0 with KHR_gaussian_splatting (Khronos, 2026); POINTS with COLOR_0 where the extension is not known.

Frame of the file: glTF's, y up, metres where the unit is known.  Scales are linear and opacities 0..1, as the extension says.
The attribute ``_POINTS`` is the number of measured points that a splat stands for; ``extras`` of the asset lead
back to the scan.
"""

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

from ....common.errors import InputError
from ....readers.splats.glb_head import EXTENSION
from ....work.splats.splat_cloud import Splats

FLOAT, BYTE, ARRAY_BUFFER = 5126, 5121, 34962
"""Constants of glTF."""
_JSON, _BINARY = 0x4E4F534A, 0x004E4942
_BLOCK = 1 << 20
"""Splats converted at a time."""
_MOST_BYTES = 2**32 - 1


def write_splat_glb(path: Path, splats: Splats, extras: dict[str, Any], generator: str, advance) -> None:
    """Writes a file.  splats: in the file's frame.  extras: of the asset.  advance: called with the number of splats that were
    written.  Raises InputError where they need more bytes than a GLB can have."""
    count = len(splats)
    columns: list[tuple[str, str, int, int, Any]] = [
        ("POSITION", "VEC3", FLOAT, 12, lambda some: splats.xyz[some].astype("<f4")),
        ("COLOR_0", "VEC4", BYTE, 4, lambda some: _fallback(splats, some)),
        (f"{EXTENSION}:ROTATION", "VEC4", FLOAT, 16, lambda some: splats.rotation[some][:, [1, 2, 3, 0]].astype("<f4")),
        (f"{EXTENSION}:SCALE", "VEC3", FLOAT, 12, lambda some: splats.scale[some].astype("<f4")),
        (f"{EXTENSION}:OPACITY", "SCALAR", FLOAT, 4, lambda some: splats.opacity[some].astype("<f4")),
        (f"{EXTENSION}:SH_DEGREE_0_COEF_0", "VEC3", FLOAT, 12, lambda some: splats.sh0[some].astype("<f4")),
        *((f"{EXTENSION}:SH_DEGREE_1_COEF_{order}", "VEC3", FLOAT, 12,
           lambda some, order=order: splats.sh1(some)[:, order].astype("<f4")) for order in range(3 * splats.degree)),
        ("_POINTS", "SCALAR", FLOAT, 4, lambda some: splats.points[some].astype("<f4")),
    ]
    accessors: list[dict[str, Any]] = []
    views, at = [], 0
    for _, kind, component, size, _ in columns:
        accessors.append({"bufferView": len(views), "componentType": component, "count": count, "type": kind})
        views.append({"buffer": 0, "byteOffset": at, "byteLength": count * size, "target": ARRAY_BUFFER})
        at += count * size
    placed = splats.xyz.astype(np.float32)
    accessors[0] |= {"min": placed.min(axis=0).tolist(), "max": placed.max(axis=0).tolist()}
    accessors[1]["normalized"] = True
    primitive = {
        "mode": 0, "attributes": {name: number for number, (name, *_) in enumerate(columns)},
        "extensions": {EXTENSION: {"kernel": "ellipse", "colorSpace": "srgb_rec709_display", "sortingMethod": "cameraDistance",
                                   "projection": "perspective"}},
    }  # fmt: skip
    document = {
        "asset": {"version": "2.0", "generator": generator, "extras": extras}, "extensionsUsed": [EXTENSION], "scene": 0,
        "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}], "meshes": [{"primitives": [primitive]}], "accessors": accessors,
        "bufferViews": views, "buffers": [{"byteLength": at}],
    }  # fmt: skip
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    if (total := 12 + 8 + len(text) + 8 + at) > _MOST_BYTES:
        raise InputError(f"{count:,} splats need more bytes than a GLB has", option="--budget", remedy="give a smaller one")
    done = 0
    with path.open("wb") as file:
        file.write(struct.pack("<III", 0x46546C67, 2, total) + struct.pack("<II", len(text), _JSON) + text)
        file.write(struct.pack("<II", at, _BINARY))
        for number, (*_, column) in enumerate(columns, 1):
            for start in range(0, count, _BLOCK):
                file.write(np.ascontiguousarray(column(slice(start, start + _BLOCK))).tobytes())
            now = count * number // len(columns)
            advance(now - done)
            done = now


def _fallback(splats: Splats, some: slice) -> np.ndarray:
    """(k, 4) uint8: colour in linear light, as glTF has COLOR_0, and opacity."""
    from .....model.common.linear_light import to_linear

    parts = np.concatenate([to_linear(splats.rgb[some]), splats.opacity[some, None]], axis=1)
    return np.rint(np.clip(parts, 0, 1) * 255).astype(np.uint8)
