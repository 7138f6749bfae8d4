"""Selecting points: by an outline on the picture, a box, a side of a plane, or what hangs together."""
