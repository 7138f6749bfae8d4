"""F12 and F9: save the picture, or frame times and their plot, and say where, or why not.

A picture of the window's size is read from the screen; larger ones and panoramas are rendered beside the window.
"""

import os
from contextlib import ExitStack
from pathlib import Path

from ...common.errors import PointglassError
from ...common.text import counted
from ...work.pictures.shot_metadata import KEY, cannot_repeat
from ..file_dialog.file_dialogs import FileDialogs
from ..kit.notices import ToastSubject
from ..kit.worker import Worker
from ..session.session import Session
from ..session.time_recording import FrameTimes
from ..viewport.viewport import Viewport
from . import capture
from .over_picture import over_picture
from .points_export import PointsExport
from .saved_picture import saved_picture, shot_of
from .still_job import StillJob, still_worker

_LAST_WAIT = 5.0
"""Seconds that a closing window waits for a picture that is being rendered; a network cannot be interrupted there."""
PURPOSE = "pictures"
"""Of the remembered folder (viewer.window.file_dialog)."""
_RECORDING = "Recording frame times; F9 stops"


class SaveActions:
    """Saves what a session shows under new names in the folder of pictures, which a person chooses and which is remembered.

    folder: where pictures go until then.  still: the picture that is being rendered beside the window, else None.
    points: exports points."""

    def __init__(self, session: Session, viewport: Viewport, files: FileDialogs, folder: Path | None = None):
        self._session, self._painter, self._files, self._usual = session, viewport, files, folder
        self.still: Worker | None = None
        self._name = ExitStack()  # keeps the name of the still reserved
        self.points = PointsExport(session, files)

    @property
    def folder(self) -> Path:
        """Where pictures go: as chosen, else the working folder, or the home folder where that cannot be written to."""
        usual = self._usual or (Path.cwd() if os.access(Path.cwd(), os.W_OK) else Path.home())
        chosen = self._files.folders.folder_of(PURPOSE)
        return chosen if chosen is not None and chosen.is_dir() else usual

    def choose_folder(self) -> None:
        """Asks where pictures and recordings go."""
        self._files.open_folder(PURPOSE, "Folder of pictures and recordings",
                                lambda folder: self._session.notices.toast(f"Pictures are saved in {folder}"))

    def screenshot(self) -> Path | None:
        """Saves the picture as PNG and says where; a larger one is begun.  Returns its path, None where there is none."""
        if self._session.scene is None:
            self._session.notices.toast("Nothing to save yet: drop a scan here first", subject=ToastSubject.NOTHING_OPEN)
            return None
        try:
            with ExitStack() as name:
                path = name.enter_context(capture.stamped("pointglass", ".png", self.folder))
                shot = shot_of(self._session, path.stem)
                over = over_picture(self._session)
                if boxes := over.boxes:
                    self._session.notices.toast(f"In the picture, {boxes}")
                if shot is not None and self._session.work.shot_scale > 1:
                    return self._begin(StillJob(self._session.scene, shot, path, over=over), name)
                made = saved_picture(self._session, self._painter, path.stem)
                if made is None:
                    return None
                image, shot = made
                height, width = image.shape[:2]
                image = over.drawn(image, self._session.camera.resized(width, height))
                text = cannot_repeat("a photograph or the tint") if shot is None else {KEY: shot.text()}
                capture.save_png(path, image, text)
        except PointglassError as error:
            self._session.notices.say("No screenshot was saved", error)
            return None
        shows = "a photograph or the tint"
        again = "" if shot is not None else f"; it shows {shows}, so `render --like` cannot draw it again"
        if shot is None and self._session.work.shot_scale > 1:
            again += ", and it has the window's size"
        self._session.notices.tell_saved(path, f"Saved {path}{over.text}{again}")
        return path

    def panorama(self, size: tuple[int, int]) -> Path | None:
        """Begins a 360-degree picture around the camera, ``size`` pixels.  Returns its path, None where there is none."""
        if self._session.flight.orthographic is not None:
            self._session.notices.toast("A panorama is made in perspective: press X first")
            return None
        try:
            with ExitStack() as name:
                path = name.enter_context(capture.stamped("pointglass-panorama", ".png", self.folder))
                shot = shot_of(self._session, path.stem)
                if shot is None or self._session.scene is None:
                    self._session.notices.toast("A panorama shows no tint or photograph: put them away first")
                    return None
                return self._begin(StillJob(self._session.scene, shot, path, panorama=size), name)
        except PointglassError as error:
            self._session.notices.say("No panorama was saved", error)
            return None

    def _begin(self, job: StillJob, name: ExitStack) -> Path | None:
        """Begins a still.  name: what keeps its name reserved, until it is saved."""
        if self.still is not None:
            self._session.notices.toast("The last picture is still being rendered")
            return None
        width, height = job.panorama or (job.shot.spec.camera.width, job.shot.spec.camera.height)
        self._name = name.pop_all()
        self.still = still_worker(job, self._session.loads.wake)
        self._session.notices.toast(f"Rendering {width} x {height} pixels beside the window…")
        return job.out

    @property
    def unfinished(self) -> list[str]:
        """What would be lost if the window closed now, in sentences."""
        return (["A picture is being rendered."] if self.still is not None else []) + self.points.unfinished

    @property
    def workers(self) -> list[Worker]:
        """Work under way beside the window."""
        return [worker for worker in (self.still, self.points.worker) if worker is not None]

    def follow(self) -> None:
        """Called in every turn of the loop: says where a picture was saved that is ready, or why not."""
        self.points.follow()
        if self.still is None or not self.still.finished:
            return
        done, self.still = self.still, None
        self._name.close()
        if done.error is not None:
            self._session.notices.say("The picture was not saved", done.error)
        elif done.result is None:
            self._session.notices.toast("The picture was given up")
        else:
            self._session.notices.tell_saved(done.result)

    def close(self) -> None:
        """Waits a little for a picture that is being rendered; the file appears whole or not at all.  Ends an export."""
        self.points.close()
        if self.still is not None:
            self.still.join(_LAST_WAIT)
        self._name.close()

    def record(self) -> Path | None:
        """Starts recording frame times, or stops and saves them."""
        session = self._session
        self._painter.settle()
        if session.recording is None and session.scene is None:
            session.notices.toast("Nothing to record yet: drop a scan here first", subject=ToastSubject.NOTHING_OPEN)
            return None
        if session.recording is None:
            session.recording = FrameTimes()
            session.notices.toast(_RECORDING, subject=ToastSubject.RECORDING)
            return None
        times, session.recording = session.recording, None
        session.notices.drop(ToastSubject.RECORDING)
        if not len(times):
            session.notices.toast("No frame was drawn meanwhile: nothing saved")
            return None
        try:
            with capture.stamped("pointglass-frames", ".csv", self.folder) as path:
                capture.write_beside(path, times.csv())
                capture.write_beside(path.with_suffix(".png"), times.plot())
        except PointglassError as error:
            session.notices.say("The frame times were not saved", error)
            return None
        session.notices.list_saved(path.with_suffix(".png"))
        session.notices.tell_saved(path, f"Saved {counted(len(times), 'frame')} to {path}")
        return path
