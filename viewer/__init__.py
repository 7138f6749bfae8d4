"""pointglass: fly through a raw coloured laser scan as if it were a film of the place.

Layers, imports pointing one way only: ``cloud`` (files to grid, no OpenGL) <- ``render`` (grid to picture, no
window) <- ``tools`` and ``window``; ``cli`` on top, imported by nothing.  The network lives beside it in ``model``.
"""

__version__ = "0.1.0"
