"""The scan that is shown: its start viewpoint, what its notices offer, and when the camera stays although the points change.

Frame: file coordinates; up is the direction that the document calls up.
"""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ...common.text import printable
from ...picture.camera import Camera
from ...preprocess.scan_description import WarningTopic
from ...work.document import Document
from ...work.places.standing_place import viewpoint_worth
from ...work.places.start_view import standing_view, standing_view_in
from ...work.places.up_axis import turned, upright_axes
from ...work.project import project_beside
from ...work.scan_files import FilePart, sample_of_file
from ...work.viewpoint import Viewpoint
from ..flight.flight import Flight
from ..flight.navigation import FlyState, view_along
from ..flight.start_viewpoint import (
    Survey,
    brightening,
    darkness,
    far_apart,
    lying,
    near_survey,
    speed_in,
    start_state,
    state_of,
)
from ..kit.notices import OpenProject, ScanNotice
from .loading import Loaded, scan_notices

if TYPE_CHECKING:
    from ...grid.scene import Scene


_GOOD_START = 0.75
"""Share of the worth of the complete scan's start viewpoint from which on that of its preview is kept.  Measured: previews of
400,000 points have 0.95 (demo) and 0.86 (studio.laz), of 100,000 points 0.91 and 0.76; all are kept, as with half of this
value. At 1 the camera would move in each of these scans."""


