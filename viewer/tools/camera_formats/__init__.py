"""One module a camera format; each returns a list of :class:`viewer.camera.Camera`, names as the file has them."""
