"""LAS and LAZ, COPC included."""
