"""Scan files of every format as chunks of points; no grid and no OpenGL here.

    path -> open_source (the file's first bytes decide) -> Source -> chunks of float64 coordinates, colour, intensity

A module or a folder of modules per format, named in ``formats.FORMATS``, each with its own checks: a file's header is checked
against the file before a decoding library reads it.  ``source`` is what they implement; the other modules here are shared.
Frame: the file's own coordinates, in the file's own units.
"""
