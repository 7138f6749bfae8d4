"""GLB of Gaussian splats opens as points, upright and in metres; a mesh, or what cannot be read, is refused in a line."""

import json
import struct
import subprocess
import sys

import numpy as np
import pytest

from pointglass.viewer.cli import main
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.readers.formats import is_scan, open_source
from pointglass.viewer.readers.meshes.mesh_formats import is_mesh, scans_and_meshes

EXTENSION, SH0 = "KHR_gaussian_splatting", 0.28209479177387814
COUNT = 400


def glb(document, binary):
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<III", 0x46546C67, 2, 28 + len(text) + len(binary))
    return head + struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(binary), 0x004E4942) + binary


def splats(rng):
    """The description and the buffer of splats in two nodes: interleaved floats with harmonics, and bytes of colour without
    opacity; (points with z up, sRGB 0..255, opacity)."""
    rows = np.zeros((COUNT, 8), "<f4")
    rows[:, :3], rows[:, 3] = rng.uniform(-5, 5, (COUNT, 3)), rng.choice([0.02, 0.9], COUNT)
    rows[:, 4:7] = rng.normal(0, 0.8, (COUNT, 3))
    plain, codes = rng.uniform(-5, 5, (COUNT, 3)).astype("<f4"), rng.integers(0, 256, (COUNT, 4)).astype(np.uint8)
    binary = rows.tobytes() + plain.tobytes() + codes.tobytes()
    views = [{"buffer": 0, "byteLength": rows.nbytes, "byteStride": 32},
             {"buffer": 0, "byteOffset": rows.nbytes, "byteLength": plain.nbytes},
             {"buffer": 0, "byteOffset": rows.nbytes + plain.nbytes, "byteLength": codes.nbytes}]

    def accessor(view, kind, component=5126, **more):
        return {"bufferView": view, "componentType": component, "count": COUNT, "type": kind, **more}

    accessors = [accessor(0, "VEC3"), accessor(0, "SCALAR", byteOffset=12), accessor(0, "VEC3", byteOffset=16),
                 accessor(1, "VEC3"), accessor(2, "VEC4", 5121, normalized=True)]
    first = {"POSITION": 0, f"{EXTENSION}:OPACITY": 1, f"{EXTENSION}:SH_DEGREE_0_COEF_0": 2}
    meshes = [{"primitives": [{"mode": 0, "attributes": names, "extensions": {EXTENSION: {"kernel": "ellipse"}}}]}
              for names in (first, {"POSITION": 3, "COLOR_0": 4})]
    half = np.sqrt(0.5)
    document = {"asset": {"version": "2.0"}, "extensionsUsed": [EXTENSION], "scene": 0, "scenes": [{"nodes": [0]}],
                "nodes": [{"mesh": 0, "matrix": [0, 0, -2, 0, 0, 2, 0, 0, 2, 0, 0, 0, 1, 2, 3, 1], "children": [1]},
                          {"mesh": 1, "rotation": [half, 0, 0, half], "scale": [1, 2, 1], "translation": [5, 0, 0]}],
                "meshes": meshes, "accessors": accessors, "bufferViews": views, "buffers": [{"byteLength": len(binary)}]}
    turned = (plain * [1, 2, 1])[:, [0, 2, 1]] * [1, -1, 1] + [5, 0, 0]  # about x by 90 degrees
    world = np.concatenate([2 * points[:, [2, 1, 0]] * [1, 1, -1] + [1, 2, 3] for points in (rows[:, :3], turned)])
    linear = codes[:, :3] / 255
    shades = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    colours = np.concatenate([np.clip(0.5 + SH0 * rows[:, 4:7], 0, 1), shades]) * 255
    return document, binary, (world[:, [0, 2, 1]] * [1, -1, 1], colours, np.concatenate([rows[:, 3], np.ones(COUNT)]))


