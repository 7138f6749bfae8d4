"""SPZ, a format of Gaussian splats only."""
