"""The notices about a scan that are shown, and what they offer: colours as scanned, all points, a brighter picture, another up
axis."""

from dataclasses import replace
from typing import TYPE_CHECKING

from ...common.text import counted
from ...picture.edits import UP_AXES
from ...work.project import moves_of
from ..kit.notices import Brighten, CallUp, KeepAsScanned, LoadAllPoints, Offer, OpenProject, ScanNotice

if TYPE_CHECKING:
    from .session import Session


def current_notices(session: "Session") -> list[ScanNotice]:
    """The notices about the scan shown, without that of a dark scan while its exposure is raised as far as it offers; and about
    a preview that stays because its load was cancelled or failed."""
    offered = session.shown_scan.exposure
    brightened = offered is not None and session.document.look.exposure >= offered
    found = [notice for notice in session.notices.of_scan if not (brightened and isinstance(notice.offer, Brighten))]
    loads = session.loads
    if session.scene is not None and session.shown_scan.preview and loads.current is None and not loads.reading.on:
        found.append(ScanNotice(f"This is a preview of {counted(session.scene.count, 'point')}.", LoadAllPoints()))
    return found


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
