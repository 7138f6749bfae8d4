"""An installed wheel does all that a checkout does: every command, Python, and type checkers."""

import importlib.util
import io
import json
import os
import re
import subprocess
import sys
import tarfile
import zipfile
from email.parser import BytesParser
from pathlib import Path

import av
import laspy
import numpy as np
import pytest
from PIL import Image
from product import ROOT, build_wheel

import pointglass
from pointglass.viewer.command_table import COMMANDS

CAMERAS = ROOT / "assets" / "demo_cameras.json"
DEMO = "import pointglass; print(pointglass.demo_scan())"
PYTHON = """
import sys
import pointglass
assert not {"torch", "moderngl"} & set(sys.modules)
camera = pointglass.read_cameras(pointglass.demo_scan().with_name("demo_cameras.json"), size=(160, 120))[0]
networks = set()
with pointglass.open(pointglass.demo_scan()) as scan:
    for quality in ("fast", "balanced"):
        frame = scan.render(camera, quality=quality, full=True)
        assert frame.image.shape == (120, 160, 4), quality
        networks.add(frame.stats["network"])
assert len(networks) == 2, networks
from pointglass.model.common.loop_cache import kept_in
from pointglass.viewer.render.raster import raster_loops
from pathlib import Path
site = Path(pointglass.__file__).parents[1]
ours = [module for name, module in sys.modules.items() if name.partition(".")[0] == "pointglass"]
assert len(ours) > 50 and all(site in Path(module.__file__).parents for module in ours)
assert kept_in(Path(raster_loops.__file__).parent) == Path(raster_loops.__file__).parent / "__pycache__"
assert not any(Path(entry or ".").resolve() == Path(sys.argv[1]) for entry in sys.path), sys.path
assert not {"model", "viewer", "shaders", "assets"} & set(sys.modules)
print(site)
"""
TYPED = """
import pointglass
scan = pointglass.open("a.laz")
reveal_type(scan.render(pointglass.look_at((0, 0, 0), (1, 0, 0)), full=True))
reveal_type(scan.points.xyz)
scan.nonsense
"""


@pytest.fixture(scope="module")
def demo(installed) -> str:
    return installed.script("where.py", DEMO).strip()


def test_a_wheel_owns_one_name_and_says_what_it_is(installed):
    with zipfile.ZipFile(installed.wheel) as archive:
        names = archive.namelist()
        [metadata] = [BytesParser().parsebytes(archive.read(name)) for name in names if name.endswith("/METADATA")]
    assert {name.partition("/")[0] for name in names} == {"pointglass", f"pointglass-{metadata['Version']}.dist-info"}
    assert "pointglass/py.typed" in names and not any("__pycache__" in name or "/.ci/" in name for name in names)
    classifiers = set(metadata.get_all("Classifier", []))
    assert {"Programming Language :: Python :: 3.11", "Typing :: Typed", "Operating System :: POSIX :: Linux"} <= classifiers
    said = subprocess.run([installed.python, "-m", "pointglass", "--version"], cwd=installed.work, env=installed.environment,
                          capture_output=True, text=True, timeout=120)
    assert (said.returncode, said.stdout) == (0, f"pointglass {metadata['Version']}\n"), said.stderr
    assert metadata["License-Expression"] == "MIT" and metadata["Description-Content-Type"] == "text/markdown"


def targets(text: str) -> list[str]:
    """What the pictures and links of a text lead to, except places in the text itself."""
    return [target for target in re.findall(r"\]\(([^)\s]+)\)", text) if not target.startswith("#")]


