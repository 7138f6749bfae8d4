"""The widget of ``Scan.show``: passes events of the page to a GuidedView and its pictures back.  Needs anywidget.

JupyterLab delivers messages of widgets on a thread of their own where the kernel has such (subshells, ipykernel 7).  A scan
makes its pictures on one thread: events are handed to the loop of the thread that made the widget, where cells run too.
"""

import asyncio
import threading
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
        self._thread = threading.current_thread()
        try:
            self._loop = asyncio.get_running_loop()
        except RuntimeError:  # no notebook: messages come on the thread that handles them
            self._loop = None
        self.on_msg(self._receive)

    @property
    def camera(self) -> Camera:
        """The camera of the picture that is shown at rest: for ``Scan.render``, or to be saved with ``write_cameras``."""
        return self._guided.camera()

    def _receive(self, _: Any, event: Any, _buffers: Any) -> None:
        if not isinstance(event, dict):
            return
        if self._loop is None or threading.current_thread() is self._thread:
            self._answer(event)
        else:
            self._loop.call_soon_threadsafe(self._answer, event)

    def _answer(self, event: dict[str, Any]) -> None:
        moving, number = event.get("moving") is True, event.get("number")
        try:
            self._guided.follow(event)
            data, (width, height) = self._guided.picture(moving)
        except PointglassError as error:
            self.send({"number": number, "error": str(error)})
            return
        self.send({"number": number, "moving": moving, "size": [width, height]}, [data])
