"""Measuring: the tool, how measurements are drawn, and surfaces fitted at a click."""
