"""Which points a frame draws: frustum, level of detail, occlusion."""
