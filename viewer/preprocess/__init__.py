"""Decisions about points before they enter the grid: exposure compensation, missing colour, scanner positions.

Each part observes the chunks of pass 1, decides once, and is applied to the chunks of pass 2.  Frame: file coordinates.
"""
