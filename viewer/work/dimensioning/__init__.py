"""Measured lengths as dimensions of drawings: where they lie on paper, and as entities of DXF."""
