"""Whether the pointer is over the interface or over the picture, told between two frames of imgui.

Imgui's own answer is of the last frame's place of the pointer.  Where pictures take long, the pointer has moved since; a window
that was drawn last in the frame before that still counts, and a new one does not yet: a click on the picture would be lost, or
one on a dialog would set a point behind it.  Nor do the buttons count that imgui thinks are held or released: it takes one
change a frame, so that they may have been released since, and the next click is somewhere else.
"""

from typing import Any


def over_interface(imgui: Any, position: tuple[float, float]) -> bool:
    """Whether a pointer at a position, logical pixels of the window, is over what the last frame has drawn, no button being
    held.  Not to be called between new_frame and render."""
    if imgui.get_frame_count():
        for window in imgui.get_current_context().windows:
            window.was_active = window.active  # as new_frame does; only these are hit
        io = imgui.get_io()
        buttons = [(flags, flags.copy()) for flags in (io.mouse_down, io.mouse_clicked, io.mouse_released)]
        for flags, _ in buttons:
            flags[:] = False
        imgui.internal.update_hovered_window_and_capture_flags(imgui.ImVec2(*position))
        for flags, before in buttons:
            flags[:] = before
    return imgui.get_io().want_capture_mouse
