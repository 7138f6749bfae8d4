"""The base class of every anticipated failure, shared by ``model`` and ``viewer``."""

from .printable import printable

INSTALL_LAB = "pip install 'pointglass[lab]'"
"""Installs the libraries that only training and the evaluation of rooms use."""


class PointglassError(Exception):
    """A failure that is reported to the user in one line.

    ``str(error)`` is that line, printable: file or option, value and remedy.  ``exit_code`` is the exit code of the process.
    Any other exception is a bug and keeps its traceback.
    """

    exit_code = 2

    def __str__(self) -> str:
        return printable(super().__str__())


class DataError(PointglassError):
    """Data for training or evaluation that cannot be used; the message names the files and the remedy."""
