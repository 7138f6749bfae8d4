"""``pointglass bench stability``: effects of scale, origin, lens, size, precision and difficult points, each with a limit."""
