"""Scans as training data: meshes, projection, painting."""
