"""What is loaded off the main thread, a scan or a network, and what a person should be told about it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from viewer.errors import PointglassError
from viewer.settings import Settings
from viewer.window.notices import Notices
from viewer.window.start_viewpoint import Survey, survey
from viewer.window.worker import Worker

if TYPE_CHECKING:
    from viewer.grid.scene import Scene


@dataclass(frozen=True)
class Loaded:
    """What a load brings back: the scene and what the start needs to know of it, both made off the main thread."""

    scene: "Scene"
    seen: Survey


def notes(meta: dict) -> list[str]:
    """What a person should know about a scan: the reader's warnings, and what its colours are where not as scanned."""
    told, colour = list(meta.get("warnings", [])), meta.get("colour") or {}
    if colour.get("source", "rgb") != "rgb" and not any("colour" in note for note in told):
        told.insert(0, str(colour.get("note") or f"coloured by {colour['source']}"))
    kinds = {"exposures": "stations", "passes": "runs of points"}
    matched = [name for key, name in kinds.items() if (meta.get(key) or {}).get("applied")]
    if matched:
        told.append(f"brightness matched between {' and '.join(matched)}; started with --exposures as-scanned it is left")
    return told


def network_key(settings: Settings) -> tuple:
    """What of the settings decides on the network."""
    return settings.quality, settings.filter != "off", settings.weights, settings.precision, settings.device


def open_scene(paths: list[Path], *, cache: bool = True, match: bool = True, columns: str | None = None) -> "Scene":
    """The scans as one scene.  cache, match, columns: as in viewer.grid.open_scene."""
    from viewer.grid import open_scene as grid_scene
    from viewer.readers.formats import takes_columns

    columns = columns if any(map(takes_columns, paths)) else None  # not of what is dropped into the window later
    return grid_scene.open_scene(paths, cache=cache, match=match, columns=columns)


def load_network(settings: Settings) -> None:
    """Imports torch and reads the weights, off the main thread, so that the first neural frame only has to run."""
    from model.reconstruct import cuda_problem
    from viewer.errors import DeviceError
    from viewer.render import neural

    problem = None if settings.device == "cpu" else cuda_problem()
    if settings.device == "cuda" and problem:
        raise DeviceError(f"--device cuda: {problem}; see `pointglass doctor`, or use the CPU")
    device = "cpu" if settings.device == "cpu" or problem else "cuda"
    neural.load_network(settings.quality, settings.filter != "off", settings.weights, settings.precision, device)


class ScanLoads:
    """The load of scans under way, one at a time, and those given up that still clean up after themselves.

    current: the load under way, else None.  prepare: the scans to read of what is opened (of a project, its scans); raises
    PointglassError.  open_scene, wake: what it depends on, replaceable in tests.
    """

    def __init__(self, notices: Notices, open_scene: "Callable[[list[Path]], Scene]", wake: Callable[[], None]):
        self._notices, self._wake = notices, wake
        self.open_scene = open_scene
        self.prepare: Callable[[Sequence[Path]], list[Path]] = list
        self.current: Worker | None = None
        self._abandoned: list[Worker] = []

    def open(self, paths: Sequence[Path]) -> None:
        """Starts loading ``paths`` as one scene, instead of a load under way; the present scene stays until then."""
        self.cancel()
        try:
            files = self.prepare(paths)
        except PointglassError as error:
            self._notices.say("This project cannot be opened", str(error))
            return

        def work() -> Loaded:
            scene = self.open_scene(files)
            return Loaded(scene, survey(scene))

        names = files[0].name if len(files) == 1 else f"{len(files)} files"
        self.current = Worker(work, f"Opening {names}", self._wake)

    def cancel(self) -> None:
        """Stops the load under way; the scene stays."""
        if self.current is not None:
            self.current.cancel()
            self._abandoned.append(self.current)
            self.current = None

    def poll(self) -> Loaded | None:
        """A scene that has been loaded since the last call, or None.  An error becomes a dialog."""
        self._abandoned = [work for work in self._abandoned if not work.finished]
        if self.current is None or not self.current.finished:
            return None
        work, self.current = self.current, None
        if work.error is not None:
            self._notices.say("This scan cannot be opened", work.error)
        return work.result if not work.cancelled else None

    def close(self) -> None:
        """Stops the load, and waits until what was being written is gone."""
        self.cancel()
        for work in self._abandoned:
            work.join(15.0)
