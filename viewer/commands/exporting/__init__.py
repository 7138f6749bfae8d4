"""``pointglass export``: the measured points of a scan, or those in sight, as a LAZ, LAS, PLY or E57 file,
or Gaussian splats of them.

The files of the scan are read again and whole records are written; the grid decides nothing but which points are passers-by.

    one file, its own format, no selection      -> its bytes                          whole_file
    LAS to LAS, E57 to E57                      -> records as stored                  las_copy, e57_copy
    other pairs                                 -> columns (a survey, then a pass)    las_writer, e57_writer, ply_writer
    any pair, into another reference system     -> columns, transformed               reproject
    E57 of feet whose system cannot be stored    -> columns, in metres                  e57_units
    a grid whose files are gone                 -> columns of the grid (selection)
    names of splats (splat_export)              -> splats of the grid points in sight  splat_glb, splat_spz, splat_ply

``record_stream`` reads the records that a ``Selection`` keeps, ``losses`` gathers what the target cannot hold, ``command`` is
the command line's part, and :func:`command.export` the function for other callers.
"""
