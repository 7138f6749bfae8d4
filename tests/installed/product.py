"""The product as a person has it after ``pip install``: a wheel in an environment of its own, and a folder to work in that
holds the person's own ``model.py``, ``viewer/`` and ``model/``.

Nothing is downloaded: the environment finds the packages of this one through a .pth file, but not the checkout.
"""

import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Installed:
    """python, command: of the environment.  site: its site-packages.  work: the person's folder.  wheel: what was installed."""

    python: Path
    command: Path
    site: Path
    work: Path
    wheel: Path

    @property
    def environment(self) -> dict[str, str]:
        return {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}

    def run(self, *arguments: str | Path, seconds: float = 240, code: int = 0) -> subprocess.CompletedProcess[str]:
        """``pointglass ARGUMENTS`` in the person's folder."""
        done = subprocess.run([self.command, *arguments], cwd=self.work, env=self.environment, capture_output=True, text=True,
                              timeout=seconds)
        assert done.returncode == code and "Traceback" not in done.stderr, f"{arguments}: {done.returncode}\n{done.stderr}"
        return done

    def script(self, name: str, text: str, seconds: float = 240) -> str:
        """What a script of the person's, in the folder, prints."""
        (self.work / name).write_text(text, "utf-8")
        done = subprocess.run([self.python, name], cwd=self.work, env=self.environment, capture_output=True, text=True,
                              timeout=seconds)
        assert done.returncode == 0, done.stderr
        return done.stdout


def build_wheel(folder: Path, **environment: str) -> Path:
    """The wheel of this checkout."""
    built = subprocess.run(
        [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation", "--no-index", "-w", folder, ROOT],
        capture_output=True, text=True, timeout=300, env=os.environ | environment)
    assert built.returncode == 0, built.stderr
    [wheel] = folder.glob("pointglass-*.whl")
    return wheel


def copy_compiled(package: Path) -> None:
    """Saves half a minute: machine code that the checkout has of the same sources; numba compiles again what does not fit."""
    for part in ("viewer", "model"):
        for file in (ROOT / part).glob("**/__pycache__/*.nb[ic]"):
            target = package / file.relative_to(ROOT)
            target.parent.mkdir(exist_ok=True)
            shutil.copy(file, target)
