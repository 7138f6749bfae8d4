"""The Compare tool: distances between two scans that are open together, shown as colours of points."""
