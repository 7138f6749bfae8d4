"""Makes the GLFW window with an OpenGL 4.3 core context, or says in one line why there is none."""

import os

import numpy as np

from ...common.errors import DeviceError

_LEAST_SIZE = (320, 200)
"""Logical pixels below which the interface cannot be laid out."""


def make_window(glfw, size: tuple[int, int]):
    """A window with an OpenGL 4.3 core context.  Raises DeviceError with the cause."""
    problems: list[str] = []
    glfw.set_error_callback(lambda code, text: problems.append(os.fsdecode(text)))

    def cause() -> str:
        return problems[-1] if problems else "no reason given"

    if not glfw.init():
        raise DeviceError(f"no window can be opened ({cause()})",
                          remedy="set DISPLAY, or use `pointglass render` which needs no window")
    glfw.window_hint(glfw.CONTEXT_VERSION_MAJOR, 4)
    glfw.window_hint(glfw.CONTEXT_VERSION_MINOR, 3)
    glfw.window_hint(glfw.OPENGL_PROFILE, glfw.OPENGL_CORE_PROFILE)
    glfw.window_hint(glfw.CONTEXT_ROBUSTNESS, glfw.LOSE_CONTEXT_ON_RESET)  # a driver that was reset says so; others ignore it
    glfw.window_hint(glfw.SAMPLES, 0)
    glfw.window_hint(glfw.DEPTH_BITS, 0)
    glfw.window_hint(glfw.STENCIL_BITS, 0)
    glfw.window_hint(glfw.SCALE_TO_MONITOR, True)
    window = glfw.create_window(*size, "pointglass", None, None)
    if window:
        glfw.set_window_size_limits(window, *_LEAST_SIZE, glfw.DONT_CARE, glfw.DONT_CARE)
    else:
        reason = cause()
        glfw.terminate()
        raise DeviceError(f"OpenGL 4.3 is needed and the window could not have it ({reason})", remedy="see `pointglass doctor`")
    return window


def screen_scale(glfw, window) -> float:
    """Logical pixels per design unit (kit.theme) that the screen asks for, less what the framebuffer brings."""
    width, drawn = glfw.get_window_size(window)[0], glfw.get_framebuffer_size(window)[0]
    ratio = drawn / width if width and drawn else 1.0
    return float(np.clip(glfw.get_window_content_scale(window)[0] / ratio, 0.75, 4.0))
