"""Photographs: prepared once for a scan, chosen for a view, and laid onto the surfaces of the filled picture."""
