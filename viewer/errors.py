"""Errors a person is meant to read: one line that names the file, the value and the remedy, and an exit code.

Anything else that escapes is a bug and keeps its traceback.
"""


class PointglassError(Exception):
    """Base of all anticipated failures.  ``str(error)`` is the one line shown; ``exit_code`` what the process returns."""

    exit_code = 2


class InputError(PointglassError):
    """Bad usage or bad input (exit code 2)."""

    exit_code = 2


class DeviceError(PointglassError):
    """No usable OpenGL or compute device (exit code 3)."""

    exit_code = 3


class Cancelled(PointglassError):
    """The person asked long work to stop; whatever was being written has been removed."""

    exit_code = 130
