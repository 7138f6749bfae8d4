"""E57: its structure, its records in blocks, its photographs."""
