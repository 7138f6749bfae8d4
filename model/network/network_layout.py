"""Layout of the network's packed pixels, shared by the renderer's shaders and the network; imports nothing heavy.

Input: (H, W, PACKED_IN) half floats: RGB, confidence, depth feature, noise level, CLOSED, BACKGROUND.
Output: (H, W, PACKED_OUT) half floats: RGB and coverage.  All but the depth feature are 0..1.
"""

PACKED_IN, PACKED_OUT = 8, 4
"""Channels of a packed pixel; multiples of four, because the shaders read and write half-float quadruples."""
CLOSED = 6
"""Channel: 1 in a view direction that the scan encloses, which therefore cannot show the background."""
BACKGROUND = 7
"""Channel: share of the pixel that is background, 0..1."""
DEPTH_FEATURE_SCALE = 0.25
"""Depth feature units in a doubling of depth (model.reference.projection.depth_feature), as the shipped weights were trained:
they depend on it."""
DEPTH_FEATURE_LIMIT = 2.0
"""The depth feature is clipped to plus and minus this: 8 doublings of depth at DEPTH_FEATURE_SCALE."""
NOISE_SCALE = 20.0
"""The noise level is NOISE_SCALE times the standard deviation of a pixel's mean colour: 1 for 0.05 of full brightness."""
TYPICAL_WEIGHT = 8.0
"""The station weight (1 to 15, model/reference/station_weights.py) that counts as one averaged point in the noise level: about
the mean weight of the points that decide a pixel.  The network is trained with the same value."""
