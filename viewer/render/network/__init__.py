"""The network in a frame: its thread, and the bridges that take pixels to torch and back."""
