"""A place of many files: each file has its own grid in the cache, on one lattice; a scene joins them."""
