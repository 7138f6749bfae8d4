"""Tools: what pointer and keys do in the picture, one tool per file, listed in ``table.py``; and the table of controls."""
