"""The base class of every anticipated failure, shared by ``model`` and ``viewer``."""


class PointglassError(Exception):
    """A failure that a person is told about in one line.  ``str(error)`` is that line and names the file or option, the value
    and the remedy; ``exit_code`` is what the process returns.  Any other exception is a bug and keeps its traceback."""

    exit_code = 2
