"""Photographs and RGB-D frames with poses, as training data."""
