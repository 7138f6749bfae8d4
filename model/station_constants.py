"""Constants of view-dependent blending, shared by its shaders and model/station_weights.py; imports no torch."""

HEAVIEST = 15
"""Weights are whole numbers from 1 to 15, so that sums of them and of 12-bit light stay exact in 16 bits and a carry."""
UNPLACED = 4
"""Weight of a point whose scanner position is unknown, in a scan where other positions are known."""
TRUST_BLOCK = 8
"""Pixels a side of the blocks over which weights, and tones, are compared."""
FEW = 512.0
"""Sum over a block of squared confidence, in 255ths, at which the block's other pixels are raised half way to full confidence:
the sum of two fully confident pixels in 64."""
