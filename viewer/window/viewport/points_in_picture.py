"""Whether a picture at rest shows any point of the scene: where it shows none, the window offers a way back (Session.lost)."""

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from ...render.frame import Frame
    from ..session.session import Session
    from .pixel_reader import PixelReader


class PointsInPicture:
    """Reads the depth of pictures at rest, without waiting for it."""

    def __init__(self, session: "Session", pixels: "PixelReader"):
        self._session, self._pixels = session, pixels
        self._unread: Frame | None = None

    def look(self, frame: "Frame", *, moving: bool) -> None:
        """Has a picture at rest looked at; never while some points are missing."""
        self._unread = None if moving or frame.facts.points_missing else frame
        if self._unread is None:
            self._session.lost = False
        else:
            self._pixels.read(frame, "depth")

    def follow(self) -> bool:
        """Takes the readings that have arrived.  Returns whether the session knows something new by it."""
        self._pixels.poll()
        if self._unread is None or (depth := self._pixels.read(self._unread, "depth")) is None:
            return False
        before, self._unread = self._session.lost, None
        self._session.lost = not np.isfinite(depth).any()
        return self._session.lost != before

    def forget(self) -> None:
        """Another scene is shown."""
        self._unread = None
