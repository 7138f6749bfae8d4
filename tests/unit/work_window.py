"""A window without its picture: session, file dialogs and project, on a small scan; for tests that no work is lost."""

from pathlib import Path

import pytest
from window_session import room

from pointglass.viewer.picture.clip import Box
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.window.file_dialog.file_dialogs import FileDialogs
from pointglass.viewer.window.flight.start_viewpoint import survey
from pointglass.viewer.window.session import autosave as module
from pointglass.viewer.window.session.project_flow import ProjectFlow
from pointglass.viewer.window.session.session import Session
from pointglass.viewer.work.measuring.measurement import MeasuredPoint, Measurement

SCENE = room(points=2_000)
SURVEY = survey(SCENE)
EYE = ((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0))
BOX = Box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
TAPE = Measurement("distance", tuple(MeasuredPoint((x, 0.0, 0.0), 0.01, 0.0) for x in (0.0, 1.0)), "Distance")


class Window:
    """What a window has besides its picture."""

    def __init__(self, folder: Path):
        self.session = Session(Settings(view="filled"), (640, 400), load_network=lambda settings: None,
                               open_scene=lambda paths: SCENE)
        self.files = FileDialogs()
        self.files.prefer_window(True)
        self.flow = ProjectFlow(self.session, self.files, lambda: None)
        self.scan = folder / "room.ply"
        self.scan.touch()

    def open(self, *paths: Path) -> None:
        self.flow.leave(lambda: self.session.open(list(paths)))
        self.take()

    def take(self) -> None:
        """Takes what is being loaded, as the window does."""
        while (current := self.session.loads.current) is not None:
            assert current.join(20.0)
            loaded = self.session.poll()
            if loaded is not None and self.flow.may_replace(loaded):
                self.session.accept(loaded)
            elif loaded is not None:
                self.flow.leave(lambda loaded=loaded: self.session.accept(loaded))
        self.flow.follow()

    def answer(self, label: str) -> None:
        message = self.session.notices.message
        assert message is not None, "nothing is asked"
        self.session.notices.answer([answer.label for answer in message.answers].index(label))
        self.session.notices.take_answer()
        self.take()

    @property
    def asked(self) -> str:
        return self.session.notices.message.title if self.session.notices.message is not None else ""

    def edit(self, **changes) -> None:
        self.session.work.edit("change", **changes)
        self.flow.follow()


@pytest.fixture(name="window")
def work_window(tmp_path, monkeypatch):
    monkeypatch.setenv("POINTGLASS_STATE", str(tmp_path / "state"))
    monkeypatch.setattr(module, "PAUSE_S", 0.05)
    made = Window(tmp_path)
    made.open(made.scan)
    yield made
    made.flow.autosave.close(keep=False)
    made.session.close()
