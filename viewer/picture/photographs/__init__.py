"""Photographs that a document places in the scan."""