def test_the_page_in_an_index_has_no_relative_picture_or_link(installed):
    """Without the repository's address they are left out; with it they are absolute, and the address is in the metadata."""
    spec = importlib.util.spec_from_file_location("package_hooks", ROOT / ".ci" / "package.py")
    assert spec is not None and spec.loader is not None
    hooks = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(hooks)
    text = (ROOT / "README.md").read_text("utf-8")
    assert any(not target.startswith("http") for target in targets(text))
    bare, full = hooks.readme_of_index(text, ""), hooks.readme_of_index(text, "https://host.example/owner/pointglass")
    for made in (bare, full):
        assert all(target.startswith("https://") for target in targets(made)), targets(made)
        assert [line for line in made.splitlines() if line.startswith("## ")] == [
            line for line in text.splitlines() if line.startswith("## ")]
    assert "![" not in bare and full.count("![") == text.count("![")
    with zipfile.ZipFile(installed.wheel) as archive:
        [name] = [name for name in archive.namelist() if name.endswith("/METADATA")]
        metadata = BytesParser().parsebytes(archive.read(name))
    url = hooks.repository_url()
    page = metadata.get_payload(decode=True)  # the bytes: a metadata file states no charset, it is UTF-8
    assert isinstance(page, bytes) and page.decode().strip() == hooks.readme_of_index(text, url).strip()
    assert metadata.get_all("Project-URL", []) == ([f"Source, {url}", f"Issues, {url}/issues"] if url else [])


@pytest.mark.slow
def test_the_repositorys_address_makes_pictures_absolute(tmp_path):
    wheel = build_wheel(tmp_path, POINTGLASS_URL="https://host.example/owner/pointglass/")
    with zipfile.ZipFile(wheel) as archive:
        [name] = [name for name in archive.namelist() if name.endswith("/METADATA")]
        metadata = BytesParser().parsebytes(archive.read(name))
    assert "Source, https://host.example/owner/pointglass" in metadata.get_all("Project-URL", [])
    assert "](https://host.example/owner/pointglass/raw/HEAD/assets/" in str(metadata.get_payload())


def test_an_editable_installation_holds_no_copy_of_the_code(tmp_path):
    """A copy in site-packages would hide the checkout: what is changed there would not run."""
    code = "import sys, hatchling.build; print(hatchling.build.build_editable(sys.argv[1]))"
    done = subprocess.run([sys.executable, "-c", code, tmp_path], cwd=ROOT, capture_output=True, text=True, check=True,
                          timeout=120)
    with zipfile.ZipFile(tmp_path / done.stdout.split()[-1]) as archive:
        files = [name for name in archive.namelist() if ".dist-info/" not in name]
        assert [Path(name).suffix for name in files] == [".pth"] and archive.read(files[0]).decode().strip() == str(ROOT)


@pytest.mark.slow
def test_a_source_distribution_makes_the_same_wheel(installed, tmp_path):
    """The links in .ci/editor hid the folders that they lead to from the builder."""
    code = "import sys, hatchling.build as build; print(getattr(build, sys.argv[1])(sys.argv[2]))"
    for what, folder in (("build_sdist", ROOT), ("build_wheel", tmp_path / f"pointglass-{pointglass.__version__}")):
        subprocess.run([sys.executable, "-c", code, what, tmp_path], cwd=folder, check=True, timeout=120, capture_output=True)
        if what == "build_sdist":
            with tarfile.open(tmp_path / f"pointglass-{pointglass.__version__}.tar.gz") as archive:
                archive.extractall(tmp_path, filter="data")
    with zipfile.ZipFile(tmp_path / installed.wheel.name) as made, zipfile.ZipFile(installed.wheel) as known:
        assert set(made.namelist()) == set(known.namelist())


@pytest.mark.parametrize("command", [None, *COMMANDS])
def test_every_command_explains_itself(installed, command):
    done = installed.run(*filter(None, [command]), "--help", seconds=60)
    assert done.stdout.startswith(f"usage: pointglass {command or ''}".rstrip()) and done.stderr == ""


def test_info_and_doctor(installed, demo):
    facts = json.loads(installed.run("info", demo, "--json").stdout)
    assert facts["points"] == 1_350_000
    report = json.loads(installed.run("doctor", "--json").stdout)
    items = {item["name"]: item for item in report["items"]}
    assert "balanced-filtered" in items["weights"]["value"] and items["OpenGL"]["status"] in ("ok", "warn")
    assert items["libraries"]["status"] == "ok" and items["compiled loops"]["status"] == "ok", items


