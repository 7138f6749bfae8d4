"""Procedural places and a virtual laser scanner: scans with a known truth, and the demo that ships.

World frame of everything here: metres, z up, right-handed.  Cameras have OpenGL axes (x right, y up, -z forward).
"""
