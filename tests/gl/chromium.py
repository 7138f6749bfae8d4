"""Chromium without a display, driven through its debugging pipe (Chrome DevTools Protocol): real clicks and keys, its console
and every request that a page makes."""

import itertools
import json
import os
import shutil
import subprocess
import time

PROGRAM = next((found for name in ("chromium", "chromium-browser", "google-chrome") if (found := shutil.which(name))), None)
_KEYS = {"ArrowUp": 38, "ArrowLeft": 37, "Escape": 27, "Enter": 13}


class Page:
    """One page.  complaints: errors and warnings of its console.  requests: addresses it asked for."""

    def __init__(self, profile, width=1280, height=720):
        assert PROGRAM is not None
        (their_in, self._in), (self._out, their_out) = os.pipe(), os.pipe()
        line = [PROGRAM, "--headless=new", "--no-sandbox", "--remote-debugging-pipe", "--use-gl=angle",
                "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-first-run", f"--window-size={width},{height}",
                f"--user-data-dir={profile}", "about:blank"]  # fmt: skip

        def pipes():  # Chromium reads from 3 and writes to 4
            a, b = os.dup(their_in), os.dup(their_out)
            os.dup2(a, 3), os.dup2(b, 4)

        self._process = subprocess.Popen(line, preexec_fn=pipes, close_fds=False, stdout=subprocess.DEVNULL,
                                         stderr=subprocess.DEVNULL)
        os.close(their_in), os.close(their_out)
        self._numbers, self._rest, self._session = itertools.count(1), b"", None
        self.complaints, self.requests = [], []
        target = next(each for each in self._ask("Target.getTargets")["targetInfos"] if each["type"] == "page")
        self._session = self._ask("Target.attachToTarget", targetId=target["targetId"], flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self._ask(f"{domain}.enable")
        self.resize(width, height)

    def open(self, address):
        self._ask("Page.navigate", url=address)

    def value(self, expression):
        """The value of an expression, waited for where it is a promise."""
        found = self._ask("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in found, found["exceptionDetails"]
        return found["result"].get("value")

    def until(self, expression, seconds=60.0):
        end = time.monotonic() + seconds
        while not (value := self.value(expression)):
            assert time.monotonic() < end, (expression, self.complaints)
            time.sleep(0.02)
        return value

    def click(self, x, y):
        for kind in ("mouseMoved", "mousePressed", "mouseReleased"):
            button = "none" if kind == "mouseMoved" else "left"
            self._ask("Input.dispatchMouseEvent", type=kind, x=x, y=y, button=button, clickCount=1)

    def drag(self, x, y, to_x, to_y, steps=8):
        self._ask("Input.dispatchMouseEvent", type="mousePressed", x=x, y=y, button="left", buttons=1, clickCount=1)
        for step in range(1, steps + 1):
            at = x + (to_x - x) * step / steps, y + (to_y - y) * step / steps
            self._ask("Input.dispatchMouseEvent", type="mouseMoved", x=at[0], y=at[1], button="left", buttons=1)
        self._ask("Input.dispatchMouseEvent", type="mouseReleased", x=to_x, y=to_y, button="left", clickCount=1)

    def touch_screen(self):
        """From the next page on, the device has a touch screen."""
        self._ask("Emulation.setTouchEmulationEnabled", enabled=True, maxTouchPoints=2)

    def swipe(self, x, y, to_x, to_y, steps=8):
        self._ask("Input.dispatchTouchEvent", type="touchStart", touchPoints=[{"x": x, "y": y}])
        for step in range(1, steps + 1):
            at = {"x": x + (to_x - x) * step / steps, "y": y + (to_y - y) * step / steps}
            self._ask("Input.dispatchTouchEvent", type="touchMove", touchPoints=[at])
        self._ask("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])

    def resize(self, width, height):
        """The window, logical pixels."""
        self._ask("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)

    def read_aloud(self):
        """(role, name, value or description) of all that a screen reader is given, in its order."""
        nodes = self._ask("Accessibility.getFullAXTree")["nodes"]
        return [tuple(str(node.get(key, {}).get("value", "")) for key in ("role", "name", "value")) for node in nodes
                if not node["ignored"]]

    def prefers(self, scheme):
        """light or dark."""
        self._ask("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])

    def wheel(self, x, y, down):
        self._ask("Input.dispatchMouseEvent", type="mouseWheel", x=x, y=y, deltaX=0, deltaY=down)

    def key(self, name):
        more = {"windowsVirtualKeyCode": _KEYS[name]} if name in _KEYS else {"text": name}
        for kind in ("keyDown", "keyUp"):
            self._ask("Input.dispatchKeyEvent", type=kind, key=name, **(more if kind == "keyDown" else {}))

    def screenshot(self):
        """The window as PNG, base64."""
        return self._ask("Page.captureScreenshot", format="png")["data"]

    def close(self):
        self._process.kill()
        self._process.wait()
        os.close(self._in), os.close(self._out)

    def _ask(self, method, **parameters):
        number = next(self._numbers)
        message = {"id": number, "method": method, "params": parameters}
        message |= {"sessionId": self._session} if self._session else {}
        os.write(self._in, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._next()
            if answer.get("id") == number:
                assert "error" not in answer, (method, answer["error"])
                return answer["result"]
            self._note(answer.get("method"), answer.get("params", {}))

    def _note(self, method, found):
        if method == "Network.requestWillBeSent":
            self.requests.append(found["request"]["url"])
        elif method == "Runtime.exceptionThrown":
            self.complaints.append(found["exceptionDetails"]["text"])
        elif method == "Log.entryAdded" and found["entry"]["level"] in ("error", "warning"):
            self.complaints.append(found["entry"]["text"])
        elif method == "Runtime.consoleAPICalled" and found["type"] in ("error", "warning"):
            self.complaints.append(str(found["args"]))

    def _next(self):
        while b"\0" not in self._rest:
            some = os.read(self._out, 1 << 20)
            assert some, "Chromium has ended"
            self._rest += some
        message, self._rest = self._rest.split(b"\0", 1)
        return json.loads(message)
