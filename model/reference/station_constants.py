"""Constants of view-dependent blending, shared by its shaders and model/reference/station_weights.py; imports no torch."""

HEAVIEST = 15
"""Largest weight of a point.  Weights are integers from 1 to 15, so that sums of them and of 12-bit light stay exact in
16 bits and a carry."""
UNPLACED = 4
"""Weight of a point whose scanner position is unknown, in a scan where other positions are known: half of the typical weight of
a point that decides a pixel (TYPICAL_WEIGHT, model/network/network_layout.py)."""
CONFIDENCE_BLOCK = 8
"""Side, pixels, of the blocks over which weights and mean colours are compared.  One view each of kitchen, atrium and
living-room-2, at all and at one in ten points: the PSNR of the network's input changes with half by -0.03 to 0.04 dB, but 0.15
dB in the atrium at all points, with twice by -0.07 to 0.02 dB."""
CONFIDENCE_HALF_SUM = 512.0
"""Sum over a block of squared confidence / 256, confidence in 255ths, at which the block's other pixels are raised half way to
full confidence: about the sum of two fully confident pixels of the block's 64."""
