"""Grid to picture: culling, rasterising, filtering, filling, the network, and nothing that needs a window."""
