"""Procedural places and a virtual laser scanner: they make scans with known ground truth, and the demo scan in assets/.

World frame of this package: metres, z up, right-handed.  Cameras have OpenGL axes (x right, y up, -z forward).
"""
