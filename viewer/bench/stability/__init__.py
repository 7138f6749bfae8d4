"""``pointglass bench stability``: scale, origin, lens, size, precision and difficult points, each with a limit (``table``)."""
