"""F12 and F9: save the picture, or frame times and their plot, and say where, or why not."""

from pathlib import Path

from viewer.errors import PointglassError
from viewer.text import counted
from viewer.tools.shot_metadata import KEY
from viewer.window import capture
from viewer.window.saved_picture import saved_picture
from viewer.window.session import Session
from viewer.window.viewport import Viewport

_RECORDING = "Recording frame times; F9 stops"


class SaveActions:
    """Saves what a session shows into ``folder``."""

    def __init__(self, session: Session, viewport: Viewport, folder: Path):
        self._session, self._painter, self._folder = session, viewport, folder

    def screenshot(self) -> Path | None:
        """Saves the picture as PNG and says where."""
        if self._session.scene is None:
            self._session.notices.toast("Nothing to save yet: drop a scan here first", instead_of="Nothing to ")
            return None
        try:
            path = capture.stamped("pointglass", ".png", self._folder)
            made = saved_picture(self._session, self._painter, path.stem)
            if made is None:
                return None
            image, shot = made
            capture.save_png(path, image, {KEY: shot.text()} if shot is not None else None)
        except PointglassError as error:
            self._session.notices.say("No screenshot was saved", str(error))
            return None
        again = "" if shot is not None else "; it shows a photograph or the tint, so `render --like` cannot draw it again"
        self._session.notices.toast(f"Saved {path}{again}")
        return path

    def record(self) -> Path | None:
        """Starts recording frame times, or stops and saves them."""
        session = self._session
        self._painter.settle()
        if session.recording is None and session.scene is None:
            session.notices.toast("Nothing to record yet: drop a scan here first", instead_of="Nothing to ")
            return None
        if session.recording is None:
            session.recording = capture.FrameTimes()
            session.notices.toast(_RECORDING)
            return None
        times, session.recording = session.recording, None
        session.notices.drop(_RECORDING)
        if not len(times):
            session.notices.toast("No frame was drawn meanwhile: nothing saved")
            return None
        path = capture.stamped("pointglass-frames", ".csv", self._folder)
        try:
            times.save(path)
            times.plot(path.with_suffix(".png"))
        except PointglassError as error:
            session.notices.say("The frame times were not saved", str(error))
            return None
        session.notices.toast(f"Saved {counted(len(times), 'frame')} to {path}")
        return path
