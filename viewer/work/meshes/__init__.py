"""Meshes beside scans: new ones, those of pictures and projects found again, places on them."""
