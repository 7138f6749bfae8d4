"""A web server on the loopback address that gives files by ranges, as the object stores do, with faults on demand."""

import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from hashlib import md5
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import unquote, urlsplit


class Served:
    """files: path -> bytes.  requests: of each answer (path, first, last), with -1 for whole files.  sent: bytes.  queries: of
    each request.  headers: of the last request.  refuse: path -> status.  whole_only: no ranges.  cuts: answers that still are
    to break off in the middle.  busy: answers that still are to be 503.  changes_after: answers after which the files of
    ``later`` take the place of those before.  delay: seconds before each answer."""

    def __init__(self, files: dict[str, bytes]):
        self.files, self.requests, self.sent = dict(files), [], 0
        self.refuse: dict[str, int] = {}
        self.whole_only, self.cuts, self.silences, self.busy = False, 0, 0, 0
        self.changes_after: int | None = None
        self.later: dict[str, bytes] = {}
        self.queries: list[str] = []
        self.headers: dict[str, str] = {}
        self.delay = 0.0
        self.lock = threading.Lock()
        self.address = ""


@contextmanager
def served(files: dict[str, bytes]) -> Iterator[Served]:
    """The server, until the block ends.  ``address``: http://127.0.0.1:PORT."""
    state = Served(files)
    ended = threading.Event()
    tags: dict[int, tuple[bytes, str]] = {}  # the data is kept with its tag: its number names no other meanwhile

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_GET(self):
            parts = urlsplit(self.path)
            path = unquote(parts.path).lstrip("/")
            with state.lock:
                state.queries.append(parts.query)
                state.headers = {name.lower(): value for name, value in self.headers.items()}
                if state.changes_after is not None and len(state.requests) >= state.changes_after:
                    state.files.update(state.later)
                busy, cut, silent = state.busy > 0, False, False
                state.busy -= busy
            status = 503 if busy else state.refuse.get(path) or (0 if path in state.files else 404)
            if status:
                self.send_response(status)
                self.send_header("Content-Length", "0")
                self.end_headers()
                return
            data = state.files[path]
            tag = tags.setdefault(id(data), (data, md5(data).hexdigest()))[1]
            match = None if state.whole_only else re.match(r"bytes=(\d+)-(\d*)", self.headers.get("Range", ""))
            first, last = (int(match[1]), min(int(match[2] or len(data)), len(data) - 1) + 1) if match else (0, len(data))
            with state.lock:
                state.requests.append((path, first if match else -1, last))
                if state.cuts > 0 and last - first > 1:
                    cut, state.cuts = True, state.cuts - 1
                elif state.silences > 0 and last - first > 1:
                    silent, state.silences = True, state.silences - 1
            threading.Event().wait(state.delay)
            self.send_response(206 if match else 200)
            if match:
                self.send_header("Content-Range", f"bytes {first}-{last - 1}/{len(data)}")
            self.send_header("Content-Length", str(last - first))
            self.send_header("ETag", f'"{tag}"')
            self.send_header("Last-Modified", "Wed, 21 Oct 2015 07:28:00 GMT")
            self.end_headers()
            end = first + (last - first) // 2 if cut or silent else last
            try:
                self.wfile.write(data[first:end])
            except OSError:
                return
            with state.lock:
                state.sent += end - first
            if silent:
                self.wfile.flush()
                ended.wait()
            if cut or silent:
                self.wfile.flush()
                self.connection.close()
                self.close_connection = True

        def log_message(self, *_: object):
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    state.address = f"http://127.0.0.1:{server.server_port}"
    try:
        yield state
    finally:
        ended.set()
        server.shutdown()
        server.server_close()
