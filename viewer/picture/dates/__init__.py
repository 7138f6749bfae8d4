"""Two dates of a place: what is kept of their comparison."""
