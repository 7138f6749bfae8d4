"""From chunks of points to a uniform grid with density layers, and its cache on disk; no OpenGL here.

    Source -> pass 1 (count_points, histogram) -> layout -> pass 2 (scatter) -> Scene -> cache: memory-mapped .npy files

``open_scene`` is the entry point, ``two_passes`` the sequence of the steps.  Frame: the file's own coordinates, float64, in the
file's own units.  File libraries and compiled kernels load only when a scan has to be read, so a cached scene opens without
them.
"""
