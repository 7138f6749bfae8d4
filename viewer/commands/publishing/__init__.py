"""``pointglass publish``: a static folder of panoramas with depth, which any browser shows without a server."""
