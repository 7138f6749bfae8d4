"""Mesh files: which files are meshes, reading them with trimesh, and the meshes that are in memory."""
