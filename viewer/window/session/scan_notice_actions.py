"""What the notices about a scan offer: colours as scanned, all points, a brighter picture, another up axis."""

from dataclasses import replace
from typing import TYPE_CHECKING

from ...picture.edits import UP_AXES
from ...work.project import moves_of
from ..kit.notices import Brighten, CallUp, KeepAsScanned, LoadAllPoints, Offer, OpenProject

if TYPE_CHECKING:
    from .session import Session


def act_on_notice(session: "Session", offer: Offer) -> None:
    """Does what a ScanNotice offers."""
    match offer:
        case KeepAsScanned():
            session.loads.open(session.shown_scan.paths, as_scanned=True, moves=moves_of(session.document.scans))
        case LoadAllPoints():
            session.loads.open(session.shown_scan.paths, moves=moves_of(session.document.scans), whole=True)
        case Brighten() if (exposure := session.shown_scan.exposure) is not None:
            session.work.edit("Brighten the dark scan", look=replace(session.document.look, exposure=exposure))
        case OpenProject(file):
            session.open([file])
        case CallUp(axis) if session.scene is not None:
            session.work.edit(f"Up axis {axis}", up=UP_AXES[axis])
            session.shown_scan.turn_up(UP_AXES[axis], session.area.aspect)
            session.picture.renew()
