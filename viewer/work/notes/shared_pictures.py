"""Which attached pictures leave this machine in a report or a page: those beside their project, and those attached here.

A project names its pictures by paths, and may come from a stranger: with the path of a person's own photograph in it, what this
person makes of the project and sends back would hold that photograph.  So a picture outside the project's folder counts only
where it was attached in a window of this machine, which the user's state folder remembers.
"""

import logging
import os
from pathlib import Path

from ....model.common.files.state_folder import state_dir
from ...common.errors import InputError
from ...common.state_files import read_state, write_state
from ...readers.own_folder import is_inside

_FILE = "attached.json"
_MOST = 10_000
"""Paths that are remembered, the latest: a megabyte."""
_log = logging.getLogger(__name__)


def remember_attached(path: str) -> None:
    """A person attached this picture here.  What cannot be written is logged: then the picture stays out of what is sent."""
    known = _attached_here()
    whole = os.path.realpath(path)
    try:
        write_state(state_dir() / _FILE, [*(other for other in known if other != whole), whole][-_MOST:])
    except OSError as error:
        _log.warning("%s is not remembered as attached here (%s)", path, error.strerror or error)


def check_shared(path: str, project: Path | None) -> None:
    """Raises InputError, naming the picture, where it may not be part of what is made of a project for others.

    project: the project's file, None for work that has never been saved: all its pictures were attached here.
    """
    if project is not None and is_inside(project.parent, Path(path)):
        return
    if os.path.realpath(path) not in _attached_here():
        raise InputError("is left out: it lies outside the project's folder and was not attached on this machine",
                         file=Path(path),
                         remedy="copy it beside the project, or attach it again")


def _attached_here() -> list[str]:
    return read_state(state_dir() / _FILE, lambda rows: [str(row) for row in rows], [])
