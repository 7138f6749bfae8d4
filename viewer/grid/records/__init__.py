"""The way back from a point of the grid to its record in the file."""
