"""Tools: what the pointer and the keys do in the picture.  One tool per file, listed in ``table.py``."""
