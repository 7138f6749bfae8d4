"""The networks, their weights, and how they run."""
