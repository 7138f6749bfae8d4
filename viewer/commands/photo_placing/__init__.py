"""Searches where photographs without a pose were taken, for commands and the window."""
