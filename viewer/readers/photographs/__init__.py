"""Photographs with a pose, whatever they come from."""
