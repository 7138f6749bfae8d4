"""Colours of a scan: exposure between its stations, noise, point spacing."""
