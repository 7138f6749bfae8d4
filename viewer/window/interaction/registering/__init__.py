"""Align: a scan is moved to its place beside another."""
