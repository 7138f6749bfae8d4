"""``pointglass compare``: distances between two scans of one place, as points, table and picture.

    read_cloud (points and stations of the files) -> viewer.work.comparing -> distances_laz, distances_csv, distances_picture

``command`` is the command line's part.
"""
