"""``pointglass section``: plans, elevations and sections, orthographic and to scale, of measured points only.

    cut (where: a plane and a thickness) -> orthographic (points of the slab -> pixels) -> sheet (frame, scale bar, PNG or PDF)

``command`` is the command line's part.  The window's Section tool uses the same three.
"""