def test_render_video_export_and_convert(installed, demo):
    work = installed.work
    installed.run("render", demo, "--cameras", CAMERAS, "--out", "pictures", "--size", "160x120", "--quality", "fast", "--aux")
    names = {frame["name"] for frame in json.loads(CAMERAS.read_text())["camera_path"] if "name" in frame}
    pictures = sorted((work / "pictures").glob("*.png"))
    assert {file.stem for file in pictures if ".provenance" not in file.name} >= names
    for picture in pictures:
        with Image.open(picture) as image:
            assert image.size == (160, 120)
    again = installed.run("render", demo, "--like", pictures[0], "--out", "again")
    assert again.stderr == "" and len(list((work / "again").glob("*.png"))) == 1

    installed.run("video", demo, "--path", CAMERAS, "--out", "film.mp4", "--size", "160x120", "--view", "filled",
                  "--seconds", "0.5", "--fps", "10")
    with av.open(str(work / "film.mp4")) as film:
        frames = [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)]
    assert len(frames) >= 5 and frames[0].shape == (120, 160, 3) and np.std(frames[0]) > 5

    installed.run("export", demo, "--clip", "0,0,0,2,2,2", "--out", "corner.laz")
    xyz = laspy.read(work / "corner.laz").xyz
    assert 0 < len(xyz) < 1_350_000 and xyz.min() >= 0 and xyz.max() <= 2.001
    installed.run("convert", "corner.laz", "--out", "grid")  # a corner: the grid of the whole scan takes some seconds
    installed.run("export", "grid", "--clip", "0,0,0,1,1,1", "--out", "part.laz")
    part = laspy.read(work / "part.laz").xyz
    assert 0 < len(part) < len(xyz) and part.min() >= 0 and part.max() <= 1.001


def test_a_scan_is_judged_without_the_libraries_of_the_lab(installed, demo):
    """conftest.py hides them: `evaluate SCAN` is in the basic installation."""
    said = installed.run("evaluate", demo, "--views", "1", "--densities", "1").stdout
    assert "network balanced-filtered" in said and "PSNR" in said


def test_python_beside_a_persons_own_model_and_viewer(installed):
    """All qualities that are shipped, from the installed package alone, its compiled loops included."""
    (installed.work / "beside.py").write_text(PYTHON)
    done = subprocess.run([installed.python, "beside.py", ROOT], cwd=installed.work, env=installed.environment,
                          capture_output=True, text=True, timeout=240)
    assert done.returncode == 0, done.stderr
    assert Path(done.stdout.strip()) == installed.site


@pytest.mark.slow
def test_type_checkers_and_editors_find_every_definition(installed, tmp_path):
    """In a project of a person's own, and in the tests of a checkout."""
    (tmp_path / "mine.py").write_text(TYPED)
    mine = pyright(tmp_path, "mine.py", "--pythonpath", str(installed.python))
    said = [found["message"] for found in mine]
    assert any('"Frame"' in text for text in said) and any("ndarray" in text for text in said), said
    errors = [found["message"] for found in mine if found["severity"] == "error"]
    assert len(errors) == 1 and "nonsense" in errors[0], errors

    ours = pyright(ROOT, "tests/unit/interface/test_python_columns.py", "tests/window/driver.py")
    missing = [found for found in ours if "could not be resolved" in found["message"] or "of module" in found["message"]
               or "unknown import symbol" in found["message"]]
    assert missing == [], missing


def pyright(folder: Path, *arguments: str) -> list[dict]:
    done = subprocess.run([sys.executable, "-m", "pyright", "--outputjson", *arguments], cwd=folder, capture_output=True,
                          text=True, timeout=240, env=os.environ | {"PYRIGHT_PYTHON_IGNORE_WARNINGS": "1"})
    return json.load(io.StringIO(done.stdout))["generalDiagnostics"]
