"""A scan in a notebook: ``Scan.show``, an anywidget whose pictures the kernel renders, and ``show_published``, a frame.

    scan_view.js (events, one at a time) -> scan_widget -> guided_view (camera, pictures) -> JPEG -> scan_view.js
"""
