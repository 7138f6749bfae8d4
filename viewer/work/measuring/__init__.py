"""Measurements: what can be measured, its value and uncertainty, its text, and files of it."""
