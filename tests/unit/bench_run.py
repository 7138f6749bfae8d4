"""A small scan for the benches, and a bench run whole on a tiny one."""

import json

import pytest

from pointglass.viewer.bench.procedural_scan import ProceduralScan, procedural_scene
from pointglass.viewer.cli import main

SIZE = (64, 48)
COMMON = {"bench", "machine", "scans", "opengl", "driver"}


def four_rooms():
    """A floor of four rooms: the scan and its scene."""
    scan = ProceduralScan(60_000, 4, seed=3)
    return scan, procedural_scene(scan)


def run(*arguments) -> int:
    return main([str(a) for a in arguments])


def made_by(kind: str, folder, *arguments) -> dict:
    """The JSON of one bench on a tiny scan at 64x48; its plot is a picture."""
    scan = [] if kind in ("scale", "grid", "raster", "cull", "photographs") else ["--procedural", "20k", "--rooms", "1"]
    json_file, plot = folder / f"{kind}.json", folder / f"{kind}.png"
    assert run("bench", kind, *scan, "--size", "64x48", "--json", json_file, "--plot", plot, *arguments) == 0
    assert plot.read_bytes().startswith(b"\x89PNG")

    def refuse(name):
        pytest.fail(f"{kind}: {name} is no JSON")

    made = json.loads(json_file.read_text(), parse_constant=refuse)
    assert made["bench"] == kind and {"cores", "processor", "system", "versions", "gpu"} <= made["machine"].keys()
    assert sorted(p.name for p in folder.iterdir()) == sorted([json_file.name, plot.name])
    return made
