"""Clip boxes and slabs."""
