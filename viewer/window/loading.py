"""What is loaded off the main thread, a scan or a network, and what a person should be told about it."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from viewer.settings import Settings
from viewer.window.start import Survey

if TYPE_CHECKING:
    from viewer.cloud.scene import Scene


@dataclass(frozen=True)
class Loaded:
    """What a load brings back: the scene and what the start needs to know of it, both made off the main thread."""

    scene: "Scene"
    seen: Survey


def notes(meta: dict) -> list[str]:
    """What a person should know about a scan: the reader's warnings, and where its colours are from if not from it."""
    told, colour = list(meta.get("warnings", [])), meta.get("colour") or {}
    if colour.get("source", "rgb") != "rgb" and not any("colour" in note for note in told):
        told.insert(0, str(colour.get("note") or f"coloured by {colour['source']}"))
    return told


def network_key(settings: Settings) -> tuple:
    """What of the settings decides on the network."""
    return settings.quality, settings.filter != "off", settings.weights, settings.precision, settings.device


def open_scene(paths: list[Path]) -> "Scene":
    """The scans as one scene, through the cache."""
    from viewer import cloud

    return cloud.open_scene(paths)


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
