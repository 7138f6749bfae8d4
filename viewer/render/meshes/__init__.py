"""Meshes in a picture: triangles to pixels in compiled loops, and their composition with the points by depth."""
