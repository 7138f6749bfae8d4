"""pointglass: fly through a raw coloured laser scan as if it were a film of the place.

Layers, imports pointing one way only: ``cloud`` (files to grid, no OpenGL) <- ``render`` (grid to picture, no
window) <- ``tools`` and ``window``; ``cli`` on top, imported by nothing.  The network lives beside it in ``model``.
"""

import os

os.environ.setdefault("OMP_WAIT_POLICY", "passive")
"""The network's threads sleep when they have done their share, and do not turn idly for the next: software OpenGL needs the
processors (2 to 5 % of a neural frame at 960x720, two of them).  Before torch is imported, or it is not heard."""

__version__ = "0.1.0"
