"""Training: the loop and its checkpoints (``trainer``), losses (``objective``), whole recipes, the command line's part."""
