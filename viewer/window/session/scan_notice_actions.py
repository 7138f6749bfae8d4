"""What the notices about a scan offer: colours as scanned, all points, a brighter picture, another up axis."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ...picture.edits import UP_AXES

if TYPE_CHECKING:
    from .session import Session


def act_on_notice(session: "Session", action: str) -> None:
    """Does what a ScanNotice offers.  action: its key."""
    if action == "as_scanned":
        session.loads.open(session.visit.paths, as_scanned=True)
    elif action == "open_fully":
        session.loads.open(session.visit.paths)
    elif action == "brighten" and (exposure := session.visit.exposure) is not None:
        session.work.edit("Brighten the dark scan", look=replace(session.document.look, exposure=exposure))
    elif action.startswith("open "):
        session.open([Path(action.removeprefix("open "))])
    elif action.startswith("up ") and session.scene is not None:
        name = action.removeprefix("up ")
        session.work.edit(f"Up axis {name}", up=UP_AXES[name])
        session.visit.turn_up(UP_AXES[name], session.area.aspect)
        session.picture.renew()
