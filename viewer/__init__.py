"""pointglass: fly through a raw coloured laser scan as if it were a film of the place.

Layers; imports point one way: ``readers``, ``preprocess``, ``grid`` and ``stream`` (files to grid, no OpenGL) <- ``render``
(grid to picture, no window) <- ``tools`` <- ``window``; ``cli`` imports them and nothing imports it.  ``model``: the network.
"""

__version__ = "0.1.0"
