"""How a grid is built from the points of a source, in two passes."""
