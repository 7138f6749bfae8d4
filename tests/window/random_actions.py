"""Random actions in a window, for ``test_random_actions.py``: ``python random_actions.py FOLDER ACTIONS SEED DEMO``.  DEMO: a
small scan that stands for the demo.

At regular intervals the scan is closed and OpenGL objects are counted; then the window is brought to the same state, and
resident memory is taken there.  (While a scan is open, sizes of the picture in motion may have passes of their own, by chance
of the timing.)  Writes ``random.json``: the counts, and the last actions before an exception.  Besides resident memory, the
memory in use is counted (what the C library has given out, and Python's objects): freed blocks between others keep pages
resident, by chance of the threads' timing.
"""

import ctypes
import gc
import json
import os
import sys
import traceback
from collections import deque
from dataclasses import replace
from pathlib import Path

import numpy as np
from driver import Driver, middle

from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.window.flight.framing import SIDES
from pointglass.viewer.window.interaction.tool import Modifiers
from pointglass.viewer.work.selecting.select_points import by_outline

INTERVALS = 10
WARM = INTERVALS // 2
"""Counts taken before this one are warm-up: compiled loops, glyphs, shaders and passes made when they are first needed."""
REST_SIZE = (400, 300)
"""Of the window where memory is taken: small, because a dozen pictures are made for each count."""
OBJECTS = ("Texture", "Buffer", "Framebuffer", "Query", "VertexArray", "Sampler", "Program", "Shader")
os.environ["ONEDNN_PRIMITIVE_CACHE_CAPACITY"] = "64"
"""torch keeps compiled convolutions for 1,024 layers and sizes, 50 MB after 50 sizes of the window: bounded, but not flat."""
LONGEST = 100.0
"""Seconds that a scan may take to open: the demo takes more than 20 where six other processes fill two processors."""
MOST_NAMES = 50_000
"""Names that are looked at.  Mesa gives every new object the next number, and the interface makes one every frame."""


