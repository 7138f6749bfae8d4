"""Meshes beside the points, as values of a picture and a document."""
