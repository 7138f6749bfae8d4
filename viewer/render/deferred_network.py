"""The neural view of a window's frame: started with the frame, added to it when the network has ended.

The network runs on its own thread (viewer.render.network.network_thread); these functions run on the thread that draws.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING

from .frame import Frame

if TYPE_CHECKING:
    from ..picture.camera import Camera
    from .network.neural import NeuralStage
    from .passes.fill import Fill
    from .stage_times import Stages


def camera_key(camera: "Camera") -> tuple:
    """Equal for cameras that make the same picture."""
    return (camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy, camera.camera_to_world.tobytes())


def start_network(network: "NeuralStage", camera: "Camera", stages: "Stages", facts: dict, textures: dict, *, serial: int,
                  wake: Callable[[], None], missing: int) -> None:
    """Starts the network for frame ``serial``, unless points are missing, and shows the previous neural picture meanwhile where
    its camera is the same.  Adds the facts ``camera_key`` and ``network_pending``."""
    key = camera_key(camera)
    if network.presented == key:
        textures["neural"] = network.picture
    facts["camera_key"] = key
    facts["network_pending"] = not missing
    if facts["network_pending"]:
        stages.run("hand over", lambda: network.start(serial, wake))
    else:
        network.drop()


def finish_network(network: "NeuralStage | None", fill: "Fill | None", frame: Frame, serial: int) -> bool:
    """Adds the neural view to ``frame``, the one numbered ``serial``, if its network has ended; returns whether it did.

    Raises DeviceError where the network failed.
    """
    if network is None or fill is None or not frame.facts.get("network_pending"):
        return False
    milliseconds = network.finish(serial, fill.filled)
    if milliseconds is None:
        return False
    network.presented = frame.facts["camera_key"]
    frame.textures["neural"] = network.picture
    frame.facts["network_pending"] = False
    frame.times.add("network", milliseconds)
    return True
