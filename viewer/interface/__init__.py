"""What ``import pointglass`` offers; pointglass.py names it and says what it is for.

Imports of heavy libraries happen where they are used: opening a scan loads neither torch nor OpenGL.
"""
