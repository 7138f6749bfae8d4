"""Firefox on a display in memory (headless it has no WebGL without a GPU), driven through WebDriver BiDi: as chromium.Page."""

import base64
import itertools
import json
import os
import re
import secrets
import shutil
import signal
import socket
import struct
import subprocess
import time

PROGRAM = next((found for name in ("firefox", "firefox-esr") if (found := shutil.which(name))), None)
PROGRAM = PROGRAM if shutil.which("xvfb-run") else None
_KEYS = {"ArrowUp": "\ue013", "Escape": "\ue00c", "Enter": "\ue007"}
_PREFERENCES = {"webgl.force-enabled": True, "webgl.forbid-software": False, "widget.dmabuf.enabled": False,
                "gfx.x11-egl.force-enabled": True, "datareporting.policy.dataSubmissionEnabled": False,
                "browser.shell.checkDefaultBrowser": False, "remote.active-protocols": 1}  # fmt: skip


class Page:
    """One page.  complaints: errors and warnings of its console.  requests: addresses it asked for."""

    def __init__(self, profile, width=1280, height=720):
        assert PROGRAM is not None
        profile.mkdir()
        lines = [f"user_pref({json.dumps(key)}, {json.dumps(value)});\n" for key, value in _PREFERENCES.items()]
        (profile / "user.js").write_text("".join(lines))
        line = ["xvfb-run", "-a", PROGRAM, "--no-remote", "--profile", str(profile), "--remote-debugging-port", "0",
                "about:blank"]  # fmt: skip
        self._process = subprocess.Popen(line, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
                                         env=os.environ | {"HOME": str(profile)}, start_new_session=True)
        assert self._process.stderr is not None
        address = re.compile(r"BiDi listening on ws://([^:]+):(\d+)")
        found = next(match for each in self._process.stderr if (match := address.search(each)))
        self._numbers, self.complaints, self.requests = itertools.count(1), [], []
        self._socket = _connected(found[1], int(found[2]))
        self._file = self._socket.makefile("rb")
        self._ask("session.new", capabilities={})
        self._context = self._ask("browsingContext.getTree")["contexts"][0]["context"]
        self._ask("session.subscribe", events=["log.entryAdded", "network.beforeRequestSent"])
        self._ask("browsingContext.setViewport", context=self._context, viewport={"width": width, "height": height})

    def open(self, address):
        self._ask("browsingContext.navigate", context=self._context, url=address, wait="none")

    def value(self, expression):
        """The value of an expression, waited for where it is a promise."""
        text = f"Promise.resolve({expression}).then((value) => JSON.stringify(value) ?? 'null')"
        found = self._ask("script.evaluate", expression=text, target={"context": self._context}, awaitPromise=True)
        assert found["type"] == "success", found
        return json.loads(found["result"]["value"])

    def until(self, expression, seconds=60.0):
        end = time.monotonic() + seconds
        while not (value := self.value(expression)):
            assert time.monotonic() < end, (expression, self.complaints)
            time.sleep(0.02)
        return value

    def click(self, x, y):
        press = [{"type": kind, "button": 0} for kind in ("pointerDown", "pointerUp")]
        steps = [{"type": "pointerMove", "x": x, "y": y}, *press]
        self._act({"type": "pointer", "id": "mouse", "parameters": {"pointerType": "mouse"}, "actions": steps})

    def key(self, name):
        key = _KEYS.get(name, name)
        self._act({"type": "key", "id": "keys", "actions": [{"type": kind, "value": key} for kind in ("keyDown", "keyUp")]})

    def screenshot(self):
        """The window as PNG, base64."""
        return self._ask("browsingContext.captureScreenshot", context=self._context)["data"]

    def close(self):
        os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        self._socket.close()

    def _act(self, source):
        self._ask("input.performActions", context=self._context, actions=[source])

    def _ask(self, method, **parameters):
        number = next(self._numbers)
        self._send(json.dumps({"id": number, "method": method, "params": parameters}).encode())
        while True:
            answer = json.loads(self._next())
            if answer.get("id") == number:
                assert answer["type"] == "success", (method, answer)
                return answer["result"]
            self._note(answer.get("method"), answer.get("params", {}))

    def _note(self, method, found):
        if method == "network.beforeRequestSent":
            self.requests.append(found["request"]["url"])
        elif method == "log.entryAdded" and found["level"] in ("error", "warn"):
            self.complaints.append(found["text"])

    def _send(self, data):
        """One text message in one masked frame (RFC 6455)."""
        mask, size = secrets.token_bytes(4), len(data)
        assert size < 65536
        length = bytes([128 + size]) if size < 126 else b"\xfe" + struct.pack(">H", size)
        self._socket.sendall(b"\x81" + length + mask + bytes(byte ^ mask[k % 4] for k, byte in enumerate(data)))

    def _next(self):
        """The next text message."""
        message = b""
        while True:
            head, size = self._file.read(2)
            size &= 127
            if size > 125:
                size = int.from_bytes(self._file.read(2 if size == 126 else 8), "big")
            data = self._file.read(size)
            if head & 15 in (0, 1):
                message += data
                if head & 128:
                    return message


def _connected(host, port):
    """A WebSocket to Firefox."""
    end = time.monotonic() + 30
    while True:
        made = socket.create_connection((host, port), 60)
        key = base64.b64encode(secrets.token_bytes(16)).decode()
        made.sendall((f"GET /session HTTP/1.1\r\nHost: {host}:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                      f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n\r\n").encode())
        head = b""
        while not head.endswith(b"\r\n\r\n") and (more := made.recv(1)):
            head += more
        if b" 101 " in head:
            return made
        made.close()
        assert time.monotonic() < end, head
        time.sleep(0.2)