def resident() -> float:
    """MB of this process."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


class _Mallinfo2(ctypes.Structure):
    """mallinfo2(3) of glibc 2.33 and later."""

    _fields_ = [(name, ctypes.c_size_t) for name in ("arena", "ordblks", "smblks", "hblks", "hblkhd", "usmblks", "fsmblks",
                                                     "uordblks", "fordblks", "keepcost")]


def in_use() -> float | None:
    """MB that the C library has given out and not got back; None where it cannot tell."""
    library = ctypes.CDLL(None)
    if not hasattr(library, "mallinfo2"):
        return None
    library.mallinfo2.restype = _Mallinfo2
    info = library.mallinfo2()
    return (info.uordblks + info.hblkhd) / 1e6


def gl_objects(d: Driver) -> dict[str, int]:
    """How many objects of each kind exist in the window's context, without the pictures of recent scans: every project that is
    saved adds one, up to a dozen."""
    counts = {}
    for kind in OBJECTS:
        address = ctypes.cast(d.glfw.get_proc_address(f"glIs{kind}"), ctypes.c_void_p).value
        exists = ctypes.CFUNCTYPE(ctypes.c_ubyte, ctypes.c_uint)(address)
        counts[kind] = sum(map(exists, range(1, MOST_NAMES)))
    counts["Texture"] -= sum(texture is not None for texture in d.app.start_page._textures)
    return counts


class Monkey:
    """Does one random thing after another.  done: the last ones, as text."""

    def __init__(self, d: Driver, seed: int):
        self.d, self.rng = d, np.random.default_rng(seed)
        self.done: deque[str] = deque(maxlen=12)
        self.actions = [
            (10, self.tool), (10, self.click), (8, self.drag), (5, self.double_click), (5, self.wheel), (8, self.fly),
            (3, self.key_of_view), (3, self.history), (3, self.window_key), (2, self.edit), (2, self.load), (1, self.close),
            (1, self.bad_file), (2, self.resize), (2, self.notice), (2, self.panel), (1, self.walk), (1, self.cancelled),
            (3, self.projection),
        ]  # fmt: skip
        weights = np.array([weight for weight, _ in self.actions], float)
        self.weights = weights / weights.sum()

    def act(self) -> None:
        work = self.actions[self.rng.choice(len(self.actions), p=self.weights)][1]
        self.done.append(work.__name__)
        work()
        self.d.settle(1)

    def _pick(self, values):
        found = values[self.rng.integers(len(values))]
        self.done[-1] += f" {found}"
        return found

    def _place(self) -> tuple[float, float]:
        if self.d.session.scene is None or self.rng.random() < 0.1:  # also the panels
            return tuple(self.rng.uniform((0, 0), self.d.glfw.get_window_size(self.d.app.window)))
        return middle(self.d, *self.rng.uniform(-0.45, 0.45, 2))

    def _press(self, name: str, mods: int = 0) -> None:
        d, key = self.d, getattr(self.d.glfw, f"KEY_{name}")
        for action in (d.glfw.PRESS, d.glfw.RELEASE):
            d.app.input.on_key(d.app.window, key, 0, action, mods)

    def tool(self) -> None:
        if self.rng.random() < 0.2:
            self.d.app.toolbox.select("scene", self.d.app.tools)
        else:
            self._press(self._pick(("I", "T", "B", "N", "C", "P", "M", "K", "ESCAPE")))

    def projection(self) -> None:
        """Orthographic or perspective, sides, and the view cube."""
        how = self.rng.random()
        if how < 0.4:
            self._press("X")
        elif how < 0.7:
            self.d.app.act(f"from_{self._pick(tuple(SIDES))}")
        elif any(region := tuple(self.rng.integers(-1, 2, 3).tolist())):
            self.d.app.actions.turn_to(region)

    def click(self) -> None:
        self.d.app.input.on_pointer(self.d.app.window, *self._place())
        self.d.settle(1)
        if self.d.imgui_wants_pointer and self.d.app.input.pointer[0] < 230 and self.d.app.input.pointer[1] < 200:
            return  # Open… is a dialog of the desktop
        for action in (self.d.glfw.PRESS, self.d.glfw.RELEASE):
            self.d.app.input.on_button(self.d.app.window, self.d.glfw.MOUSE_BUTTON_LEFT, action, 0)

    def double_click(self) -> None:
        place = middle(self.d, *self.rng.uniform(-0.4, 0.4, 2))
        for action in (self.d.glfw.PRESS, self.d.glfw.RELEASE) * 2:
            self.d.app.input.on_pointer(self.d.app.window, *place)
            self.d.app.input.on_button(self.d.app.window, self.d.glfw.MOUSE_BUTTON_LEFT, action, 0)

    def drag(self) -> None:
        d = self.d
        d.app.input.on_pointer(d.app.window, *middle(d, *self.rng.uniform(-0.4, 0.4, 2)))
        button = getattr(d.glfw, f"MOUSE_BUTTON_{self._pick(('LEFT', 'RIGHT', 'MIDDLE', 'MIDDLE'))}")
        mods = self._pick((0, d.glfw.MOD_SHIFT))
        d.app.input.on_button(d.app.window, button, d.glfw.PRESS, mods)
        for _ in range(self.rng.integers(1, 4)):
            x, y = d.app.input.pointer
            d.app.input.on_pointer(d.app.window, x + self.rng.uniform(-60, 60), y + self.rng.uniform(-40, 40))
            d.settle(1)
        d.app.input.on_button(d.app.window, button, d.glfw.RELEASE, mods)

    def wheel(self) -> None:
        self.d.app.input._modifiers = Modifiers(control=self._pick((False, True)))
        self.d.app.input.on_scroll(self.d.app.window, 0.0, float(self.rng.integers(-3, 4)))
        self.d.app.input._modifiers = Modifiers()

    def fly(self) -> None:
        d, key = self.d, getattr(self.d.glfw, f"KEY_{self._pick('WASDEQ')}")
        d.app.input.on_key(d.app.window, key, 0, d.glfw.PRESS, 0)
        d.settle(int(self.rng.integers(1, 4)))
        if self.rng.random() < 0.9:
            d.app.input.on_key(d.app.window, key, 0, d.glfw.RELEASE, 0)
        else:
            d.app.input.window_events.on_focus(d.app.window, 0)  # another window takes the keyboard

    def walk(self) -> None:
        self._press("G")

    def key_of_view(self) -> None:
        self._press(self._pick(("1", "2", "3", "3", "3", "4", "V", "HOME", "F")))

    def history(self) -> None:
        self._press(self._pick(("Z", "Z", "Y", "C", "V")), self.d.glfw.MOD_CONTROL)

    def window_key(self) -> None:
        self._press(self._pick(("F1", "F3", "F10", "ESCAPE", "ENTER", "BACKSPACE", "F9")))

    def edit(self) -> None:
        from pointglass.viewer.window.interaction.editing import edit

        context = self.d.app.tools
        if context.scene is None:
            return
        kind = self._pick(("clip", "exposure", "colour", "up", "hide", "ghosts", "keyframe", "preview", "select"))
        if kind == "clip":
            tool = next(tool for tool in self.d.app.toolbox.tools if tool.name == "clip")
            tool.add(context, self._pick(("box", "upright", "level")))
        elif kind == "up":
            edit(context, "up", up=self._pick(((0.0, 0.0, 1.0), (0.0, 1.0, 0.0))))
        elif kind == "ghosts":  # told in one of the scenes, refused in the others
            edit(context, "ghosts", ghosts=self._pick(("shown", "dimmed", "hidden")))
        elif kind == "keyframe":
            film = next(tool for tool in self.d.app.toolbox.tools if tool.name == "film")
            film.path.add_keyframe(context)
            if keyframes := context.document.path.keyframes:  # an orthographic view makes none
                film.path.select(context, int(self.rng.integers(len(keyframes))))
                film.path.change_lens(context, float(self.rng.uniform(20, 110)))
        elif kind == "preview":
            section = next(tool for tool in self.d.app.toolbox.tools if tool.name == "section")
            section.preview.shown = not section.preview.shown
        elif kind == "select":
            self._select(context)
        elif kind == "hide":
            edit(context, "hide", hidden_stations=self._pick(((), (0,))))
        else:
            change = {"exposure": float(self.rng.uniform(-2, 2))} if kind == "exposure" else {
                "colour_by": self._pick(("rgb", "height", "distance", "intensity"))}
            edit(context, kind, look=replace(context.document.look, **change))
        context.renew_picture()

    def _select(self, context) -> None:
        """Selects by a random outline, or does something with what is selected."""
        tool = next(tool for tool in self.d.app.toolbox.tools if tool.name == "select")
        use = self._pick(("lasso", "lasso", "connected", "classify", "hide", "delete", "only", "invert"))
        if use == "lasso":
            corners, camera, scene = self.rng.uniform(0, 600, (5, 2)), context.camera, context.scene
            tool.start(context, lambda: by_outline(scene, camera, corners), self._pick(("new", "add", "subtract")))
        elif use == "connected" and context.session.point is not None:
            tool._connected(tuple(context.session.point.tolist()), "new", context)
        elif use == "invert":
            tool.invert(context)
        elif context.document.selection:
            {"classify": lambda: tool.classify(context, int(self.rng.integers(20))), "hide": lambda: tool.keep(context),
             "delete": lambda: tool.delete(context), "only": lambda: tool.show_alone(context, context.document.selection),
             "connected": lambda: None}[use]()

    def load(self) -> None:
        if self.rng.random() < 0.1:
            self.d.app.act("demo")
        else:
            self.d.drop(Path(self._pick(("room1", "room2", "room3", "passer1"))))
        if self.rng.random() < 0.7:
            self.d.until(lambda: self.d.session.loads.current is None, LONGEST)

    def close(self) -> None:
        self.d.app.act("close_scan")

    def bad_file(self) -> None:
        self.d.drop(Path("/nowhere/missing.laz"))

    def cancelled(self) -> None:
        self.d.drop(self.d.folder / "slow.ply")
        self.d.settle(2)
        self.d.session.cancel_load()

    def resize(self) -> None:
        self.d.resize(*self._pick(((640, 400), (400, 300), (900, 500), (517, 383))))

    def notice(self) -> None:
        notices = self.d.session.notices
        if self.rng.random() < 0.5:
            notices.toast(f"toast {self.rng.integers(100)}")
        else:
            notices.say("A message", "Its text")

    def panel(self) -> None:
        panels = self.d.panels
        setattr(panels, self._pick(("outliner", "inspector")), bool(self.rng.integers(2)))

    def rest(self, counted: bool = False) -> dict[str, int]:
        """Brings the window to the state in which memory is taken: the same each time.  counted: returns the OpenGL objects
        that exist while no scan is open, which takes most of a second."""
        d = self.d
        d.app.input.window_events.on_focus(d.app.window, 0)
        for _ in range(8):
            d.session.notices.message = None
            self._press("ESCAPE")
            d.settle(1)
        if d.session.recording is not None:
            self._press("F9")
        d.session.help, d.session.interface, d.session.profiler = False, True, False
        d.until(lambda: d.session.loads.current is None, LONGEST)
        d.session.notices.message = None
        if d.session.view_settings.split:
            d.session.view_settings.compare(False)
        d.app.act("close_scan")
        d.resize(*REST_SIZE)
        d.settle(3)
        objects: dict[str, int] = {}
        if counted:
            gc.collect()
            objects = gl_objects(d)
        d.drop(Path("room1"))
        d.until(lambda: d.session.loads.current is None and d.session.scene is not None, LONGEST)
        for raster in ("compute", "points"):  # "auto" would choose by time: with another one, other objects are alive
            d.session.view_settings.request(Settings(view="filled", raster=raster))
            for key in ("C", "M", "1", "2", "3"):
                d.key(key)
                d.rest()
        d.key("ESCAPE")
        d.rest()
        return objects


def main(folder: Path, count: int, seed: int, scan: Path) -> None:
    from pointglass.model.common.process.memory import give_back
    from pointglass.viewer.commands import demo

    demo.demo_scan = lambda: scan
    os.chdir(folder)  # projects are saved beside the scans
    d = Driver(folder, on_screen=True)
    monkey = Monkey(d, seed)
    report: dict = {"actions": 0, "counted": [], "problem": None}
    try:
        d.app.act("demo")  # what reads files is imported once, and takes memory once
        monkey.rest()
        d.key("4")  # so is what runs the network
        d.rest()
        for name in ("room2", "room3", "passer1"):  # the start page then has all pictures of recent scans that it may have
            d.drop(Path(name))
            d.until(lambda name=name: d.session.loads.current is None and d.session.shown_scan.title == name, LONGEST)
            d.rest()
        monkey.rest()
        for number in range(INTERVALS):
            for _ in range(count // INTERVALS):
                monkey.act()
                report["actions"] += 1
            objects = monkey.rest(counted=number < WARM or number == INTERVALS - 1)  # the others are compared with none
            gc.collect()
            give_back()
            report["counted"].append({
                "resident": resident(), "in_use": in_use(), "objects": sys.getallocatedblocks(), **objects,
                "modules": len(sys.modules), "error": d.app.context.error,
            })
    except Exception:
        session = d.session
        state = {"message": session.notices.message, "load": session.loads.current, "scene": session.scene is not None,
                 "asking": d.app.asking, "project": session.work.project, "waiting keys": bool(d.app.input.after_typing)}
        report["problem"] = f"after {list(monkey.done)}\n{state}\n{traceback.format_exc()}"
    (folder / "random.json").write_text(json.dumps(report, indent=1))
    d.app.close()


if __name__ == "__main__":
    from pointglass.model.common.process.background_threads import leave

    main(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]), Path(sys.argv[4]))
    sys.exit(leave(0))
