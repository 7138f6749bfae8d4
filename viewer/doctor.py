"""``pointglass doctor``: reports which parts work on this machine, which are used, and how to fix the rest.

A driver can crash a process, so every check that uses one is a probe in its own process (:mod:`viewer.doctor_probes`), and a
crash is reported as its result.  Sizes are in units for a person; the dict holds the same text and can be written as JSON.
"""

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import textwrap
from importlib import metadata
from pathlib import Path

from ..model.common.process.processors import usable_processors
from ..model.common.system import available_memory, total_memory
from . import __version__
from .common.paths import cache_dir, import_root
from .common.text import counted
from .doctor_probes import GB, PROBES, item

LIBRARIES = (
    "av", "brotli", "ezdxf", "glfw", "imgui-bundle", "laspy", "lazrs", "matplotlib", "moderngl", "numba", "numpy", "obstore",
    "open3d", "pillow", "platformdirs", "pye57", "pyproj", "safetensors", "scipy", "torch", "tqdm", "trimesh",
    "zstandard",
)  # fmt: skip
"""Dependencies in pyproject.toml, for a checkout that is run without being installed."""
OPTIONAL = ("cuda-core", "cuda-bindings", "flip-evaluator", "plyfile", "tensorboard")
"""Libraries of the extras cuda and lab: named where they are installed."""
_LOOP = "raster_loops.*.nbi"
"""Of the loops that a first picture compiles, those that take longest."""
_SECONDS = 120
"""Seconds after which a probe counts as hanging.  The slowest, which loads torch, took 41 s for 2.8 s of a processor's time
while a dozen jobs shared two processors; half would leave it 19 s more."""


def examine() -> dict:
    """{"version", "pictures": bool, "items": [{"name", "status", "value", "remedy"}]}; status as in doctor_probes.STATUSES."""
    running = {name: _start(name) for name in PROBES}  # in parallel: each waits for libraries to load
    items = [_memory(), _processor(), _cache(), _loops(), _file_dialog(), _libraries()]
    found = [item for name, process in running.items() for item in _finish(name, process)]
    items = found + items
    able = any(item["name"] in ("OpenGL", "window") and item["status"] in ("ok", "warn") for item in items)
    return {"version": __version__, "pictures": able, "items": items}


def exit_code(report: dict) -> int:
    """0 where pictures can be made, 3 where there is no usable OpenGL."""
    return 0 if report["pictures"] else 3


def format_text(report: dict, width: int = 110) -> str:
    """The report for a person, in aligned columns."""
    names = max(len(entry["name"]) for entry in report["items"])
    indent = " " * (names + 11)
    lines = [f"pointglass {report['version']}"]
    for entry in report["items"]:
        head = f"{entry['status']:<7}  {entry['name']:<{names}}  "
        lines += textwrap.wrap(entry["value"], width, initial_indent=head, subsequent_indent=indent)
        if entry["remedy"]:
            lines += textwrap.wrap(
                entry["remedy"], width, initial_indent=f"{indent}-> ", subsequent_indent=f"{indent}   "
            )
    verdict = "pictures can be made" if report["pictures"] else "no pictures can be made: no usable OpenGL"
    return "\n".join([*lines, "", verdict]) + "\n"


# -- probes, each run in a process of its own -----------------------------------------------------------------------


def _start(name: str) -> subprocess.Popen:
    path = os.pathsep.join(filter(None, [str(import_root()), os.environ.get("PYTHONPATH")]))
    return subprocess.Popen(
        [sys.executable, "-P", "-m", f"{__package__}.doctor_probes", name], env=os.environ | {"PYTHONPATH": path},
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, errors="replace",
    )  # fmt: skip


def _finish(name: str, process: subprocess.Popen) -> list[dict]:
    """The probe's items, or one that reports how it failed."""
    remedy = "update the graphics driver; if it persists, report it with this output"
    try:
        out, err = process.communicate(timeout=_SECONDS)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
        return [item(name, "fail", f"the probe did not answer within {_SECONDS} s", remedy)]
    if process.returncode == 0 and out.strip():
        return json.loads(out.splitlines()[-1])
    last = err.strip().splitlines()[-1] if err.strip() else "no message"
    how = f"crashed (signal {-process.returncode})" if process.returncode < 0 else f"failed ({last})"
    return [item(name, "fail", f"the probe {how}", remedy)]


