"""Data sets: what the network learns from and is judged on."""
