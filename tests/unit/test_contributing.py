"""CONTRIBUTING.md: the rooms are those of the code, the files it names exist, and its recipes work as they stand."""

import re
import sys
from importlib.machinery import ModuleSpec
from importlib.util import module_from_spec
from pathlib import Path

import numpy as np
import pytest
from test_architecture import ORDER

import pointglass
from pointglass.viewer.readers import formats

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / ".github" / "CONTRIBUTING.md").read_text("utf-8")


def recipe(title: str) -> str:
    return TEXT.partition(f"\n### {title}\n")[2].partition("\n### ")[0]


def block(text: str, language: str) -> str:
    found = re.search(rf"^```{language}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    assert found is not None
    return found[1]


@pytest.mark.parametrize("top", ORDER)
def test_its_rooms_are_those_of_the_code_in_their_order(top):
    table = TEXT.partition(f"| `{top}/` | |\n|---|---|\n")[2].partition("\n\n")[0]
    assert re.findall(r"^\| `(\w+)` \| .{10,} \|$", table, re.MULTILINE) == ORDER[top]


def test_the_files_that_it_names_exist():
    named = re.findall(r"`((?:viewer|model|tests|assets|shaders|\.ci)/[\w./-]*)`", TEXT)
    assert len(named) > 10 and [name for name in named if not (ROOT / name).exists()] == []
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE))
    asked = set(re.findall(r"(?:^|`)make ([a-z-]+)", TEXT, re.MULTILINE))
    assert len(asked) >= 4 and asked <= targets


def test_its_reader_reads(tmp_path, monkeypatch):
    name = "pointglass.viewer.readers.pex"
    module = module_from_spec(ModuleSpec(name, None))
    exec(compile(block(recipe("A reader"), "python"), name, "exec"), module.__dict__)
    monkeypatch.setitem(sys.modules, name, module)
    row = re.search(r"^\+\s+(Format\(.*\)),$", block(recipe("A reader"), "diff"), re.MULTILINE)
    assert row is not None
    monkeypatch.setattr(formats, "FORMATS", (*formats.FORMATS, eval(row[1], vars(formats))))

    rng = np.random.default_rng(1)
    points = np.zeros(2000, module.__dict__["_RECORD"])
    points["xyz"], points["rgb"] = rng.uniform(0, 3, (2000, 3)), rng.integers(0, 256, (2000, 3))
    path = tmp_path / "a.pex"
    path.write_bytes(b"PEX1" + (2000).to_bytes(8, "little") + points.tobytes())
    with pointglass.open(path, cache=False, exposures="as-scanned") as scan:
        order = np.lexsort(scan.points.xyz.T)
        assert np.array_equal(scan.points.xyz[order], points["xyz"][(by := np.lexsort(points["xyz"].T))].astype(np.float64))
        assert np.array_equal(scan.points["rgb"][order], points["rgb"][by]) and scan.info["format"] == "PEX"

    path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(pointglass.InputError, match="states 2,000 points, the file has 1,999"):
        pointglass.open(path, cache=False)
