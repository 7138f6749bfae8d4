"""One installation for all tests of this folder."""

import subprocess
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "window"))  # x_server, driver

from product import Installed, build_wheel, copy_compiled


@pytest.fixture(scope="session")
def installed(tmp_path_factory) -> Installed:
    pytest.importorskip("hatchling", reason="hatchling is a development dependency")
    folder = tmp_path_factory.mktemp("installed")
    wheel = build_wheel(folder / "wheel")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder / "env"], check=True, timeout=120)
    [site] = (folder / "env" / "lib").glob("python*/site-packages")
    others = [path for path in sys.path if path.endswith("-packages") and Path(path).is_dir()]
    (site / "packages.pth").write_text("".join(f"{path}\n" for path in others))
    # The basic installation is what is tested: the libraries of the extra lab are absent.
    absent = ("flip_evaluator", "plyfile", "tensorboard")
    (site / "without_lab.pth").write_text(f"import sys; sys.modules.update(dict.fromkeys({absent}))\n")
    python = folder / "env" / "bin" / "python"
    subprocess.run([sys.executable, "-m", "pip", "--python", python, "install", "-q", "--no-index", "--no-deps", "--no-compile",
                    "--ignore-installed", "--disable-pip-version-check", wheel], check=True, timeout=240)
    copy_compiled(site / "pointglass")
    work = folder / "work"
    for own in ("model.py", "viewer/__init__.py", "model/__init__.py", "shaders/__init__.py", "assets/__init__.py"):
        (work / own).parent.mkdir(parents=True, exist_ok=True)
        (work / own).write_text(f'raise RuntimeError("the person\'s own {own} was imported")\n')
    return Installed(python, python.with_name("pointglass"), site, work, wheel)
