"""The widget of ``Scan.show``: passes events of the page to a GuidedView and its pictures back.  Needs anywidget."""

from pathlib import Path
from typing import Any

import anywidget
import traitlets

from ...common.errors import PointglassError
from ...picture.camera import Camera
from .guided_view import GuidedView


class ScanWidget(anywidget.AnyWidget):
    """A scan to look around in.  Messages of the page are answered one by one, each with a picture or an error.

    height: of the picture, logical pixels.  title: of the scan, for screen readers.
    """

    _esm = Path(__file__).with_name("scan_view.js")
    height = traitlets.Int(480).tag(sync=True)
    title = traitlets.Unicode("").tag(sync=True)

    def __init__(self, guided: GuidedView, **traits: Any):
        super().__init__(**traits)
        self._guided = guided
        self.on_msg(self._answer)

    @property
    def camera(self) -> Camera:
        """The camera of the picture that is shown at rest: for ``Scan.render``, or to be saved with ``write_cameras``."""
        return self._guided.camera()

    def _answer(self, _: Any, event: Any, _buffers: Any) -> None:
        if not isinstance(event, dict):
            return
        moving, number = event.get("moving") is True, event.get("number")
        try:
            self._guided.follow(event)
            data, (width, height) = self._guided.picture(moving)
        except PointglassError as error:
            self.send({"number": number, "error": str(error)})
            return
        self.send({"number": number, "moving": moving, "size": [width, height]}, [data])
