"""Training: the loop and its checkpoints (``trainer``), losses (``objective``), complete recipes, and the command line."""