# -- checks without a driver -------------------------------------------------------------------------------------------


def _memory() -> dict:
    total, free = total_memory(), available_memory()
    if free is None or total is None:
        return item("memory", "skipped", "this system does not say how much memory there is")
    value = f"{total / GB:.1f} GB, {free / GB:.1f} GB of it available"
    if free < 2 * GB:
        return item("memory", "warn", value, "close other programs; large scans want 2 GB or more")
    return item("memory", "ok", value)


def _processor() -> dict:
    cores = usable_processors()
    return item("processor", "ok", f"{counted(cores, 'core')} for this process")


def _cache() -> dict:
    folder = cache_dir()
    there = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    remedy = "set POINTGLASS_CACHE to a folder that can be written and has room"
    try:
        if not there.is_dir():
            raise NotADirectoryError(20, "is a file")
        with tempfile.TemporaryFile(dir=there):
            pass
    except OSError as error:
        return item("cache", "fail", f"{folder}: cannot be written ({error.strerror}): scans cannot be kept", remedy)
    free = shutil.disk_usage(there).free
    value = f"{folder}: writable, {free / GB:.1f} GB free"
    return item("cache", "ok", value) if free > 2 * GB else item("cache", "warn", value, remedy)


def _loops() -> dict:
    """Where compiled loops are kept, and whether those of rendering are there: numba's index of one of them."""
    from ..model.common.loop_cache import kept_in

    package = Path(__file__).resolve().parent / "render" / "raster"
    configured = os.environ.get("NUMBA_CACHE_DIR")
    folder = Path(configured) if configured else kept_in(package)
    if folder is None:
        return item("compiled loops", "warn", "no folder to keep them in can be written: every process compiles them, which "
                    "takes about a minute", "set POINTGLASS_CACHE to a folder that you own and can write")
    where = "beside the modules" if package in folder.parents else str(folder)
    if any(folder.glob(_LOOP) if package in folder.parents else folder.glob(f"*/{_LOOP}")):
        return item("compiled loops", "ok", f"kept {where}; compiled")
    return item("compiled loops", "ok", f"kept {where}; compiled once, when they are first used, which takes about a minute; "
                f"beforehand: {sys.executable} -m {__package__}.compile_kernels")


def _file_dialog() -> dict:
    """The program that shows the desktop's own dialog for files."""
    from .window.file_dialog.file_dialogs import PROGRAMS

    if not sys.platform.startswith("linux"):
        return item("file dialog", "ok", "the system's own")
    found = next(filter(None, map(shutil.which, PROGRAMS)), None)
    return item("file dialog", "ok", found or f"pointglass's own, inside the window: none of {', '.join(PROGRAMS)} is there; "
                "for the desktop's own: apt install zenity")


def _required() -> tuple[str, ...]:
    """Names of the packages that pointglass requires, from its own metadata."""
    try:
        wanted = metadata.requires("pointglass") or []
    except metadata.PackageNotFoundError:
        return LIBRARIES
    names = [re.findall(r"[\w.-]+", re.split(r"[<>=!~;\s]", line, maxsplit=1)[0]) for line in wanted if "extra ==" not in line]
    return tuple(name for parts in names for name in parts)  # laspy[lazrs] gives both: the extra has the name of its package


def _libraries() -> dict:
    found, missing = [], []
    for name in (*_required(), *OPTIONAL):
        try:
            found.append(f"{name} {metadata.version(name)}")
        except metadata.PackageNotFoundError:
            if name not in OPTIONAL:
                missing.append(name)
    value = f"Python {sys.version.split()[0]}, {', '.join(found)}"
    if missing:
        return item("libraries", "fail", f"{value}; missing: {', '.join(missing)}", "install pointglass again")
    return item("libraries", "ok", value)
