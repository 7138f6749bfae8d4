"""The doctor finds what is there, survives what crashes, and says what to do."""

import json
import re
import subprocess
import sys
import tomllib
from importlib import metadata

import pytest

from pointglass.model.common import loop_cache
from pointglass.viewer import doctor, doctor_probes
from pointglass.viewer.common.paths import assets_dir


@pytest.mark.slow
@pytest.mark.gl
def test_examination_is_complete_and_readable(monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    report = json.loads(json.dumps(doctor.examine()))
    items = {item["name"]: item for item in report["items"]}
    assert {"OpenGL", "limits", "GPU memory", "window", "torch", "CUDA", "weights", "interop", "memory", "processor",
            "cache", "compiled loops", "file dialog", "libraries"} == set(items)  # fmt: skip
    assert re.search(r"[\d.]+ GB.* free \(.*for points at most [\d.]+ GB", items["GPU memory"]["value"])
    assert all(item["status"] in doctor_probes.STATUSES and item["value"] for item in items.values())
    assert all(item["remedy"] for item in items.values() if item["status"] in ("warn", "fail"))
    assert "self-test passed" in items["OpenGL"]["value"]
    assert items["window"]["status"] == "skipped" and "DISPLAY" in items["window"]["value"]
    assert doctor.exit_code(report) == 0
    text = doctor.format_text(report)
    assert max(map(len, text.splitlines())) <= 110 and "pictures can be made" in text


def test_a_crashed_probe_is_an_answer():
    process = subprocess.Popen(
        [sys.executable, "-c", "import os; os.abort()"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    (found,) = doctor._finish("OpenGL", process)
    assert found["status"] == "fail" and "signal 6" in found["value"] and found["remedy"]


def test_no_opengl_is_exit_code_3():
    report = {"version": "0", "pictures": False, "items": [doctor_probes.item("OpenGL", "fail", "none", "install one")]}
    assert doctor.exit_code(report) == 3
    assert "no usable OpenGL" in doctor.format_text(report) and "-> install one" in doctor.format_text(report)


def test_missing_driver_is_found_in_the_probe(tmp_path, monkeypatch):
    empty = tmp_path / "none.json"
    empty.write_text("{}")
    monkeypatch.setenv("__EGL_VENDOR_LIBRARY_FILENAMES", str(empty))
    (found,) = doctor._finish("OpenGL", doctor._start("OpenGL"))
    assert found["status"] == "fail" and "OpenGL 4.3" in found["value"]


def test_unwritable_cache_is_found(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("POINTGLASS_CACHE", str(tmp_path / "file"))
    found = doctor._cache()
    assert found["status"] == "fail" and "POINTGLASS_CACHE" in found["remedy"]
    monkeypatch.setenv("POINTGLASS_CACHE", str(tmp_path / "not" / "yet" / "there"))
    assert doctor._cache()["status"] in ("ok", "warn") and not (tmp_path / "not").exists()


def test_what_is_missing_is_named(tmp_path, monkeypatch):
    """A file dialog, and a folder in which compiled loops can be kept."""
    (tmp_path / "kdialog").write_text("#!/bin/sh\n")
    (tmp_path / "kdialog").chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert doctor._file_dialog() == doctor_probes.item("file dialog", "ok", str(tmp_path / "kdialog"))
    (tmp_path / "kdialog").unlink()
    found = doctor._file_dialog()
    assert found["status"] == "ok" and "inside the window" in found["value"] and "apt install zenity" in found["value"]

    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "loops"))
    assert "compile_kernels" in doctor._loops()["value"]  # an empty folder
    loops = tmp_path / "loops" / "render_1"
    loops.mkdir(parents=True)
    (loops / "raster_loops.draw-1.py311.nbi").touch()
    assert doctor._loops()["value"] == f"kept {tmp_path / 'loops'}; compiled"
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    monkeypatch.setattr(loop_cache, "kept_in", lambda package: None)
    found = doctor._loops()
    assert found["status"] == "warn" and "POINTGLASS_CACHE" in found["remedy"]


@pytest.fixture
def installed(monkeypatch):
    """A machine where every package is there but those added to the set; what is looked for is left in the list."""
    absent, asked = set(), []

    def version(name):
        asked.append(name)
        if name in absent:
            raise metadata.PackageNotFoundError(name)
        return "1.0"

    monkeypatch.setattr(doctor.metadata, "version", version)
    return absent, asked


def test_an_ordinary_install_has_every_library(installed):
    """Without what only a GPU's mapping needs."""
    absent, asked = installed
    absent |= {"cuda-core", "cuda-bindings"}
    found = doctor._libraries()
    assert found["status"] == "ok" and "cuda-core" not in found["value"], found
    assert {"matplotlib", "tqdm", "torch", "laspy", "lazrs", "open3d"} <= set(asked)
    absent.add("tqdm")
    found = doctor._libraries()
    assert found["status"] == "fail" and "missing: tqdm" in found["value"] and found["remedy"]


def test_libraries_are_those_the_package_asks_for(monkeypatch):
    """By its metadata, and where that is not there by a list that cannot fall behind."""
    wanted = tomllib.loads((assets_dir().parent / "pyproject.toml").read_text("utf-8"))["project"]["dependencies"]
    names = {name for line in wanted for name in re.findall(r"[a-z][a-z0-9-]+", line)}
    assert set(doctor._required()) == names == set(doctor.LIBRARIES)
    given = ["laspy[lazrs]<3,>=2.5", "tqdm (>=4)", "open3d<1; extra == 'dev'", "other ; python_version > '3'"]
    monkeypatch.setattr(doctor.metadata, "requires", lambda name: given)
    assert doctor._required() == ("laspy", "lazrs", "tqdm", "other")

    def absent(name):
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(doctor.metadata, "requires", absent)
    assert doctor._required() == doctor.LIBRARIES


BRIDGE = """
from pointglass.viewer.render.network.bridge import ReadBackBridge, works
from pointglass.viewer.render.device.context import create_context
from pointglass.viewer.render.device.shader import Programs
programs = Programs(create_context())
assert works(programs, ReadBackBridge(programs.context, (64, 48)))
"""


@pytest.mark.slow
@pytest.mark.gl
def test_bridge_test_passes_on_the_reference_bridge():
    subprocess.run([sys.executable, "-c", BRIDGE], check=True, timeout=120)
