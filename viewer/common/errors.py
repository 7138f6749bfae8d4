"""Errors that a person reads: one line that names the file or option, the value and the remedy, and an exit code.

Any other exception that escapes is a bug and keeps its traceback.
"""

import sys

from ...model.common.errors import Option, PointglassError, Words

__all__ = ["Cancelled", "DeviceError", "DeviceLostError", "InputError", "Option", "PointglassError", "Words",
           "is_opengl_error"]


class InputError(PointglassError):
    """Bad usage or bad input (exit code 2)."""

    exit_code = 2


class DeviceError(PointglassError):
    """No usable OpenGL or compute device, or not enough of its memory (exit code 3)."""

    exit_code = 3


class DeviceLostError(DeviceError):
    """The device was reset, lost or hangs: the process cannot go on with it (exit code 3)."""


class Cancelled(PointglassError):
    """The person cancelled long work; unfinished files have been removed (exit code 130)."""

    exit_code = 130


def is_opengl_error(error: BaseException) -> bool:
    """Whether moderngl raised this error.  Does not load moderngl: an error of its own means that it is loaded."""
    moderngl = sys.modules.get("moderngl")
    return moderngl is not None and isinstance(error, moderngl.Error)
