"""Gaussian splats computed from measured points, without training.  No window, no OpenGL.

    selected points -> splat_cells (an octree of cells with moments) -> splat_budget (which cells become splats)
        -> splat_shapes (place, axes and colour of each) -> view_colours (with the direction of view) -> splat_cloud

``make_splats`` runs all of it for a selection; ``tests/unit/work/plain_splats.py`` has the reference implementations.  Frame:
file coordinates relative to an origin, file units.
"""
