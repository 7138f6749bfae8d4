"""The doctor's probes: every check that uses a driver, each run in its own process.

``python -m pointglass.viewer.doctor_probes NAME`` prints the items of one probe as a line of JSON.

An item is one line of the report; its sizes are in units for a person.
"""

import json
import os
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING

from .common.errors import PointglassError

if TYPE_CHECKING:
    import moderngl

    from .render.device.shader import Programs

STATUSES = ("ok", "warn", "fail", "skipped")
GB = 1e9
_WORDS = 4096
"""Words that the self-test mixes: 64 workgroups."""


def item(name: str, status: str, value: str, remedy: str = "") -> dict:
    """One line of the report; status as in STATUSES."""
    return {"name": name, "status": status, "value": value, "remedy": remedy}


def _probe_opengl() -> list[dict]:
    from moderngl import Error as OpenGLError

    from .render.device.context import create_context, describe_device

    remedy = "install the GPU's driver, or Mesa's software one: apt install libegl1 libgl1-mesa-dri"
    try:
        context = create_context()
    except PointglassError as error:
        return [item("OpenGL", "fail", str(error), remedy)]
    device = describe_device(context)
    what = f"{device.renderer}, OpenGL {device.version} through EGL"
    try:
        passed = compute_works(context)
        problem = "the self-test's compute pass gave wrong numbers"
    except (PointglassError, OpenGLError) as error:
        passed, problem = False, f"the self-test failed: {' '.join(str(error).split())}"
    limits = (
        f"pictures up to {device.texture_limit} pixels a side, {device.storage_limit / 2**20:.0f} MiB a storage "
        f"buffer, {context.info['GL_MAX_COMPUTE_WORK_GROUP_INVOCATIONS']} threads a work group"
    )
    if not passed:
        status, value, remedy = "fail", f"{what}; {problem}", "update the graphics driver, or use Mesa's software one"
    elif device.software:
        status, value = "warn", f"{what}; runs on the processor; self-test passed"
        remedy = "pictures are right but slow; if this machine has a GPU, install its driver"
    else:
        status, value, remedy = "ok", f"{what}; self-test passed", ""
    return [item("OpenGL", status, value, remedy), item("limits", "ok", limits), _gpu_memory(context)]


def _gpu_memory(context: "moderngl.Context") -> dict:
    """Free memory of the device that draws, what says so, and how much of it the points of a scan may take."""
    from .render.device.gpu_memory import free_memory, point_budget

    memory, (budget, source) = free_memory(context), point_budget(context)
    free = "unknown" if memory.free is None else f"{memory.free / GB:.1f} GB"
    total = "" if memory.total is None else f" of {memory.total / GB:.1f} GB"
    value = f"{free}{total} free ({memory.source}); for points at most {budget / GB:.1f} GB: {source}"
    if memory.free is not None:
        return item("GPU memory", "ok", value)
    return item("GPU memory", "warn", value, "raise the limit for large scans with --gpu-memory")


def compute_works(context: "moderngl.Context") -> bool:
    """Mixes random words in a compute pass and compares each with NumPy's."""
    import numpy as np

    from .render.device.self_test import run_self_test
    from .render.device.shader import Programs

    programs = Programs(context)
    words = np.random.default_rng(0).integers(0, 2**32, _WORDS, np.uint32)
    source, target = context.buffer(words.tobytes()), context.buffer(reserve=words.nbytes)
    run_self_test(programs, 0, source, target, _WORDS)
    made = np.frombuffer(target.read(), np.uint32)
    index = np.arange(_WORDS, dtype=np.uint32)
    for owned in (source, target, programs):
        owned.release()
    return bool(np.array_equal(made, words * np.uint32(1664525) + (index ^ np.uint32(1013904223))))


