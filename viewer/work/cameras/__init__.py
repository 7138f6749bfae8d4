"""Cameras from and to files of other programs, and paths through keyframes."""
