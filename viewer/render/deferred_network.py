"""The neural view of a frame: made with the frame, or on a thread of its own and added when the network has ended.

The network's thread is viewer.render.network.network_thread; everything here runs on the thread that draws.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from .frame import Frame, FrameFacts

if TYPE_CHECKING:
    import moderngl

    from .network.neural import NeuralStage
    from .passes.fill import Fill
    from .stage_times import Stages


class NetworkRuns:
    """Runs the network of a renderer's frames.  wake: called on the network's thread when a run has ended."""

    def __init__(self, stages: "Stages", wake: Callable[[], None]):
        self._stages, self._wake = stages, wake
        self._earlier: tuple[NeuralStage, int] | None = None  # whose network goes on, and the number of its frame
        self._awaited: Frame | None = None  # the last frame, if it waits for its network

    def run(self, network: "NeuralStage", frame: Frame, serial: int, *, deferred: bool, streaming: bool, keep: bool,
            missing: int) -> FrameFacts:
        """Adds the neural view to ``frame``, number ``serial``, or starts what will add it.  Returns its facts with what ran.

        deferred, keep: ``defer_network`` and ``keep_network`` of Renderer.render.  missing: points that are not there yet.
        """
        pending, facts, self._earlier, self._awaited = None, frame.facts, None, None
        if deferred and network.deferrable:
            pending = self._start(network, frame, serial, keep=keep, missing=missing)
            if keep and pending:
                self._earlier = network, serial
            self._awaited = frame if pending else None
        else:
            network.drop()
            if not (deferred or streaming):
                network.settle()
            with self._stages("network") as stage:
                stage.elapsed = network.infer()
            with self._stages("present"):
                network.present(frame.textures["filled"])
            network.presented = frame.camera.key
            _add(network, frame)
        if self._earlier is not None:
            return facts  # the frame will not show it
        return replace(facts, device=network.device, network=network.name, bridge=network.bridge_name, network_pending=pending,
                       approximations=(*facts.approximations, *network.approximations))

    def _start(self, network: "NeuralStage", frame: Frame, serial: int, *, keep: bool, missing: int) -> bool:
        """Starts the network, unless points are missing, and shows the previous neural picture meanwhile where its camera is
        the same.  Returns whether it runs."""
        if network.presented == frame.camera.key:
            _add(network, frame)
        if missing:
            network.drop()
        else:
            with self._stages("hand over"):
                network.start(serial, self._wake, keep=keep)
        return not missing

    def finish(self, network: "NeuralStage | None", fill: "Fill | None", frame: Frame, serial: int) -> bool:
        """Adds the neural view to ``frame`` if it is the last one, of number ``serial``, and its network has ended; returns
        whether it did.  Raises DeviceError where the network failed.
        """
        if network is None or fill is None or frame is not self._awaited or not frame.facts.network_pending:
            return False
        milliseconds = network.finish(serial, fill.filled)
        if milliseconds is None:
            return False
        network.presented = frame.camera.key
        _add(network, frame)
        frame.facts = replace(frame.facts, network_pending=False)
        frame.times.add("network", milliseconds)
        return True

    def finish_earlier(self, target: "moderngl.Texture") -> bool:
        """Writes the neural picture of the frame whose network goes on into ``target``, of its size, once it has ended; its
        alpha is the network's own.  Returns whether it did.  Raises DeviceError where the network failed."""
        if self._earlier is None or not self._earlier[0].finish_into(self._earlier[1], target):
            return False
        self._earlier = None
        return True

    @property
    def keeps(self) -> bool:
        """Whether the network of an earlier frame goes on."""
        return self._earlier is not None

    def forget_earlier(self) -> None:
        """The networks of earlier frames were dropped."""
        self._earlier = None


def _add(network: "NeuralStage", frame: Frame) -> None:
    """The picture that ``network`` presented last is the neural view of ``frame``."""
    frame.textures["neural"] = network.picture
    if network.photo_share is not None:
        frame.photo_shares["neural"] = network.photo_share
    else:
        frame.photo_shares.pop("neural", None)
