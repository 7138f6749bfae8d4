"""Distances between two scans of one place: nearest surface (c2c) and M3C2, each with its uncertainty.  No window, no OpenGL.

    point_cells (points sorted into cells) -> cloud_scale (spacing, noise, default sizes)
        -> surface_distance | m3c2 (distances along unsigned normals) -> facing (their sign) -> compare

``tests/unit/work/plain_distances.py`` has the reference implementations of both.  Frame: file coordinates, file units.
"""
