"""What graphics drivers print while they start (libEGL, Mesa) goes to the log, not beside the one line of an error."""

import contextlib
import logging
import os
import tempfile
from collections.abc import Iterator

from ....model.common.process.signals import cleaned

_log = logging.getLogger(__name__)


@contextlib.contextmanager
def messages_logged() -> Iterator[None]:
    """Within the block, what is written to the process's standard error goes to the log.

    The file descriptor is replaced, since drivers do not write through Python.
    """
    try:
        shown, kept = os.dup(2), tempfile.TemporaryFile()  # noqa: SIM115  (closed below)
    except OSError:  # standard error is closed, or there is no room
        yield
        return

    def restore() -> None:
        os.dup2(shown, 2)

    try:
        with cleaned(restore):
            os.dup2(kept.fileno(), 2)
            yield
        kept.seek(0)
        for line in kept.read(1 << 16).decode("utf-8", "replace").splitlines():
            _log.info("graphics driver: %s", line)
    finally:
        os.close(shown)
        kept.close()
