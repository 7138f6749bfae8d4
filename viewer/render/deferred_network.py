"""The neural view of a window's frame: started with the frame, added to it when the network has ended.

The network runs on its own thread (viewer.render.network.network_thread); these functions run on the thread that draws.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from .frame import Frame

if TYPE_CHECKING:
    from ..picture.camera import Camera
    from .network.neural import NeuralStage
    from .passes.fill import Fill
    from .stage_times import Stages


def start_network(network: "NeuralStage", camera: "Camera", stages: "Stages", textures: dict, *, serial: int,
                  wake: Callable[[], None], missing: int) -> bool:
    """Starts the network for frame ``serial``, unless points are missing, and shows the previous neural picture meanwhile where
    its camera is the same.  Returns whether it runs."""
    if network.presented == camera.key:
        textures["neural"] = network.picture
    if missing:
        network.drop()
    else:
        with stages("hand over"):
            network.start(serial, wake)
    return not missing


def finish_network(network: "NeuralStage | None", fill: "Fill | None", frame: Frame, serial: int) -> bool:
    """Adds the neural view to ``frame``, the one numbered ``serial``, if its network has ended; returns whether it did.

    Raises DeviceError where the network failed.
    """
    if network is None or fill is None or not frame.facts.network_pending:
        return False
    milliseconds = network.finish(serial, fill.filled)
    if milliseconds is None:
        return False
    network.presented = frame.camera.key
    frame.textures["neural"] = network.picture
    frame.facts = replace(frame.facts, network_pending=False)
    frame.times.add("network", milliseconds)
    return True
