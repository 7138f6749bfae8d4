"""Layout of the network's packed pixels, shared by the renderer's shaders and the network; imports nothing heavy.

Input: (H, W, PACKED_IN) half floats: RGB, confidence, depth, noise level, CLOSED, VOID.  Output: (H, W, PACKED_OUT): RGB and
coverage, all 0..1.
"""

PACKED_IN, PACKED_OUT = 8, 4
CLOSED = 6
"""Channel: 1 in a view direction that the scan encloses, which therefore cannot show the background."""
VOID = 7
"""Channel: share of the pixel that is background, 0..1."""
