"""Planes, pipes and circles fitted to the measured points around a click."""
