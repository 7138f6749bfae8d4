"""A folder made by ``pointglass publish``, shown in a notebook: an iframe of a server on this computer.

Pages of a notebook may not open files, so that the folder is served, to this computer only, until the kernel ends.
"""

import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from ...common.errors import InputError
from ..arguments import PathLike, path_of

_SERVERS: dict[Path, ThreadingHTTPServer] = {}
"""Of this process, by folder."""


class _Quiet(SimpleHTTPRequestHandler):
    def log_message(self, format: str, *args: Any) -> None:
        """Writes nothing: a notebook's output is the page."""

    def list_directory(self, path: Any) -> None:
        """No listings."""
        self.send_error(404)


def show_published(folder: PathLike, *, width: str = "100%", height: int = 600) -> Any:
    """The published pages in a frame, as the value of a notebook's cell.

    folder: as ``pointglass publish --out`` made it.  It is served to this computer only (127.0.0.1), until the kernel ends: a
    kernel on another computer needs the folder on a web server instead.  width, height: of the frame, as in HTML and pixels.
    Raises InputError where the folder has no index.html, or IPython is missing.
    """
    path = path_of(folder).resolve()
    if not (path / "index.html").is_file():
        raise InputError("no index.html in it", file=path, remedy=f"make it with pointglass publish SCAN --out {path.name}")
    try:
        from IPython.display import IFrame
    except ImportError:
        raise InputError("show_published needs IPython", remedy="run it in a notebook, or open its index.html") from None
    if path not in _SERVERS:
        server = ThreadingHTTPServer(("127.0.0.1", 0), partial(_Quiet, directory=str(path)))
        threading.Thread(target=server.serve_forever, name=f"serves {path.name}", daemon=True).start()
        _SERVERS[path] = server
    return IFrame(f"http://127.0.0.1:{_SERVERS[path].server_address[1]}/index.html", width, height)