class ShownScan:
    """scene: the one shown, None at first.  paths: its files.  preview: whether it is coarse and the complete one follows.
    start: the camera at which the next scan begins; None: one is chosen (viewer.window.flight.start_viewpoint).
    resume: the view at which the next scan begins, where the same scan was left at it; Home stays the chosen one.
    touched: whether a person has clicked at something in the scan, who then expects it to stay where it is."""

    def __init__(self, flight: Flight, start: Camera | None = None):
        self._flight = flight
        self.start = start
        self.resume: Viewpoint | None = None
        self.scene: Scene | None = None
        self.paths: tuple[Path, ...] = ()
        self.preview = self.touched = False
        self._seen: Survey | None = None
        self._inside = False  # whether it began standing in the scan
        self._chosen = False  # whether its start viewpoint was chosen here, not given

    def continues_with(self, loaded: Loaded) -> bool:
        """Whether the camera stays where it is when ``loaded`` is shown.

        It does after a scan's preview, and with other colours; but a person who has not moved yet is let into a scan of
        which the preview showed too little to stand in it.
        """
        if loaded.variant or loaded.same_work:
            return True
        stays = self.shows_scan_of(loaded)
        if stays and loaded.follows_preview and self._untouched and not self._inside:
            stays = standing_view(loaded.scene, loaded.seen) is None
        return stays

    @property
    def _untouched(self) -> bool:
        """Whether nobody has flown or clicked in this scan yet, or is about to."""
        return self._flight.at_home and not self._flight.gliding and not self.touched

    def shows_scan_of(self, loaded: Loaded) -> bool:
        """Whether the scan shown is that of ``loaded``: its preview, or the same files."""
        if loaded.follows_preview:
            return self.preview and set(loaded.paths) <= set(self.paths)
        return self.scene is not None and bool(loaded.paths) and loaded.paths == self.paths

    def variant(self, scene: "Scene") -> Loaded:
        """The scene shown with other marks, as something loaded that :meth:`continues_with`."""
        assert self._seen is not None
        return Loaded(scene, self._seen, self.paths, variant=True)

    def show(self, loaded: Loaded, *, stays: bool) -> None:
        """``loaded`` is shown from now on.  stays: as :meth:`continues_with` had it."""
        self._inside = stays and self._inside
        self.scene, self.paths, self.preview, self._seen = loaded.scene, loaded.paths, loaded.preview, loaded.seen
        if stays:
            self._flight.continue_in(loaded.seen)

    def begin(self, document: Document, aspect: float) -> None:
        """Puts the camera at the start viewpoint of the scene.  aspect: width over height of the picture."""
        assert self.scene is not None and self._seen is not None
        self.touched = False
        near = near_survey(self._seen)
        standing = standing_view(self.scene, near, upright_axes(document.up))
        self._inside = standing is not None
        state = state_of(standing, near, aspect, document.up)
        self._chosen = self.start is None and document.view is None
        if self.start is not None:
            state, self.start = _at(self.start, state), None
        if document.view is not None and document.view.orthographic is None:  # Home is a place in perspective
            state = _at(document.view.camera(16, 9), state)
        self._flight.begin(state, self._seen)
        resume, self.resume = self.resume, None
        if document.view is not None:
            self._flight.show(document.view.camera(16, 9))
        elif resume is not None and self._chosen:  # Home stays the start viewpoint that was chosen here
            self._chosen = False
            self._flight.show(resume.camera(16, 9))

    def mend_start(self, document: Document, aspect: float) -> None:
        """Flies to the complete scan's start viewpoint where that of its preview is much worse and nobody has moved yet."""
        if self.scene is None or self._seen is None or not (self._chosen and self._inside and self._untouched):
            return
        upright, old = upright_axes(document.up), self._flight.home
        level, new = turned(self._seen, upright), start_state(self.scene, self._seen, aspect, document.up)

        def worth(state: FlyState) -> float:
            return viewpoint_worth(level, state.position @ upright, state.forward @ upright)

        if worth(old) < _GOOD_START * worth(new):
            self._flight.home = new
            self._flight.glide_to(new)

    def turn_up(self, up: tuple[float, float, float], aspect: float) -> None:
        """Begins again with another direction that is up."""
        if self.scene is not None and self._seen is not None:
            self._flight.begin(start_state(self.scene, self._seen, aspect, up), self._seen)

    def show_file(self, part: FilePart, document: Document, aspect: float) -> bool:
        """Flies to a view of one file, from within where one can stand there.  Returns False where too few of its points are
        known."""
        seen = None if self.scene is None or self._seen is None else sample_of_file(self.scene, self._seen, part)
        if self.scene is None or seen is None:
            return False
        standing = standing_view_in(self.scene, seen, upright_axes(document.up))
        self._flight.glide_to(state_of(standing, replace(seen, speed=speed_in(seen)), aspect, document.up))
        return True

    def end(self) -> None:
        """No scene is shown any more."""
        self.scene, self.paths, self.preview = None, (), False
        self._flight.let_go()

    @property
    def exposure(self) -> float | None:
        """Exposure that a dark scan wants, stops; None before the first scan."""
        return None if self._seen is None else brightening(self._seen)

    def notices(self, document: Document, open_project: Path | None) -> list[ScanNotice]:
        """What there is to say about the scene, most important first.  open_project: the file that the document belongs to."""
        assert self.scene is not None and self._seen is not None
        known = bool(self.scene.meta.warnings_about(WarningTopic.PLACES))
        offers = (_project_beside(document, open_project), None if known else far_apart(self._seen), darkness(self._seen),
                  lying(self._seen, document.up))
        return scan_notices(self.scene.meta) + [offer for offer in offers if offer is not None]

    @property
    def title(self) -> str:
        """The scene in a few words."""
        return "pointglass" if self.scene is None else self.scene.meta.title


def _project_beside(document: Document, open_project: Path | None) -> ScanNotice | None:
    """An offer of the project that was saved beside a scan, where the scan was opened without it."""
    if document.view is not None or not document.scans:
        return None
    project = project_beside(document)
    if project == open_project or not project.is_file():
        return None
    return ScanNotice(f"{printable(project.name)} beside this scan holds saved work.", OpenProject(project))


def _at(camera: Camera, state: FlyState) -> FlyState:
    """Where ``camera`` is and looks, at the speed and with the up axis of ``state``."""
    return view_along(camera.position, camera.view_rotation[2], state.speed, state.upright)