def _probe_window() -> list[dict]:
    names = [name for name in ("WAYLAND_DISPLAY", "DISPLAY") if os.environ.get(name)]
    if sys.platform.startswith("linux") and not names:
        return [item(
            "window", "skipped", "neither DISPLAY nor WAYLAND_DISPLAY is set: no window here",
            "`pointglass render` needs none; over ssh, use ssh -X, a remote desktop, or xvfb-run",
        )]  # fmt: skip
    where = ", ".join(f"{name}={os.environ[name]}" for name in names) or sys.platform
    import imgui_bundle  # isort: skip  # noqa: F401  (brings the library that glfw then loads)
    import glfw  # isort: skip

    problems: list[str] = []
    glfw.set_error_callback(lambda code, text: problems.append(os.fsdecode(text)))
    if not glfw.init():
        return [item("window", "fail", f"no window system answers on {where}: {_last(problems)}",
                     "check the display, or use `pointglass render`")]  # fmt: skip
    glfw.window_hint(glfw.CONTEXT_VERSION_MAJOR, 4)
    glfw.window_hint(glfw.CONTEXT_VERSION_MINOR, 3)
    glfw.window_hint(glfw.OPENGL_PROFILE, glfw.OPENGL_CORE_PROFILE)
    glfw.window_hint(glfw.VISIBLE, False)
    window = glfw.create_window(64, 64, "pointglass doctor", None, None)
    if not window:
        glfw.terminate()
        return [item("window", "fail", f"{where}: a window with OpenGL 4.3 could not be made: {_last(problems)}",
                     "install the GPU's driver; macOS stops at OpenGL 4.1")]  # fmt: skip
    glfw.make_context_current(window)
    from .render.device.context import create_context, describe_device

    try:
        device = describe_device(create_context(headless=False))
        found = item("window", "ok", f"{where}; OpenGL {device.version} on {device.renderer}")
    except PointglassError as error:
        found = item("window", "fail", str(error), "install the GPU's driver")
    glfw.terminate()
    return [found]


def _last(problems: list[str]) -> str:
    return problems[-1] if problems else "no reason given"


def _probe_network() -> list[dict]:
    import torch

    from ..model.network.reconstruct import cuda_problem, fast_precision
    from ..model.network.weights_folder import shipped, weights_dir

    problem = cuda_problem()
    precision = fast_precision("cpu")
    cpu = "bf16, which this processor multiplies in hardware" if precision == "bf16" else "fp32; no bf16 in hardware"
    if problem is None:
        used, count = torch.cuda.current_device(), torch.cuda.device_count()
        properties = torch.cuda.get_device_properties(used)
        which = f" (device {used} of {count})" if count > 1 else ""
        value = f"{properties.name}{which}, {properties.total_memory / GB:.0f} GB, CUDA {torch.version.cuda}, network in fp16"
        cuda = item("CUDA", "ok", value)
    else:
        remedy = "the network runs on the processor; with an NVIDIA GPU, install its driver and a CUDA build of torch"
        cuda = item("CUDA", "skipped", problem, remedy)
    names = shipped()
    weights = (
        item("weights", "ok", ", ".join(names))
        if names
        else item("weights", "warn", f"none in {weights_dir()}: no neural view", "train some with `pointglass train`")
    )
    return [item("torch", "ok", f"{torch.__version__}; on the processor {cpu}"), cuda, weights]


def _probe_interop() -> list[dict]:
    from ..model.network.reconstruct import cuda_problem

    if problem := cuda_problem():
        return [item("interop", "skipped", f"OpenGL to CUDA: {problem}; frames are copied through memory")]
    from .render.device.context import create_context
    from .render.device.shader import Programs

    try:
        context = create_context()
    except PointglassError as error:
        return [item("interop", "warn", str(error), "frames are copied through memory, which is right but slower")]
    return [interop_item(Programs(context))]


def interop_item(programs: "Programs") -> dict:
    """Whether OpenGL's buffers can be mapped into CUDA, by each library that could; the first that works is used.

    Making a bridge runs the test: a pattern written by OpenGL, changed by torch, read by OpenGL.
    """
    from .render.device.match_device import use_matching_device
    from .render.network.cuda_bridge import MAPPERS, CudaBridge

    matched = use_matching_device(programs.context)
    where = "" if matched.index is None else f"; {matched.how}"
    found: dict[str, str | None] = {}  # problem of each library, None where it works
    for name in MAPPERS:
        try:
            CudaBridge(programs, (64, 48), (name,)).release()
            found[name] = None
        except PointglassError as error:
            found[name] = str(error)
    works = [name for name, problem in found.items() if problem is None]
    broken = list(dict.fromkeys(problem for problem in found.values() if problem is not None))  # both may report the same
    if not works:
        return item("interop", "warn", "; ".join(broken) + where, "frames are copied through memory, which is right but slower")
    value = f"OpenGL buffers are mapped into CUDA by {works[0]}, nothing is copied; self-test passed{where}"
    if broken:
        return item("interop", "ok", f"{value}; not by the other: {'; '.join(broken)}")
    return item("interop", "ok", f"{value}; {' and '.join(works[1:])} would do too" if works[1:] else value)


PROBES: dict[str, Callable[[], list[dict]]] = {
    "OpenGL": _probe_opengl,
    "window": _probe_window,
    "network": _probe_network,
    "interop": _probe_interop,
}


if __name__ == "__main__":
    print(json.dumps(PROBES[sys.argv[1]]()))
