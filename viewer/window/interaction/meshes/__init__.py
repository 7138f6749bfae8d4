"""Meshes beside the scan: reading them, their list and their controls."""
