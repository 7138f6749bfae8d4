"""pointglass: fly through a raw coloured laser scan as if it were a film of the place.

Rooms, in the order of imports: ``common``, ``picture``, ``readers``, ``preprocess``, ``grid``, ``stream`` (files to grid, no
OpenGL), ``render`` (grid to picture, no window), ``work``, ``commands``, ``window``, ``bench``, ``interface``.  ``cli`` imports
them, and nothing imports it.  ``model``: the network, its training and its evaluation.
"""

__version__ = "0.1.0"
