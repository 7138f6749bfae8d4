"""The tools of one window: which is selected, and which receives an event of the pointer or a key."""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from ...common.errors import InputError
from .tool import KeyEvent, Overlay, PointerEvent, Tool, ToolContext
from .waiting_clicks import KEYS, WaitingClicks

if TYPE_CHECKING:
    from ..kit.overlay import OverlayCanvas
    from ..kit.worker import Worker


class Toolbox:
    """The tools of one window and the one that is selected.  Fly is first; it also receives what the selected tool leaves."""

    def __init__(self, tools: list[Tool], overlays: list[Overlay]):
        self.tools, self.overlays = tools, overlays
        self.fly = self.active = tools[0]
        self._holder: Tool | None = None  # used the press: receives everything until the release
        self._waiting: WaitingClicks[PointerEvent | KeyEvent] = WaitingClicks()

    def select(self, name: str, context: ToolContext) -> None:
        """Selects the tool ``name``; selecting the active one goes back to Fly."""
        chosen = next(tool for tool in self.tools if tool.name == name)
        if chosen is self.active:
            chosen = self.fly
        if chosen is not self.active:
            self.release(context)
            self._waiting.forget()
            self.active.left(context)
            self.active = chosen
            chosen.selected(context)

    def follow(self, context: ToolContext) -> None:
        """Lets every tool and overlay take what its work in the background has brought."""
        for shown in self.overlays:
            _told(context, shown.follow, context)
        for tool in self.tools:
            _told(context, tool.follow, context)
            if tool.wanted:
                tool.wanted = False
                if tool is not self.active:
                    self.select(tool.name, context)
        for event, at in self._waiting.answerable(context):
            if isinstance(event, KeyEvent):
                _told(context, self.active.key_event, event, context)
            else:
                _told(context, self.active.pointer, replace(event, position=at or event.position), context)

    @property
    def answering(self) -> bool:
        """Whether a click is not answered yet: it may still change the document."""
        return bool(self._waiting) or any(tool.answering for tool in self.tools)

    @property
    def text_coming(self) -> bool:
        """Whether a click is about to begin a text: what is typed now is for it."""
        return self.active.writes and (bool(self._waiting) or self.active.text_coming)

    @property
    def workers(self) -> "list[Worker]":
        """Work of the tools that is under way."""
        return [worker for tool in self.tools for worker in tool.workers if worker is not None and not worker.finished]

    @property
    def unfinished(self) -> list[str]:
        """What tools would lose if the window closed now."""
        return [tool.unfinished for tool in self.tools if tool.unfinished]

    def close(self) -> None:
        """Ends the work of every tool."""
        for tool in self.tools:
            tool.close()

    def pointer(self, event: PointerEvent, context: ToolContext) -> None:
        """Gives an event to the tool that holds the pointer, else to the selected tool and then to Fly."""
        if self._holder is not None:
            taken = self._holder is self.fly is not self.active and self.active.takes_clicks
            _told(context, self._holder.pointer, replace(event, clicks=0) if taken else event, context)
            if event.kind in ("release", "leave"):
                if event.clicks and self._holder is not self.active:  # a press that Fly took turned out to be a click
                    self._give(self.active, event, context)
                self._holder = None
            return
        for tool in dict.fromkeys((self.active, self.fly)):
            if self._give(tool, event, context):
                if event.kind == "press":
                    self._holder = tool
                return

    def _give(self, tool: Tool, event: PointerEvent, context: ToolContext) -> bool:
        """Gives an event to a tool, a click later where it has to wait.  Returns whether the tool used it."""
        if tool.picks and event.kind == "release" and event.clicks:
            context.session.shown_scan.touched = True
            if self._waiting.keeps(event, context, event.position):
                return False
        return _told(context, tool.pointer, event, context)

    def key_event(self, event: KeyEvent, context: ToolContext) -> bool:
        """Gives a key to the selected tool.  Returns whether it used it."""
        if event.key == "ESCAPE":
            self._waiting.forget()
        elif event.key in KEYS and event.kind == "press" and self._waiting.keeps(event, context):
            return True
        return _told(context, self.active.key_event, event, context)

    def release(self, context: ToolContext) -> None:
        """Ends a drag that is under way: the window lost the focus, or a dialog opened."""
        holder, self._holder = self._holder, None
        if holder is not None:
            holder.pointer(PointerEvent("leave", (0.0, 0.0)), context)

    @property
    def holding(self) -> bool:
        """Whether a tool holds the pointer."""
        return self._holder is not None

    def draw(self, overlay: "OverlayCanvas", context: ToolContext) -> None:
        """Draws the overlays and what Fly and the selected tool draw."""
        for shown in self.overlays:
            if shown.visible:
                shown.draw(overlay, context)
        for tool in dict.fromkeys((self.active, self.fly)):
            tool.draw(overlay, context)
        overlay.lay_labels()
        if self.active.cursor == "crosshair" and context.session.pointer is not None:
            overlay.crosshair(context.session.pointer)
            if text := self.active.hint(context):
                overlay.hint(context.session.pointer, text)


def _told(context: ToolContext, do: Callable[..., bool | None], *of_event: object) -> bool:
    """What a tool does with an event, and whether it used it.  An error becomes a dialog: the file of a grid may become
    unreadable whenever points are read of it, and that is no reason to end the window."""
    try:
        return bool(do(*of_event))
    except InputError as error:
        asked = any(isinstance(event, KeyEvent) or getattr(event, "clicks", 0) for event in of_event)
        (context.session.notices.say if asked else context.session.notices.say_once)("This cannot be done", error)
        return True
