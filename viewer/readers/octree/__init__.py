"""Folders of an octree: Potree 1 and 2, Entwine point tiles."""