def test_splats_of_every_node_stand_upright_in_metres(tmp_path, seed, capsys):
    document, binary, (xyz, colours, opacity) = splats(np.random.default_rng(seed))
    (tmp_path / "a.glb").write_bytes(glb(document, binary))
    source = open_source(tmp_path / "a.glb")
    found = [(chunk.xyz, chunk.rgb) for chunk in source.chunks()]
    shown = opacity > 0.1
    assert np.abs(np.concatenate([points for points, _ in found]) - xyz[shown]).max() < 1e-5
    assert np.abs(np.concatenate([rgb for _, rgb in found]) - colours[shown]).max() <= 0.501
    assert (source.count, source.units, source.metres_per_unit) == (2 * COUNT, "metre", 1.0)
    assert is_scan(tmp_path / "a.glb") and scans_and_meshes([tmp_path / "a.glb"]) == ([tmp_path / "a.glb"], [])
    assert main(["info", str(tmp_path / "a.glb"), "--no-cache"]) == 0
    said = capsys.readouterr().out
    assert "GLB of Gaussian splats" in said and f"{(~shown).sum():,} splats of opacity below 0.1 left out" in said


def changed(what):
    def change(document, binary):
        what(document)
        return glb(document, binary)
    return change


def packed(document):
    primitive = document["meshes"][0]["primitives"][0]
    primitive["extensions"][EXTENSION]["extensions"] = {"KHR_gaussian_splatting_compression_spz_2": {"bufferView": 0}}


DAMAGED, ELSEWHERE = "its description of splats is not as glTF has it", "its splats are sparse, compressed or in another file"
HOSTILE = {
    "cut": (lambda document, binary: glb(document, binary[:-1]), "truncated: its splats need"),
    "cut in the head": (lambda document, binary: glb(document, binary)[:200], "is no GLB of version 2, or damaged"),
    "of compressed splats": (changed(packed), "its splats are compressed (KHR_gaussian_splatting_comp"),
    "sparse": (changed(lambda d: d["accessors"][0].update(sparse={})), ELSEWHERE),
    "in another file": (changed(lambda d: d["buffers"][0].update(uri="/etc/passwd")), ELSEWHERE),
    "of other counts": (changed(lambda d: d["accessors"][1].update(count=3)), DAMAGED),
    "before the file": (changed(lambda d: d["bufferViews"][0].update(byteOffset=-9)), DAMAGED),
    "of a huge count": (changed(lambda d: [a.update(count=10**15) for a in d["accessors"]]), "truncated: its splats need"),
    "in a circle": (changed(lambda d: d["nodes"][1].update(children=[0])), DAMAGED),
    "in many circles": (changed(lambda d: d["nodes"][1].update(children=[1] * 9)), DAMAGED),
    "of lists": (changed(lambda d: d.update(nodes=[[]], meshes={})), DAMAGED),
    "of no triangles": (changed(lambda d: d.update(meshes=[{"primitives": []}] * 2)), "is a mesh (without KHR_gaussian"),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_what_cannot_be_read_is_refused_in_a_line(tmp_path, capsys, name):
    make, said = HOSTILE[name]
    document, binary, _ = splats(np.random.default_rng(1))
    (tmp_path / "a.glb").write_bytes(make(document, binary))
    with pytest.raises(InputError) as refused:
        list(open_source(tmp_path / "a.glb").chunks())
    assert said in str(refused.value) and "a.glb" in str(refused.value) and "\n" not in str(refused.value)
    assert main(["info", str(tmp_path / "a.glb"), "--no-cache"]) == 2
    assert capsys.readouterr().err.strip().count("\n") == 0


def test_a_mesh_is_no_scan_and_says_where_it_belongs(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    (tmp_path / "box.glb").write_bytes(trimesh.creation.box().export(file_type="glb"))
    assert is_mesh(tmp_path / "box.glb") and not is_scan(tmp_path / "box.glb")
    line = [sys.executable, "-m", "pointglass.viewer", "info", str(tmp_path / "box.glb")]
    done = subprocess.run(line, capture_output=True, text=True, timeout=120)
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert "box.glb: is a mesh (without KHR_gaussian_splatting), which is laid beside a scan" in done.stderr
