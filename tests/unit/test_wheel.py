"""A built wheel works from another directory: code, shaders, demo scan and weights are found without the checkout."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
CHECK = """
import os, sys
import pointglass
assert pointglass.demo_scan().is_file() and not {"torch", "moderngl"} & set(sys.modules)
from pointglass import model, viewer
from pointglass.viewer.paths import assets_dir, shaders_dir
from pointglass.model.weights_folder import shipped
assert all(module.__file__.startswith(os.environ["PYTHONPATH"]) for module in (pointglass, viewer, model))
assert (shaders_dir() / "resolve.comp").is_file() and (assets_dir() / "demo.laz").is_file()
assert (assets_dir() / "demo_cameras.json").is_file() and "balanced-filtered" in shipped()
import pointglass.viewer.commands, pointglass.viewer.grid.info, pointglass.viewer.render.renderer
from pointglass.viewer.readers.formats import open_source
print("points", sum(len(chunk.xyz) for chunk in open_source(assets_dir() / "demo.laz").chunks()))
from pointglass.viewer.cli import main
raise SystemExit(main(["info", "--help"]))
"""


@pytest.mark.slow
def test_a_wheel_works_from_another_directory(tmp_path):
    pytest.importorskip("hatchling", reason="hatchling is a development dependency")
    built = subprocess.run(
        [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation", "-w", str(tmp_path), str(ROOT)],
        capture_output=True, text=True, timeout=300)
    assert built.returncode == 0, built.stderr
    [wheel] = tmp_path.glob("pointglass-*.whl")
    site = tmp_path / "site"
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        archive.extractall(site)
    assert not any(name.startswith(("tests/", ".ci/")) for name in names)
    done = subprocess.run([sys.executable, "-c", CHECK], cwd=tmp_path, env=_environment(site, tmp_path), capture_output=True,
                          text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert "points 1350000" in done.stdout and "usage: pointglass info" in done.stdout


def _environment(site: Path, tmp_path: Path) -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(site), "POINTGLASS_CACHE": str(tmp_path / "cache")}
