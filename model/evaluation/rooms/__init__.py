"""Rooms evaluated view by view, by one process or by several."""
