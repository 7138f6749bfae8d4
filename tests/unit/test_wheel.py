"""The built wheel, used from another directory: what a person who runs `pipx install pointglass` gets."""

import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def unpacked(tmp_path_factory) -> Path:
    """The wheel's contents, built without network and laid out as an installer would."""
    folder = tmp_path_factory.mktemp("wheel")
    built = subprocess.run(
        [sys.executable, "-m", "pip", "wheel", "-q", "--no-index", "--no-deps", "--no-build-isolation",
         "--wheel-dir", folder, ROOT],
        capture_output=True, text=True, timeout=300,
    )
    assert built.returncode == 0, built.stderr
    (wheel,) = folder.glob("pointglass-*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder / "site")
    return folder / "site"


def run_elsewhere(unpacked: Path, elsewhere: Path, *arguments: str) -> subprocess.CompletedProcess:
    """Python in an empty directory with the wheel first on its path, so that the checkout cannot lend it a file."""
    environment = {**os.environ, "PYTHONPATH": str(unpacked), "POINTGLASS_CACHE": str(elsewhere / "cache")}
    return subprocess.run(
        [sys.executable, *arguments], cwd=elsewhere, env=environment, capture_output=True, text=True, timeout=300
    )


def files_under(folder: Path) -> set[str]:
    return {p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file()}


def test_wheel_brings_its_own_shaders_demo_and_weights(unpacked, tmp_path):
    script = (
        "import json, viewer, model\n"
        "from viewer.paths import assets_dir, shaders_dir\n"
        "from model.weights import shipped, weights_dir\n"
        "print(json.dumps([viewer.__file__, model.__file__, str(shaders_dir()), str(assets_dir()),\n"
        "                  str(weights_dir()), shipped()]))"
    )
    done = run_elsewhere(unpacked, tmp_path, "-c", script)
    assert done.returncode == 0, done.stderr
    *places, weights = json.loads(done.stdout)
    assert all(Path(p).is_relative_to(unpacked) for p in places), places
    shaders, assets, weights_folder = map(Path, places[2:])
    assert files_under(shaders) == files_under(ROOT / "shaders")
    for name in ("demo.laz", "demo_cameras.json"):
        assert (assets / name).read_bytes() == (ROOT / "assets" / name).read_bytes()
    assert weights
    assert weights == sorted(p.stem for p in (ROOT / "assets" / "weights").glob("*.safetensors"))
    assert files_under(weights_folder) == files_under(ROOT / "assets" / "weights")


def test_wheel_carries_the_weights_once_and_nothing_that_is_not_the_program(unpacked):
    names = files_under(unpacked)
    assert {n.split("/")[0] for n in names if ".dist-info/" not in n} == {"viewer", "model"}
    weights = [n for n in names if n.endswith(".safetensors")]
    assert weights
    assert all(n.startswith("model/_data/weights/") for n in weights)
    assert not [n for n in names if n.endswith(".pyc")]
    assert [n for n in names if n.endswith(".dist-info/licenses/LICENSE")]


def test_command_of_the_wheel_reads_the_demo_scan(unpacked, tmp_path):
    entry = next(unpacked.glob("*.dist-info")) / "entry_points.txt"
    assert "pointglass = viewer.cli:main" in entry.read_text()
    script = "import sys; from viewer.cli import main; sys.exit(main())"
    demo = str(unpacked / "viewer" / "_data" / "assets" / "demo.laz")
    done = run_elsewhere(unpacked, tmp_path, "-c", script, "info", demo, "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["points"] > 1_000_000
