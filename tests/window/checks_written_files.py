"""Checks of what is left while a file is written, for ``drive_unfinished.py``: sheets, pictures, and the name of a film."""

import errno
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

from drive_dialogs import Person, write_ply
from x_keyboard import xdo

from pointglass.viewer.commands.film import encode
from pointglass.viewer.commands.section import sheet
from pointglass.viewer.window.interaction.film import film_job
from pointglass.viewer.window.saving import still_job


@contextmanager
def held(module, name: str) -> Iterator[None]:
    """Within the block the function of a module waits before it begins."""
    usual, go = getattr(module, name), threading.Event()

    def waits(*given, **named):
        assert go.wait(60.0)
        return usual(*given, **named)

    with patch.object(module, name, waits):
        try:
            yield
        finally:
            go.set()


def tool_of(p: Person, name: str) -> Any:
    return next(tool for tool in p.d.app.toolbox.tools if tool.name == name)


def asked_about(p: Person, what: str) -> None:
    """Presses Ctrl+Q; the question names ``what``; Esc goes on."""
    xdo("key", "ctrl+q")
    p.d.until(lambda: p.d.session.notices.message is not None)
    message = p.d.session.notices.message
    assert message.title == "Close the window?" and what in message.text, message
    p.key("Escape")
    assert p.d.session.notices.message is None and not p.d.app.closing


def check_a_sheet_that_is_drawn_is_given_up_after_a_question_only(p: Person, folder: Path) -> None:
    p.d.drop(write_ply(folder / "scans" / "hall.ply"))
    p.opened("hall.ply")
    p.d.rest()
    p.key("n")
    tool, out = tool_of(p, "section"), folder / "scans" / "plan.pdf"
    with held(sheet, "_save"):
        p.click("Save sheet…")
        p.listed()
        p.type(f"{out}")
        p.key("Return")
        p.d.until(lambda: tool.worker is not None and out.exists())
        asked_about(p, "A sheet is being drawn.")
    p.d.until(lambda: tool.worker is None)
    assert out.read_bytes().startswith(b"%PDF")
    p.key("Escape")


def check_a_picture_that_is_rendered_is_given_up_after_a_question_only(p: Person, folder: Path) -> None:
    p.d.session.work.shot_scale = 2
    with held(still_job, "save_png"):
        p.key("F12")
        p.d.until(lambda: p.d.app.save_actions.still is not None)
        asked_about(p, "A picture is being rendered.")
    p.d.until(lambda: p.d.app.save_actions.still is None)
    p.d.session.work.shot_scale = 1
    (made,) = folder.glob("pointglass-*.png")
    assert made.stat().st_size


def check_the_name_of_a_film_that_is_rendered_is_not_given_to_another_file(p: Person, folder: Path) -> None:
    tool, out = tool_of(p, "film"), folder / "scans" / "walk.mp4"
    tool.change_format(p.d.app.tools, size=(64, 48), view="filled")
    p.key("k")
    p.click("Add keyframe here")
    with held(film_job, "film"):
        p.click("Render video…")
        p.listed()
        p.type(f"{out}")
        p.key("Return")
        p.d.until(out.exists)
        asked_about(p, "A film is being rendered.")
        chosen: list[Path] = []
        p.d.app.files.save("films", "Save the film", "walk.mp4", film_endings, chosen.append)  # as another window does
        p.listed()
        p.key("Return")
        p.d.until(lambda: bool(p.choice.problem))
        assert "a window is writing this file" in p.choice.problem and p.choice.question is None
        p.key("Escape")
        assert p.choice is None and not chosen
    p.d.until(lambda: tool.worker is None)
    assert b"ftyp" in out.read_bytes()[:16]
    frames = folder / "scans" / "frames"
    with patch.object(encode, "write_json", side_effect=OSError(errno.ENOSPC, "No space left on device")):
        tool.start(p.d.app.tools, frames)
        p.d.until(lambda: p.d.session.notices.message is not None)
    told = p.d.session.notices.message.text
    assert told.startswith(f"{frames}: cannot be written (No space left on device); choose") and not frames.exists()
    p.key("Escape", "Escape")


film_endings = {"MP4 video": (".mp4",)}
